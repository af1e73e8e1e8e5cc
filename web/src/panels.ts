/** A panel and the button that opens it. */
export class Panel {
  constructor(
    private readonly button: HTMLButtonElement,
    private readonly panel: HTMLElement,
    private readonly onChange: (isOpen: boolean) => void = () => {},
  ) {
    button.addEventListener("click", () => this.toggle());
  }

  isOpen(): boolean {
    return !this.panel.hidden;
  }

  toggle(): void {
    this.setOpen(!this.isOpen());
  }

  setOpen(isOpen: boolean): void {
    if (isOpen === this.isOpen()) return;
    if (!isOpen && this.panel.contains(document.activeElement)) this.button.focus();
    this.panel.hidden = !isOpen;
    for (const state of ["aria-pressed", "aria-expanded"]) this.button.setAttribute(state, String(isOpen));
    this.onChange(isOpen);
  }
}

/** Quiet words that can be sent away; those that were stay away until they are others. */
export class Notice {
  private dismissed = "";
  private said = "";

  constructor(private readonly element: HTMLElement, private readonly text: HTMLElement, dismiss: HTMLButtonElement) {
    dismiss.addEventListener("click", () => {
      this.dismissed = this.said;
      this.update();
    });
  }

  say(words: string): void {
    if (words === this.said) return;
    this.said = words;
    this.update();
  }

  private update(): void {
    this.element.hidden = this.said === "" || this.said === this.dismissed;
    this.text.textContent = this.said;
  }
}
