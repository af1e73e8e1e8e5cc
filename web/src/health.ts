import type { Source } from "./packet.ts";
import { Median } from "./statistics.ts";

/** What the link's end sees of the captures; ms of any one clock. */
export interface Came {
  readonly atMs: number;
  readonly capturedAtNs: bigint;
  readonly sources: readonly Pick<Source, "sensor" | "capturedAtNs">[];
  /** From arriving to being on the screen. */
  readonly workMs: number;
  /** From the capture to the screen; null where the clocks are not known. */
  readonly latencyMs: number | null;
}

const kWindowMs = 4000;
const kRaisedAfterMs = 3000;
const kClearedAfterMs = 2000;
const kTooFew = 0.6; // of the sensors' rate
const kEnough = 0.75;
const kOther = 2; // times the rate that was said: then that is said anew
const kOwnShare = 0.7; // of the time: then it is this device that is slow
const kLateMs = 2000;
const kInTimeMs = 1200;
const kStaleNs = 2_000_000_000n;
const kMostNamed = 3;

/** Says yes when something has held for a while, and no when the opposite has: no flicker. */
export class Hysteresis {
  private since: number | null = null; // when the other answer began
  private answer = false;

  /** What was seen until now does not count towards the next answer. */
  forget(): void {
    this.since = null;
  }

  /** `now`: yes, no, or something between that changes nothing. */
  update(nowMs: number, now: "yes" | "no" | "between"): boolean {
    const differs = this.answer ? now === "no" : now === "yes";
    if (!differs) this.since = null;
    else this.since ??= nowMs;
    if (this.since !== null && nowMs - this.since >= (this.answer ? kClearedAfterMs : kRaisedAfterMs)) {
      this.answer = !this.answer;
      this.since = null;
    }
    return this.answer;
  }
}

/** Whether captures come too slowly or late, or a sensor is missing, in words. No clock inside. */
export class Health {
  private readonly recent: Came[] = [];
  private readonly slow = new Hysteresis();
  private readonly late = new Hysteresis();
  private readonly latency = new Median(15);
  private readonly missing: Hysteresis[];
  private firstMs: number | null = null;
  private saidRate = 0;
  private slowText = "";
  private lateText = "";

  /** Of the scene: names by the sensors' numbers, captures a second. */
  constructor(private readonly sensors: readonly string[], private readonly fps: number) {
    this.missing = sensors.map(() => new Hysteresis());
  }

  came(capture: Came): void {
    this.firstMs ??= capture.atMs;
    this.recent.push(capture);
    if (capture.latencyMs !== null) this.latency.add(capture.latencyMs);
  }

  /** One line for each thing that is wrong, as of now. To be asked about once a second. */
  words(nowMs: number): string[] {
    while (this.recent.length > 0 && this.recent[0]!.atMs < nowMs - kWindowMs) this.recent.shift();
    if (this.recent.length === 0) this.firstMs = null; // a pause, or a hidden page: counted anew from the next capture
    if (this.firstMs === null || nowMs - this.firstMs < kWindowMs) {
      for (const one of [this.slow, this.late, ...this.missing]) one.forget();
      return [];
    }
    return [...this.slowWords(nowMs), ...this.lateWords(nowMs), ...this.missingWords(nowMs)];
  }

  private slowWords(nowMs: number): string[] {
    const rate = (this.recent.length * 1000) / kWindowMs;
    const share = rate / this.fps;
    const was = this.slow.update(nowMs, share < kTooFew ? "yes" : share > kEnough ? "no" : "between");
    if (!was) {
      this.slowText = "";
      return [];
    }
    // Stays as it was said while that is about right: numbers that change every second are read by nobody.
    const about = rate < kOther * this.saidRate && this.saidRate < kOther * rate;
    if (this.slowText === "" || !about) {
      this.saidRate = rate;
      const work = this.recent.reduce((sum, { workMs }) => sum + workMs, 0);
      const who = work > kOwnShare * kWindowMs ? "This device" : "The server";
      this.slowText = `${who} is slower than the sensors: ${whole(rate)} of ${whole(this.fps)} captures a second.`;
    }
    return [this.slowText];
  }

  private lateWords(nowMs: number): string[] {
    const latency = this.latency.value() ?? 0;
    const was = this.late.update(nowMs, latency > kLateMs ? "yes" : latency < kInTimeMs ? "no" : "between");
    if (!was) this.lateText = "";
    else if (this.lateText === "") this.lateText = `The picture is ${(latency / 1000).toFixed(0)} s late.`;
    return was ? [this.lateText] : [];
  }

  private missingWords(nowMs: number): string[] {
    const { sources, capturedAtNs } = this.recent.at(-1)!;
    const present = new Set<number>();
    for (const source of sources) if (capturedAtNs - source.capturedAtNs <= kStaleNs) present.add(source.sensor);
    const names = this.sensors.filter((_, i) => this.missing[i]!.update(nowMs, present.has(i) ? "no" : "yes"));
    if (names.length === 0) return [];
    if (names.length > kMostNamed) return [`${names.length} of ${this.sensors.length} sensors are missing.`];
    const last = names.at(-1)!;
    return [names.length === 1 ? `${last} is missing.` : `${names.slice(0, -1).join(", ")} and ${last} are missing.`];
  }
}

function whole(rate: number): string {
  return rate < 1 ? rate.toFixed(1) : rate.toFixed(0);
}
