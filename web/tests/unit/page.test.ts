import assert from "node:assert/strict";
import { test } from "node:test";
import { Health, Hysteresis } from "../../src/health.ts";
import { pixelRatio, Resolution } from "../../src/resolution.ts";

interface Stream {
  readonly fps: number;
  readonly workMs?: number;
  readonly latencyMs?: number;
  readonly sensors?: readonly number[];
  readonly isCoarsest?: boolean;
}

/** What is said after each second of a stream. */
function listen(health: Health, fromS: number, seconds: number, { fps, workMs = 5, latencyMs = 100, sensors = [0, 1], isCoarsest = false }: Stream): string[] {
  const said: string[] = [];
  for (let s = fromS; s < fromS + seconds; ++s) {
    for (let i = 0; i < fps; ++i) {
      const atMs = 1000 * (s + i / fps);
      const capturedAtNs = BigInt(Math.round(atMs * 1e6));
      health.came({ atMs, capturedAtNs, sources: sensors.map((sensor) => ({ sensor, capturedAtNs })), workMs, latencyMs, isCoarsest });
    }
    said.push(health.words(1000 * (s + 1)).join(" "));
  }
  return said;
}

test("nothing is said of a stream that keeps up", () => {
  const said = listen(new Health(["a", "b"], 30), 0, 30, { fps: 28 });
  assert.ok(said.every((words) => words === ""), said.join("|"));
});

test("a slow server is told after some seconds, with the same words until it is quick again", () => {
  const health = new Health(["a", "b"], 30);
  const slow = listen(health, 0, 20, { fps: 6 });
  assert.equal(slow[3], "");
  assert.equal(slow.at(-1), "The server is slower than the sensors: 6 of 30 captures a second.");
  assert.equal(new Set(slow.filter((words) => words !== "")).size, 1);
  const between = listen(health, 20, 10, { fps: 20 }); // neither slow nor quick
  assert.notEqual(between.at(-1), "");
  assert.equal(listen(health, 30, 15, { fps: 30 }).at(-1), "");
});

test("where captures are left out for want of bandwidth, that is told", () => {
  const said = listen(new Health(["a", "b"], 30), 0, 10, { fps: 6, isCoarsest: true });
  assert.equal(said.at(-1), "The scene takes more than this bandwidth: 6 of 30 captures a second.");
});

test("a slow server that has become much quicker is told anew", () => {
  const health = new Health(["a", "b"], 30);
  assert.match(listen(health, 0, 10, { fps: 2 }).at(-1)!, /: 2 of 30/);
  const quicker = listen(health, 10, 20, { fps: 10 });
  assert.match(quicker.at(-1)!, /: \d+ of 30/);
  assert.doesNotMatch(quicker.at(-1)!, /: 2 of 30/);
});

test("a page that was hidden for a while does not call the server slow when it is back", () => {
  const health = new Health(["a", "b"], 30);
  listen(health, 0, 8, { fps: 30 });
  for (let s = 9; s < 15; ++s) health.words(1000 * s);
  const said = listen(health, 15, 10, { fps: 30 });
  assert.ok(said.every((words) => words === ""), said.join("|"));
});

test("a slow browser is not blamed on the server", () => {
  assert.match(listen(new Health(["a", "b"], 30), 0, 20, { fps: 5, workMs: 190 }).at(-1)!, /^This device is slower/);
});

test("a picture that comes late is told", () => {
  assert.match(listen(new Health(["a", "b"], 30), 0, 12, { fps: 30, latencyMs: 4100 }).at(-1)!, /4 s late/);
});

interface Source {
  readonly sensor: number;
  readonly capturedAtNs: bigint;
}

/** What is said, and when it was first said, asked for ten times a second of 30 captures a second; `sourcesAt`: of a capture. */
function watch(health: Health, fromMs: number, forMs: number, sourcesAt: (ms: number) => readonly Source[], fps = 30): [number, string][] {
  const said: [number, string][] = [];
  const everyMs = 1000 / fps;
  let nextMs = fromMs;
  for (let atMs = fromMs; atMs < fromMs + forMs; atMs += 10) {
    for (; nextMs <= atMs; nextMs += everyMs)
      health.came({ atMs: nextMs, capturedAtNs: nsOf(nextMs), sources: sourcesAt(nextMs), workMs: 5, latencyMs: null, isCoarsest: false });
    if (atMs % 100 !== 0) continue;
    const words = health.words(atMs).join(" ");
    if (words !== (said.at(-1)?.[1] ?? "")) said.push([atMs, words]);
  }
  return said;
}
const nsOf = (ms: number): bigint => BigInt(Math.round(ms * 1e6));
const named = (ms: number, ...sensors: readonly number[]): Source[] =>
  sensors.map((sensor) => ({ sensor, capturedAtNs: nsOf(ms) }));

test("a sensor that is gone is told a second after it is left out, and no longer a second after it is back", () => {
  const health = new Health(["a", "b"], 30);
  const said = watch(health, 0, 12_000, (ms) => (ms > 6000 && ms < 9000 ? named(ms, 0) : named(ms, 0, 1)));
  assert.deepEqual(said.map(([, words]) => words), ["b is missing.", ""]);
  const [[toldMs], [backMs]] = said as [[number, string], [number, string]];
  assert.ok(toldMs >= 7000 && toldMs <= 7200, `${toldMs}`);
  assert.ok(backMs >= 9900 && backMs <= 10_200, `${backMs}`);
});

test("a gap of less than a second is not told", () => {
  assert.deepEqual(watch(new Health(["a", "b"], 30), 0, 9000, (ms) => (ms > 6000 && ms < 6800 ? named(ms, 0) : named(ms, 0, 1))), []);
});

