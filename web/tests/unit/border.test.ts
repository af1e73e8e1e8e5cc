import assert from "node:assert/strict";
import { test } from "node:test";
import { borderDistances, fadingTriangles, findBorders, kFadeM, withRim, type RimmedMesh } from "../../src/border.ts";

const kStepM = 0.0625;

/** A level patch of n x n squares of `step`, its corner at (x, 0, 0). `view`: of a square's column. */
function patch(x: number, n: number, step = kStepM, view = (_column: number) => 0): RimmedMesh {
  const positions: number[] = [];
  const views: number[] = [];
  const indices: number[] = [];
  for (let i = 0; i < n; ++i)
    for (let j = 0; j < n; ++j) {
      const first = positions.length / 3;
      for (const [a, b] of [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]] as const) {
        positions.push(x + a * step, b * step, 0);
        views.push(view(i));
      }
      indices.push(first, first + 1, first + 2, first, first + 2, first + 3);
    }
  return withRim({
    box: { low: [x, 0, 0], high: [x + n * step, n * step, 0] }, viewIds: [0, 1],
    positions: new Float32Array(positions), indices: new Uint16Array(indices), views: new Uint16Array(views), colors: null,
    guessed: null,
  });
}

function bordersOf(meshes: readonly RimmedMesh[]): number[][] {
  return findBorders(meshes.map((mesh) => mesh.rim!), 1.5);
}

/** Distance at the vertex nearest to (x, y). */
function distanceAt(mesh: RimmedMesh, distances: Float32Array, x: number, y: number): number {
  const p = mesh.positions;
  for (let i = 0; i < distances.length; ++i)
    if (Math.hypot(p[3 * i]! - x, p[3 * i + 1]! - y) < 1e-6) return distances[i]!;
  throw new Error("no vertex there");
}

test("a patch alone has its outline as border; where labels meet there is none", () => {
  const mesh = patch(0, 8, kStepM, (column) => (column < 4 ? 0 : 1));
  const [borders] = bordersOf([mesh]);
  assert.equal(borders!.length, 4 * 8);
  const distances = borderDistances(mesh.rim!, borders!);
  assert.equal(distanceAt(mesh, distances, 0, 3 * kStepM), 0);
  assert.ok(distanceAt(mesh, distances, 4 * kStepM, 4 * kStepM) > kFadeM, "where two views meet");
  assert.ok(Math.abs(distanceAt(mesh, distances, kStepM, 4 * kStepM) - kStepM) < 1e-6);
  const fading = fadingTriangles(mesh, mesh.rim!, distances);
  assert.ok(fading.length > 0 && fading.length < mesh.indices.length / 3);
});

test("where two chunks meet no border is, until one of them goes", () => {
  const [left, right] = [patch(0, 8), patch(8 * kStepM, 8)];
  const [ofLeft, ofRight] = bordersOf([left, right]);
  assert.equal(ofLeft!.length, 3 * 8);
  assert.equal(ofRight!.length, 3 * 8);
  const distances = borderDistances(left.rim!, ofLeft!);
  assert.ok(distanceAt(left, distances, 8 * kStepM, 4 * kStepM) > kFadeM);
  assert.equal(bordersOf([left])[0]!.length, 4 * 8);
});

test("large triangles from border to border are cut and do not fade as a whole", () => {
  const mesh = patch(0, 1, 1); // one square metre, two triangles
  assert.equal(mesh.rim!.triangles, 2);
  assert.equal(mesh.indices.length / 3, 4);
  const [borders] = bordersOf([mesh]);
  const distances = borderDistances(mesh.rim!, borders!);
  assert.ok(distanceAt(mesh, distances, 0.5, 0.5) > 0.4);
  let area = 0;
  for (let i = 0; i < mesh.indices.length; i += 3) {
    const [a, b, c] = [0, 1, 2].map((k) => 3 * mesh.indices[i + k]!) as [number, number, number];
    const p = mesh.positions;
    const twice = (p[b]! - p[a]!) * (p[c + 1]! - p[a + 1]!) - (p[b + 1]! - p[a + 1]!) * (p[c]! - p[a]!);
    assert.ok(twice > 0, "the front stays the front");
    area += twice / 2;
  }
  assert.ok(Math.abs(area - 1) < 1e-6);
});

test("triangles cut at one, two or three edges keep their area and their front", () => {
  for (let n = 1; n < 4; ++n) {
    const mesh = patch(0, n, 0.5);
    let area = 0;
    const p = mesh.positions;
    for (let i = 0; i < mesh.indices.length; i += 3) {
      const [a, b, c] = [0, 1, 2].map((k) => 3 * mesh.indices[i + k]!) as [number, number, number];
      const twice = (p[b]! - p[a]!) * (p[c + 1]! - p[a + 1]!) - (p[b + 1]! - p[a + 1]!) * (p[c]! - p[a]!);
      assert.ok(twice > 0);
      area += twice / 2;
    }
    assert.ok(Math.abs(area - (n * 0.5) ** 2) < 1e-6);
  }
});

test("the borders of small pieces and holes do not fade", () => {
  const [small, large] = [patch(0, 4), patch(100, 8)]; // 1 m and 2 m of border
  assert.deepEqual(bordersOf([small, large]).map((borders) => borders.length), [0, 4 * 8]);
  // Two small pieces that touch are one.
  const [left, right] = [patch(0, 4), patch(4 * kStepM, 4)];
  assert.deepEqual(bordersOf([left, right]).map((borders) => borders.length), [3 * 4, 3 * 4]);
});

test("a room's border fades, a chair's does not", () => {
  const [chair, room] = [patch(0, 40), patch(100, 80)]; // 10 m and 20 m of border
  assert.deepEqual(findBorders([chair.rim!, room.rim!]).map((borders) => borders.length), [0, 4 * 80]);
});

test("a background has no rim", () => {
  const { rim, ...mesh } = patch(0, 2);
  assert.notEqual(rim, null);
  assert.equal(withRim({ ...mesh, views: null, colors: new Uint8Array(mesh.positions.length) }).rim, null);
});
