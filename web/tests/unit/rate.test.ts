import assert from "node:assert/strict";
import { test } from "node:test";
import { readHello } from "../../src/connection.ts";
import { mbpsAt } from "../../src/rate_slider.ts";
import { Traffic } from "../../src/statistics.ts";

const kHello = { type: "hello", scene: "demo", up: [0, 0, 1], fps: 30, lattice: { low_corner: [0, 0, 0], step: 0.5 } };

test("a hello tells the most that a scene sends, where its rate is controlled", () => {
  assert.equal(readHello(kHello)?.mostMbps, null);
  assert.equal(readHello({ ...kHello, rate: { target_mbps: 20 } })?.mostMbps, 20);
  for (const rate of [null, 20, {}, { target_mbps: 0 }, { target_mbps: -1 }, { target_mbps: "20" }, { target_mbps: Infinity }])
    assert.equal(readHello({ ...kHello, rate }), null, JSON.stringify(rate));
});

test("even steps of the slider are even factors, from the least to the most", () => {
  assert.equal(mbpsAt(0, 20), 0.5);
  assert.equal(mbpsAt(1, 20), 20);
  assert.ok(Math.abs(mbpsAt(0.5, 20) ** 2 / (0.5 * 20) - 1) < 1e-12);
  assert.ok(mbpsAt(0, 1) < 0.5, "a scene that sends little can be asked for less");
  for (let place = 0; place < 1; place += 0.1) assert.ok(mbpsAt(place + 0.1, 7) > mbpsAt(place, 7));
});

test("traffic counts whole messages, over the last two seconds", () => {
  const traffic = new Traffic();
  for (let ms = 0; ms < 3000; ms += 100) traffic.addMessage(ms, 1000);
  assert.ok(Math.abs(traffic.bytes(2900) - 10_000) < 600);
  assert.equal(traffic.bytes(10_000), 0);
});
