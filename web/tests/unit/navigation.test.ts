import assert from "node:assert/strict";
import { test } from "node:test";
import { rayThrough, usualCamera } from "../../src/camera.ts";
import { kNearestM, kWalkMarginM, Navigation } from "../../src/navigation.ts";
import { pick } from "../../src/pick.ts";
import { dot, length, subtract, type Vec3 } from "../../src/vec.ts";
import { quad } from "./support.ts";

const box = { low: [-3, -2.5, 0] as Vec3, high: [3, 2.5, 3] as Vec3 };

function standing(): Navigation {
  const navigation = new Navigation();
  navigation.setUp([0, 0, 1]);
  navigation.setBox(box);
  navigation.stand({ eye: [2, -1, 1.6], lookAt: [-1, 1, 1] });
  return navigation;
}

/** Pixel of a point. */
function seen(navigation: Navigation, point: Vec3): [number, number] {
  const c = navigation.camera(640, 480);
  const p = subtract(point, c.position);
  const z = dot(p, c.forward);
  return [c.cx + (c.fx * dot(p, c.right)) / z, c.cy + (c.fy * dot(p, c.down)) / z];
}

function near(a: readonly number[], b: readonly number[], tolerance = 1e-6): void {
  assert.ok(a.every((v, i) => Math.abs(v - b[i]!) < tolerance), `${a} is not ${b}`);
}

test("who stands looks where the start says", () => {
  const { position, forward } = standing().pose();
  near(position, [2, -1, 1.6]);
  const way = subtract([-1, 1, 1], position);
  near(forward, way.map((v) => v / length(way)));
});

test("what is orbited around stays where it is in the picture, and as far away", () => {
  const navigation = standing();
  const pivot: Vec3 = [-0.5, 1.2, 0.4];
  const before = seen(navigation, pivot);
  const away = length(subtract(navigation.pose().position, pivot));
  for (let i = 0; i < 5; ++i) navigation.orbit(pivot, 0.1, 0.02);
  near(seen(navigation, pivot), before, 1e-6);
  assert.ok(Math.abs(length(subtract(navigation.pose().position, pivot)) - away) < 1e-9);
});

test("zooming goes towards the point, keeps it in its place and stops before it", () => {
  const navigation = standing();
  const point: Vec3 = [-0.5, 1.2, 0.4];
  const before = seen(navigation, point);
  navigation.zoom(point, 0.5);
  near(seen(navigation, point), before, 1e-6);
  for (let i = 0; i < 100; ++i) navigation.zoom(point, 0.8);
  assert.ok(Math.abs(length(subtract(navigation.pose().position, point)) - kNearestM) < 1e-9);
});

test("zooming out and panning end a few sizes of the scene away", () => {
  for (const move of [(n: Navigation) => n.zoom([0, 0, 1], 1.5), (n: Navigation) => n.pan(5000, 3000, 400)]) {
    const navigation = standing();
    for (let i = 0; i < 200; ++i) move(navigation);
    const away = length(subtract(navigation.pose().position, [0, 0, 1.5]));
    assert.ok(away > 8 && away < 4 * length(subtract(box.high, box.low)), `${away}`);
  }
});

test("walking ends some metres outside the scene", () => {
  const navigation = standing();
  for (let i = 0; i < 1000; ++i) navigation.walk(0.5, 1, 0.2);
  navigation.pose().position.forEach((v, i) => {
    assert.ok(v >= box.low[i]! - kWalkMarginM && v <= box.high[i]! + kWalkMarginM);
  });
  assert.equal(navigation.isInside(), false);
  navigation.setDown();
  assert.equal(navigation.isInside(), true);
});

test("the way back is exact", () => {
  const navigation = standing();
  const before = navigation.pose();
  navigation.orbit([0, 0, 0], 1, 0.3);
  navigation.walk(3, 2, 1);
  navigation.stand({ eye: [2, -1, 1.6], lookAt: [-1, 1, 1] });
  near([...navigation.pose().position, ...navigation.pose().forward], [...before.position, ...before.forward]);
});

test("what is under the pointer is the nearest front", () => {
  const facing = quad([-1, 2, -1], [2, 0, 0], [0, 0, 2]); // its front looks to -y
  const behind = quad([-1, 3, -1], [2, 0, 0], [0, 0, 2]);
  const away = quad([-1, 1, -1], [0, 0, 2], [2, 0, 0]); // seen from its back
  const surfaces = [behind, facing, away].map((surface) => ({ ...surface, box: { low: [-1, 0, -1], high: [1, 4, 1] } as const }));
  near(pick(surfaces, [0.3, 0, 0.2], [0, 1, 0])!, [0.3, 2, 0.2]);
  assert.equal(pick(surfaces, [0.3, 0, 0.2], [0, -1, 0]), null);
  assert.equal(pick(surfaces, [5, 0, 0.2], [0, 1, 0]), null);
});

test("a ray goes through its pixel", () => {
  const navigation = standing();
  const camera = usualCamera(navigation.pose(), 640, 480);
  const ray = rayThrough(camera, 100, 333);
  near(seen(navigation, [0, 1, 2].map((i) => camera.position[i]! + 3 * ray[i]!) as unknown as Vec3), [100, 333]);
});