test("half a rig that never comes is told soon after the start, not while sensors join", () => {
  assert.deepEqual(watch(new Health(["a", "b"], 30), 0, 5000, (ms) => (ms < 2000 ? named(ms, 0) : named(ms, 0, 1))), []);
  const [[atMs, words]] = watch(new Health(["a", "b", "c", "d"], 30), 0, 5000, (ms) => named(ms, 0, 3)) as [[number, string]];
  assert.equal(words, "b and c are missing.");
  assert.ok(atMs >= 2500 && atMs <= 2700, `${atMs}`);
});

test("missing sensors are named, and not those that come back", () => {
  const health = new Health(["cam-0", "cam-1", "cam-2"], 30);
  assert.equal(listen(health, 0, 12, { fps: 30, sensors: [0, 1] }).at(-1), "cam-2 is missing.");
  assert.equal(listen(health, 12, 8, { fps: 30, sensors: [1] }).at(-1), "cam-0 and cam-2 are missing.");
  assert.equal(listen(health, 20, 8, { fps: 30, sensors: [0, 1, 2] }).at(-1), "");
  const many = new Health(Array.from({ length: 9 }, (_, i) => `s${i}`), 30);
  assert.equal(listen(many, 0, 12, { fps: 30, sensors: [0] }).at(-1), "8 of 9 sensors are missing.");
});

test("a sensor whose captures have become old is told within two seconds, though it is named", () => {
  const said = watch(new Health(["a", "b"], 30), 0, 9000, (ms) => [...named(ms, 0), ...named(Math.min(ms, 6000), 1)]);
  assert.deepEqual(said.map(([, words]) => words), ["b is missing."]);
  assert.ok(said[0]![0] >= 7500 && said[0]![0] <= 8000, `${said[0]![0]}`);
});

test("a sensor of one capture a second is there, whether it is named between them or not, and missed when it is gone", () => {
  const everyMs = (ms: number): number => 1000 * Math.floor(ms / 1000) - (Math.floor(ms / 1000) % 3) * 200; // not on the dot
  const kept = (ms: number): Source[] => [...named(ms, 0), ...named(everyMs(ms), 1)];
  const leftOut = (ms: number): Source[] => (ms - everyMs(ms) < 500 ? kept(ms) : named(ms, 0));
  for (const sourcesAt of [kept, leftOut]) {
    const health = new Health(["a", "b"], 30);
    assert.deepEqual(watch(health, 0, 30_000, sourcesAt), []);
    assert.equal(watch(health, 30_000, 6000, (ms) => named(ms, 0)).at(-1)?.[1], "b is missing.");
  }
});

test("a scene of one capture a second misses a sensor as soon as others", () => {
  const health = new Health(["a", "b"], 1);
  const said = watch(health, 0, 20_000, (ms) => (ms > 10_500 ? named(ms, 0) : named(ms, 0, 1)), 1);
  assert.deepEqual(said.map(([, words]) => words), ["b is missing."]);
  assert.ok(said[0]![0] <= 12_100, `${said[0]![0]}`);
});

test("a missing sensor is told beside a slow server", () => {
  assert.match(listen(new Health(["a", "b"], 30), 0, 20, { fps: 6, sensors: [0] }).at(-1)!, /^The server is slower.* b is missing\.$/);
});

test("an answer changes only when it has held for a while", () => {
  const answer = new Hysteresis();
  for (let t = 0; t < 20_000; t += 1000) assert.equal(answer.update(t, t % 2000 === 0 ? "yes" : "no"), false);
  answer.update(20_000, "yes");
  assert.equal(answer.update(23_000, "yes"), true);
  assert.equal(answer.update(24_000, "no"), true);
  assert.equal(answer.update(26_000, "no"), false);
});

test("the resolution falls while frames are slow, rises later, and less eagerly each time", () => {
  const resolution = new Resolution();
  const frames = (ms: number): number => {
    for (let n = 1; n < 10_000; ++n) if (resolution.drew(ms)) return n;
    return Infinity;
  };
  assert.equal(resolution.scale(), 1);
  frames(40);
  const lower = resolution.scale();
  assert.ok(lower < 1);
  const first = frames(10);
  assert.equal(resolution.scale(), 1);
  frames(40);
  assert.ok(frames(10) > first);
  for (let i = 0; i < 10; ++i) frames(40);
  assert.ok(resolution.scale() >= 0.5);
});

test("one long pause is no slow drawing", () => {
  const resolution = new Resolution();
  for (let i = 0; i < 100; ++i) assert.equal(resolution.drew(1000), false);
  assert.equal(resolution.scale(), 1);
});

test("a device draws all its pixels; the processor fewer, fewest while the eye moves", () => {
  const phone = { width: 390, height: 844, devicePixelRatio: 3 };
  assert.equal(pixelRatio(phone, false, "scene", 1), 3);
  assert.equal(pixelRatio(phone, false, "eye", 0.5), 1.5);
  assert.equal(pixelRatio(phone, false, "nothing", 0.5), 3);
  const desk = { width: 1920, height: 1080, devicePixelRatio: 1 };
  assert.ok(pixelRatio(desk, true, "eye", 1) < 0.5);
  assert.ok(pixelRatio(desk, true, "scene", 1) > 0.6, "what stays is drawn once");
  assert.ok(pixelRatio(desk, true, "scene", 1) ** 2 * 1920 * 1080 <= 1_000_001);
  assert.ok(pixelRatio(desk, true, "nothing", 1) > 1);
  assert.ok(pixelRatio(desk, true, "nothing", 1) ** 2 * 1920 * 1080 <= 2_500_001);
});
