import { clamp } from "./vec.ts";

const kSteps = [1, 0.8, 0.65, 0.5] as const;
const kSlowMs = 28;
const kQuickMs = 19;
const kSlowFrames = 12; // in a row
const kQuickFrames = 90;
const kLongestMs = 250; // a longer pause is none of drawing
const kMostPatience = 16;

/** How many pixels of the device are drawn: fewer while frames take too long, more again later. No clock inside. */
export class Resolution {
  private step = 0;
  private slow = 0;
  private quick = 0;
  private patience = 1; // grows with each rise that did not last

  /** Of the full resolution, along a side. */
  scale(): number {
    return kSteps[this.step]!;
  }

  /** The time since the frame before, both drawn one after the other. Whether the scale is another now. */
  drew(ms: number): boolean {
    if (ms > kLongestMs) return false;
    this.slow = ms > kSlowMs ? this.slow + 1 : 0;
    this.quick = ms < kQuickMs ? this.quick + 1 : 0;
    if (this.slow >= kSlowFrames && this.step < kSteps.length - 1) return this.move(1);
    if (this.quick >= kQuickFrames * this.patience && this.step > 0) return this.move(-1);
    return false;
  }

  private move(by: 1 | -1): boolean {
    if (by > 0) this.patience = Math.min(kMostPatience, 2 * this.patience);
    this.step += by;
    this.slow = this.quick = 0;
    return true;
  }
}

/** What makes pictures differ from each other: the eye moves, only the scene does, or nothing. */
export type Motion = "eye" | "scene" | "nothing";

// Drawn by the processor, a larger picture is made smaller and stretched while the eye moves: motion matters more. What stays is drawn
// once for an eye that rests.
const kMostSoftwarePixels = { eye: 300_000, scene: 1_000_000 } as const;
const kMostPixels = 16_000_000;
const kMostStillSoftwarePixels = 2_500_000;
const kStillSoftwareSamples = 2; // along a side: the browser's shrinking smooths edges

export interface Screen {
  /** CSS pixels. */
  readonly width: number;
  readonly height: number;
  readonly devicePixelRatio: number;
}

/** Drawn pixels for each CSS pixel along a side. */
export function pixelRatio(screen: Screen, isSoftware: boolean, motion: Motion, scale: number): number {
  const area = Math.max(1, screen.width * screen.height);
  const within = (pixels: number, ratio: number): number => Math.min(ratio, Math.sqrt(pixels / area));
  const full = clamp(screen.devicePixelRatio, 0.5, 4);
  if (!isSoftware) return within(kMostPixels, motion === "nothing" ? full : full * scale);
  if (motion === "nothing") return within(kMostStillSoftwarePixels, full * kStillSoftwareSamples);
  return within(kMostSoftwarePixels[motion], motion === "eye" ? 1 : full);
}
