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
  /** Its pictures are as coarse as rate control can make them. */
  readonly isCoarsest: boolean;
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
const kJoiningMs = 1500; // sensors that come so soon after the first capture were not missing
const kMissingAfterMs = 1000;
const kBackAfterMs = 1000;
const kStaleMs = 1500; // behind the capture
const kStaleAfterMs = 300; // on top of that: a sensor that stays behind is told as soon as one that is not named
const kIntervalsLate = 2.5; // of a sensor's own: a capture that comes late is none that is missing
const kSlowMs = 800; // between the captures of a sensor that need not be named all the time
const kSlower = 1.5; // than the scene: else it is this page that sees few captures
const kMostNamed = 3;

/** Says yes when something has held for a while, and no when the opposite has: no flicker. */
export class Hysteresis {
  private since: number | null = null; // when the other answer began
  private answer = false;

  constructor(private readonly raisedAfterMs = kRaisedAfterMs, private readonly clearedAfterMs = kClearedAfterMs) {}

  /** What was seen until now does not count towards the next answer. */
  forget(): void {
    this.since = null;
  }

  /** `now`: yes, no, or something between that changes nothing. `raisedAfterMs`: of a yes that is surer than others. */
  update(nowMs: number, now: "yes" | "no" | "between", raisedAfterMs = this.raisedAfterMs): boolean {
    const differs = this.answer ? now === "no" : now === "yes";
    if (!differs) this.since = null;
    else this.since ??= nowMs;
    if (this.since !== null && nowMs - this.since >= (this.answer ? this.clearedAfterMs : raisedAfterMs)) {
      this.answer = !this.answer;
      this.since = null;
    }
    return this.answer;
  }
}

type Presence = "there" | "stale" | "absent";

/** The usual time between captures, by when they were captured; ms. */
class Interval {
  private readonly intervals = new Median(9);
  lastNs: bigint | null = null;

  add(capturedAtNs: bigint): void {
    if (this.lastNs !== null && capturedAtNs > this.lastNs) this.intervals.add(Number(capturedAtNs - this.lastNs) / 1e6);
    this.lastNs = capturedAtNs;
  }

  usualMs(): number {
    return this.intervals.value() ?? 0;
  }
}

/** Whether one sensor's captures come, by the scene's captures, which say when it last had one. */
class SensorWatch {
  private readonly interval = new Interval();
  private readonly missing = new Hysteresis(kMissingAfterMs, kBackAfterMs);

  came(capturedAtNs: bigint): void {
    this.interval.add(capturedAtNs);
  }

  forget(): void {
    this.missing.forget();
  }

  /** `scene`: of its captures, of which the newest names the sensor or does not. */
  isMissing(nowMs: number, scene: Interval, isNamed: boolean): boolean {
    const presence = this.presence(scene, isNamed);
    const afterMs = presence === "stale" ? kStaleAfterMs : kMissingAfterMs;
    return this.missing.update(nowMs, presence === "there" ? "no" : "yes", afterMs);
  }

  private presence(scene: Interval, isNamed: boolean): Presence {
    const { lastNs } = this.interval;
    if (lastNs === null || scene.lastNs === null) return "absent";
    const behindMs = Number(scene.lastNs - lastNs) / 1e6;
    const usualMs = this.interval.usualMs();
    const isBetweenItsOwn = behindMs <= kIntervalsLate * usualMs;
    if (isNamed) return behindMs <= kStaleMs || isBetweenItsOwn ? "there" : "stale";
    // Left out between two captures of its own, for which the scene does not wait.
    const isSlow = usualMs >= kSlowMs && usualMs > kSlower * scene.usualMs();
    return isSlow && isBetweenItsOwn ? "there" : "absent";
  }
}

/** Whether captures come too slowly or late, or a sensor is missing, in words. No clock inside. */
export class Health {
  private readonly recent: Came[] = [];
  private readonly slow = new Hysteresis();
  private readonly late = new Hysteresis();
  private readonly latency = new Median(15);
  private readonly watches: readonly SensorWatch[];
  private readonly captures = new Interval();
  private firstMs: number | null = null;
  private saidRate = 0;
  private slowText = "";
  private lateText = "";

  /** Of the scene: names by the sensors' numbers, captures a second. */
  constructor(private readonly sensors: readonly string[], private readonly fps: number) {
    this.watches = sensors.map(() => new SensorWatch());
  }

  came(capture: Came): void {
    this.firstMs ??= capture.atMs;
    this.recent.push(capture);
    this.captures.add(capture.capturedAtNs);
    for (const source of capture.sources) this.watches[source.sensor]?.came(source.capturedAtNs);
    if (capture.latencyMs !== null) this.latency.add(capture.latencyMs);
  }

  /** One line for each thing that is wrong, as of now. To be asked about several times a second. */
  words(nowMs: number): string[] {
    while (this.recent.length > 0 && this.recent[0]!.atMs < nowMs - kWindowMs) this.recent.shift();
    if (this.recent.length === 0) this.firstMs = null; // a pause, or a hidden page: counted anew from the next capture
    const forMs = this.firstMs === null ? 0 : nowMs - this.firstMs;
    if (forMs < kWindowMs) for (const one of [this.slow, this.late]) one.forget();
    if (forMs < kJoiningMs) for (const watch of this.watches) watch.forget();
    return [
      ...(forMs < kWindowMs ? [] : [...this.slowWords(nowMs), ...this.lateWords(nowMs)]),
      ...(forMs < kJoiningMs ? [] : this.missingWords(nowMs)),
    ];
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
      const captures = `${whole(rate)} of ${whole(this.fps)} captures a second.`;
      const coarsest = this.recent.filter(({ isCoarsest }) => isCoarsest).length;
      if (coarsest > this.recent.length / 2) this.slowText = `The scene takes more than this bandwidth: ${captures}`;
      else if (work > kOwnShare * kWindowMs) this.slowText = `This device is slower than the sensors: ${captures}`;
      else this.slowText = `The server is slower than the sensors: ${captures}`;
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
    const named = new Set(this.recent.at(-1)!.sources.map((source) => source.sensor));
    const names = this.sensors.filter((_, i) => this.watches[i]!.isMissing(nowMs, this.captures, named.has(i)));
    if (names.length === 0) return [];
    if (names.length > kMostNamed) return [`${names.length} of ${this.sensors.length} sensors are missing.`];
    const last = names.at(-1)!;
    return [names.length === 1 ? `${last} is missing.` : `${names.slice(0, -1).join(", ")} and ${last} are missing.`];
  }
}

function whole(rate: number): string {
  return rate < 1 ? rate.toFixed(1) : rate.toFixed(0);
}
