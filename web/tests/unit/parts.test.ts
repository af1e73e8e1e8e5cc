import assert from "node:assert/strict";
import { test } from "node:test";
import { clipFromEye, distanceToSeeAll, lookAlong, usualCamera, type Camera } from "../../src/camera.ts";
import { readHello, ServerClock } from "../../src/connection.ts";
import { burntNumber, planeSizes, type Picture } from "../../src/picture.ts";
import { Median, Rate } from "../../src/statistics.ts";
import { add, dot, scale, type Vec3 } from "../../src/vec.ts";
import { codecOf } from "../../src/video.ts";

/** Pixel of a point given in metres from the eye; rows from the top. */
function pixelOf(camera: Camera, p: Vec3): [number, number] {
  const m = clipFromEye(camera);
  const [x, y, , w] = [0, 1, 2, 3].map((row) => m[4 * row]! * p[0] + m[4 * row + 1]! * p[1] + m[4 * row + 2]! * p[2] + m[4 * row + 3]!);
  return [((x! / w! + 1) / 2) * camera.width - 0.5, ((1 - y! / w!) / 2) * camera.height - 0.5];
}

test("a camera projects as a pinhole whose pixel centres lie at integers", () => {
  const pose = lookAlong([0, 0, 0], [1, 2, -0.5], [0, 0, 1]);
  const camera: Camera = { ...pose, width: 640, height: 480, fx: 500, fy: 510, cx: 300, cy: 250 };
  const p = add(add(scale(pose.right, 0.3), scale(pose.down, -0.2)), scale(pose.forward, 2));
  const [u, v] = pixelOf(camera, p);
  assert.ok(Math.abs(u - (300 + 500 * 0.15)) < 1e-9 && Math.abs(v - (250 - 510 * 0.1)) < 1e-9);
});

test("looking along keeps the horizon level, whichever way is up", () => {
  for (const up of [[0, 0, 1], [0, -1, 0], [0.6, 0, 0.8]] as Vec3[]) {
    const pose = lookAlong([1, 2, 3], [0.3, 0.5, -0.2], up);
    assert.ok(Math.abs(dot(pose.right, up)) < 1e-12);
    assert.ok(dot(pose.down, up) < 0);
  }
});

test("the whole box is in the picture from the distance that shows it", () => {
  const [low, high]: [Vec3, Vec3] = [[-3, -2, 0], [3, 2, 2.5]];
  const pose = lookAlong([0, 0, 0], [1, 1, -1], [0, 0, 1]);
  const camera = usualCamera(pose, 390, 700);
  const away = distanceToSeeAll(low, high, pose, camera);
  for (let i = 0; i < 8; ++i) {
    const corner: Vec3 = [i & 1 ? 3 : -3, i & 2 ? 2 : -2, i & 4 ? 1.25 : -1.25];
    const [u, v] = pixelOf(camera, add(corner, scale(pose.forward, away)));
    assert.ok(u > 0 && u < 389 && v > 0 && v < 699, `${u}, ${v}`);
  }
});

test("the server's clock comes from the quickest answers", () => {
  const clock = new ServerClock();
  assert.equal(clock.offsetMs(), null);
  for (let i = 0; i < 10; ++i) {
    const sent = 1000 * i;
    const slow = i % 2 === 0 ? 0 : 300; // on the way back only
    clock.add(sent, sent + 4 + slow, sent + 2 + 5000);
  }
  assert.equal(clock.offsetMs(), 5000);
});

test("a hello is taken only when it is whole", () => {
  const hello = { type: "hello", scene: "demo", up: [0, 0, 2], fps: 30, lattice: { low_corner: [-512, 0, 1], step: 0.5 } };
  assert.deepEqual(readHello(hello), {
    scene: "demo", up: [0, 0, 1], fps: 30, lattice: { lowCorner: [-512, 0, 1], step: 0.5 }, sensors: [], start: null, mostMbps: null,
  });
  const more = readHello({ ...hello, sensors: ["cam-0", "cam-1"], start: { eye: [1, 2, 1.6], look_at: [0, 0, 1] } });
  assert.deepEqual(more?.sensors, ["cam-0", "cam-1"]);
  assert.deepEqual(more?.start, { eye: [1, 2, 1.6], lookAt: [0, 0, 1] });
  for (const bad of [{ up: [0, 0, 0] }, { up: [0, 1] }, { up: null }, { lattice: {} }, { scene: 3 }, { fps: "30" }, { sensors: "cam" },
    { sensors: [3] }, { sensors: ["x".repeat(65)] }, { sensors: Array(257).fill("a") }, { start: null }, { start: { eye: [0, 0, 0] } },
    { start: { eye: [0, 0, 0], look_at: [0, 0, 0] } }, { start: { eye: [0, 0, 1e9], look_at: [0, 0, 0] } }])
    assert.equal(readHello({ ...hello, ...bad }), null);
});

test("the codec comes from the sequence parameters", () => {
  assert.equal(codecOf(new Uint8Array([0, 0, 0, 1, 0x67, 0x4d, 0x40, 0x1f, 0xff])), "avc1.4d401f");
  assert.equal(codecOf(new Uint8Array([0, 0, 0, 1, 0x41, 0x4d, 0x40, 0x1f, 0xff])), null);
  assert.equal(codecOf(new Uint8Array([0, 0, 1])), null);
});

test("a burnt number is read from luma", () => {
  const size = { width: 160, height: 48, format: "nv12" as const };
  const planes = planeSizes(size).map((p) => new Uint8Array(p.width * p.height * p.components).fill(16));
  const number = 0b1010_0101_1100_0001;
  for (let bit = 0; bit < 16; ++bit)
    for (let y = 0; y < 16; ++y)
      planes[0]!.fill((number >> (15 - bit)) & 1 ? 235 : 16,
        ((bit >> 3) * 16 + y) * 160 + (bit & 7) * 16, ((bit >> 3) * 16 + y) * 160 + (bit & 7) * 16 + 16);
  const picture: Picture = { ...size, planes };
  assert.equal(burntNumber(picture), number);
});

test("rates and medians forget", () => {
  const rate = new Rate(2000);
  rate.add(0, 100);
  rate.add(1500, 50);
  assert.equal(rate.perSecond(1500), 75);
  assert.equal(rate.perSecond(3000), 25);
  const median = new Median(3);
  assert.equal(median.value(), null);
  for (const value of [100, 1, 3, 2]) median.add(value);
  assert.equal(median.value(), 2);
});
