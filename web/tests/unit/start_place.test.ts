import assert from "node:assert/strict";
import { test } from "node:test";
import { findStart } from "../../src/start_place.ts";
import { cross, dot, normalized, subtract, type Vec3 } from "../../src/vec.ts";
import { quad, roomSurfaces } from "./support.ts";

const fov = Math.PI / 3;

test("in a room the start is inside it, at eye height, off the walls, and looks inwards", () => {
  const start = findStart(roomSurfaces(6, 5, 3), [0, 0, 1], fov, fov);
  assert.ok(start !== null);
  const [x, y, z] = start.eye;
  assert.ok(Math.abs(z - 1.6) < 0.15, `${z}`);
  assert.ok(Math.abs(x) <= 2.6 && Math.abs(y) <= 2.1, `${x}, ${y}`);
  // From a wall across the middle, not into the wall behind.
  const way = subtract(start.lookAt, start.eye);
  assert.ok(dot(way, subtract([0, 0, z], start.eye)) > 0);
  assert.ok(Math.hypot(x, y) > 1, "from the side most is seen");
});

test("the start does not depend on which way is up", () => {
  const [right, up]: [Vec3, Vec3] = [[1, 0, 0], [0, -1, 0]];
  const back = cross(right, up);
  const turned = roomSurfaces(6, 5, 3).map(({ positions, indices }) => {
    const out = new Float32Array(positions.length);
    for (let i = 0; i < positions.length; i += 3)
      for (let k = 0; k < 3; ++k)
        out[i + k] = right[k]! * positions[i]! - back[k]! * positions[i + 1]! + up[k]! * positions[i + 2]!;
    return { positions: out, indices };
  });
  const start = findStart(turned, up, fov, fov);
  assert.ok(start !== null);
  assert.ok(Math.abs(-start.eye[1] - 1.6) < 0.15, `${start.eye}`);
});

test("with one wall to see the start faces it", () => {
  // A floor, and one wall at y = 2 that faces -y.
  const surfaces = [quad([-3, -3, 0], [6, 0, 0], [0, 5, 0]), quad([-3, 2, 0], [6, 0, 0], [0, 0, 3])];
  const start = findStart(surfaces, [0, 0, 1], fov, fov);
  assert.ok(start !== null);
  assert.ok(normalized(subtract(start.lookAt, start.eye))[1] > 0.7, `${start.lookAt}`);
});

test("nobody starts in furniture or over the void", () => {
  // Cupboards leave only the strip x > 1.
  const cupboard = quad([-3, -2.5, 1.5], [3.5, 0, 0], [0, 5, 0]);
  const start = findStart([...roomSurfaces(6, 5, 3), cupboard], [0, 0, 1], fov, fov);
  assert.ok(start !== null && start.eye[0] > 0.9, `${start?.eye}`);
  assert.equal(findStart([], [0, 0, 1], fov, fov), null);
  // A wall without a floor: nobody can stand.
  assert.equal(findStart([quad([-3, 2, 0], [6, 0, 0], [0, 0, 3])], [0, 0, 1], fov, fov), null);
});
