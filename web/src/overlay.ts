/** What the overlay shows; each field's element is found by data-testid. */
export interface Readings {
  readonly received: string;
  readonly "frame-rate": string;
  readonly latency: string;
  readonly "mesh-rate": string;
  readonly "still-mesh-rate": string;
  readonly "texture-rate": string;
  readonly "plate-rate": string;
  readonly triangles: string;
  readonly chunks: string;
  readonly capture: string;
  readonly coding: string;
  readonly device: string;
}

const kLabels: Readonly<Record<keyof Readings, string>> = {
  received: "Received",
  "frame-rate": "Captures shown",
  latency: "Capture to screen",
  "mesh-rate": "Mesh, moving",
  "still-mesh-rate": "Mesh, still",
  "texture-rate": "Texture, moving",
  "plate-rate": "Texture, still",
  triangles: "Triangles",
  chunks: "Chunks",
  capture: "Capture",
  coding: "What moves, coded",
  device: "Drawn by",
};
const kEveryMs = 500;

/** Numbers in a corner; costs nothing while it is closed. */
export class Overlay {
  private timer = 0;
  private readonly fields = new Map<keyof Readings, HTMLElement>();

  constructor(element: HTMLElement, private readonly read: () => Readings) {
    for (const key of Object.keys(kLabels) as (keyof Readings)[]) {
      const label = document.createElement("dt");
      label.textContent = kLabels[key];
      const field = document.createElement("dd");
      field.dataset["testid"] = key;
      element.append(label, field);
      this.fields.set(key, field);
    }
  }

  setRunning(isRunning: boolean): void {
    clearInterval(this.timer);
    if (!isRunning) return;
    this.timer = window.setInterval(() => this.update(), kEveryMs);
    this.update();
  }

  private update(): void {
    const readings = this.read();
    for (const [key, field] of this.fields) field.textContent = readings[key];
  }
}
