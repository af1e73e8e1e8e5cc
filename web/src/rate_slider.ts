const kSteps = 1000;
const kLeastMbps = 0.5;
const kEveryMs = 100; // what is sent to the gateway at most

/** Mbit/s at a place of the slider, 0 to 1: even steps change the rate by even factors. */
export function mbpsAt(place: number, mostMbps: number): number {
  const least = Math.min(kLeastMbps, mostMbps / 10);
  return least * (mostMbps / least) ** place;
}

/** How much of the link a viewer wants to use; hidden where the scene does not control its rate. */
export class RateSlider {
  private mostMbps: number | null = null;
  private timer = 0;
  private isChosen = false; // somebody has moved it

  constructor(
    private readonly section: HTMLElement,
    private readonly input: HTMLInputElement,
    private readonly output: HTMLElement,
    private readonly onTarget: (mbps: number) => void,
  ) {
    input.min = "0";
    input.max = String(kSteps);
    input.value = input.max; // after the limits, which cut it off
    input.addEventListener("input", () => this.moved());
  }

  /** The most that the scene sends; null: it does not control its rate. The place of the slider stays. */
  offer(mostMbps: number | null): void {
    const isOther = mostMbps !== this.mostMbps;
    this.mostMbps = mostMbps;
    this.section.hidden = mostMbps === null;
    if (!isOther) return;
    this.tell();
    if (this.isChosen) this.ask();
  }

  private targetMbps(): number | null {
    return this.mostMbps === null ? null : mbpsAt(Number(this.input.value) / kSteps, this.mostMbps);
  }

  private tell(): void {
    const mbps = this.targetMbps();
    if (mbps === null) return;
    this.output.textContent = `${mbps.toPrecision(2)} Mbit/s`;
    this.input.setAttribute("aria-valuetext", this.output.textContent);
  }

  private moved(): void {
    this.tell();
    this.isChosen = true;
    if (this.timer !== 0) return;
    this.timer = window.setTimeout(() => {
      this.timer = 0;
      this.ask();
    }, kEveryMs);
  }

  private ask(): void {
    const mbps = this.targetMbps();
    if (mbps !== null) this.onTarget(mbps);
  }
}
