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

/** Quiet words that can be sent away; those that were stay away until they are others, or there was nothing to say meanwhile. */
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
    if (words === "") this.dismissed = "";
    this.update();
  }

  private update(): void {
    this.element.hidden = this.said === "" || this.said === this.dismissed;
    this.text.textContent = this.said;
  }
}

/** Asks for the token of a locked scene. */
export class LockForm {
  constructor(
    private readonly form: HTMLFormElement,
    private readonly field: HTMLInputElement,
    private readonly error: HTMLElement,
    private readonly submit: HTMLButtonElement,
    private readonly scene: HTMLElement,
    onToken: (token: string) => void,
  ) {
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.setBusy(true);
      onToken(field.value.trim());
    });
    field.addEventListener("input", () => this.complain(""));
  }

  /** `reason`: why the last token was refused; empty where none was. */
  show(reason: string): void {
    this.form.hidden = false;
    this.setBusy(false);
    this.complain(reason);
    this.field.focus();
    this.field.select();
  }

  /** Leaves nothing of the token behind, and the keys to the scene. */
  hide(): void {
    if (this.form.contains(document.activeElement)) this.scene.focus();
    this.form.reset();
    this.complain("");
    this.form.hidden = true;
  }

  private setBusy(isBusy: boolean): void {
    this.submit.disabled = isBusy;
  }

  private complain(reason: string): void {
    this.error.textContent = reason;
    if (reason === "") this.field.removeAttribute("aria-invalid");
    else this.field.setAttribute("aria-invalid", "true");
  }
}
