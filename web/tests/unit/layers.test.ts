import assert from "node:assert/strict";
import { test } from "node:test";
import { askedLayer, kMoving, kStill, layerOf, ofLayer, texturingViews } from "../../src/layers.ts";
import type { Packet, View } from "../../src/packet.ts";
import { Traffic } from "../../src/statistics.ts";
import type { Vec3 } from "../../src/vec.ts";
import { SharedUniforms } from "../../src/view_material.ts";

interface Layered {
  readonly layer?: number;
  readonly gain?: Vec3;
}

function view(id: number, stream: number, more: Layered = {}): View & Layered {
  const rect = { x: 0, y: 0, width: 64, height: 48 };
  return {
    id, stream, kind: "pinhole", width: 64, height: 48, fx: 50, fy: 50, cx: 32, cy: 24, gutterPx: 2, layout: 0,
    pose: { rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1], translation: [0, 0, 0] }, imageRect: rect, atlasRect: rect, ...more,
  } as View & Layered;
}

/** The numbers in the row of a label. */
function numbers(shared: SharedUniforms, layer: number, id: number): Float32Array {
  return (shared.views[layer]!.value.image.data as Float32Array).subarray(28 * id, 28 * (id + 1));
}

/** Stream and gain of a label. */
function row(shared: SharedUniforms, layer: number, id: number): number[] {
  const [red, green, blue, use] = numbers(shared, layer, id).subarray(16, 20);
  return [Math.floor(use! / 4), red!, green!, blue!];
}

test("a chunk's layer picks the live picture or the plate", () => {
  const views = [view(0, 0), view(0, 1, { layer: kStill, gain: [1.5, 1, 0.5] }), view(2, 0), view(3, 1, { layer: kStill })];
  const streams = (layer: 0 | 1): (number | undefined)[] => [0, 1, 2, 3].map((id) => texturingViews(views, layer).get(id)?.stream);
  assert.deepEqual(streams(kMoving), [0, undefined, 0, 1], "a plate alone does for both");
  assert.deepEqual(streams(kStill), [1, undefined, 0, 1], "and so does a live picture");
  const shared = new SharedUniforms();
  shared.setViews(views, new Map([[0, 0], [1, 1]]));
  assert.deepEqual(row(shared, kMoving, 0), [0, 1, 1, 1]);
  assert.deepEqual(row(shared, kStill, 0), [1, 1.5, 1, 0.5]);
  assert.deepEqual(row(shared, kMoving, 3), [1, 1, 1, 1]);
  assert.deepEqual(row(shared, kStill, 2), [0, 1, 1, 1]);
});

test("a pinhole's row takes a point of the world to its texel", () => {
  const turned = {
    ...view(0, 0), pose: { rotation: [0, 0, 1, 1, 0, 0, 0, 1, 0], translation: [0.5, -0.25, 1] },
    imageRect: { x: 8, y: 4, width: 32, height: 24 }, atlasRect: { x: 100, y: 200, width: 16, height: 12 },
  } as View;
  const shared = new SharedUniforms();
  shared.setViews([turned], new Map([[0, 0]]));
  const rows = numbers(shared, kMoving, 0);
  const point = [2.5, -0.05, 1.1, 1]; // right 0.2, down 0.1, ahead 2 of the camera: pixel 37, 26.5
  const [x, y, depth] = [0, 4, 8].map((at) => point.reduce((sum, value, i) => sum + rows[at + i]! * value, 0));
  assert.ok(Math.abs(depth! - 2) < 1e-5);
  assert.ok(Math.abs(x! / depth! - ((37 + 0.5 - 8) / 2 + 100)) < 1e-4, `${x! / depth!}`);
  assert.ok(Math.abs(y! / depth! - ((26.5 + 0.5 - 4) / 2 + 200)) < 1e-4, `${y! / depth!}`);
});

test("packets without layers are all moving and look the same in both", () => {
  const shared = new SharedUniforms();
  shared.setViews([view(0, 0), view(1, 0)], new Map([[0, 0]]));
  for (const id of [0, 1]) assert.deepEqual(row(shared, kStill, id), row(shared, kMoving, id));
  assert.equal(layerOf({ name: "a chunk" }), kMoving);
});

test("?layers= shows one layer alone", () => {
  const manifest = [{ name: "a" }, { name: "b", layer: 1 }, { name: "c", layer: 0 }, { name: "d", layer: 1 }];
  const meshes = new Map([["a", 1], ["b", 2], ["c", 3]]);
  assert.deepEqual([...ofLayer(meshes, manifest, askedLayer("still")).keys()], ["b"]);
  assert.deepEqual([...ofLayer(meshes, manifest, askedLayer("moving")).keys()], ["a", "c"]);
  for (const words of [null, "all", ""]) assert.equal(ofLayer(meshes, manifest, askedLayer(words)), meshes);
});

test("bits are counted apart: chunks by layer, plates by who shows them", () => {
  const chunk = (bytes: number, layer?: number) => ({ key: { name: "", layer }, payload: new Uint8Array(bytes) });
  const unit = (stream: number, bytes: number) => ({ stream, data: new Uint8Array(bytes) });
  const traffic = new Traffic();
  const packet = {
    views: [view(0, 0, { layer: 0 }), view(0, 1, { layer: 1 })],
    chunks: [chunk(1000), chunk(2000, 0), chunk(400, 1)],
    textures: [unit(0, 500), unit(1, 50)],
    alpha: [{ stream: 0, stepPx: 2, width: 32, height: 24, data: new Uint8Array(100) }],
  } as unknown as Packet;
  traffic.add(0, packet);
  assert.deepEqual([traffic.meshBytes(kMoving, 0), traffic.meshBytes(kStill, 0)], [1500, 200]);
  assert.deepEqual([traffic.textureBytes(kMoving, 0), traffic.textureBytes(kStill, 0)], [300, 25]);
  // Without layers stream 1 is another sensor's live picture.
  const before = new Traffic();
  before.add(0, { ...packet, views: [view(0, 0), view(1, 1)] });
  assert.deepEqual([before.textureBytes(kMoving, 0), before.textureBytes(kStill, 0)], [325, 0]);
});
