import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { before, test } from "node:test";
import createDecoder, { type DracoModule } from "draco3d/draco_decoder_nodejs.js";
import { Malformed } from "../../src/bytes.ts";
import { decodeChunk, kUnseen, type ChunkToDecode } from "../../src/draco_chunk.ts";
import { readPacket } from "../../src/packet_reader.ts";
import { makeRandom, readBytes } from "./support.ts";

const lattice = { lowCorner: [-512, -512, -512] as const, step: 2 ** -10 };
const { chunks } = readPacket(readBytes("tests/data/chunks_room.bin"));
const toDecode = (i: number): ChunkToDecode => {
  const { payload, triangles, views } = chunks[i]!;
  return { payload, triangles, views, background: false, lattice };
};

let draco: DracoModule;
before(async () => {
  const wasm = new Uint8Array(readFileSync("node_modules/draco3d/draco_decoder.wasm"));
  draco = await createDecoder({ wasmBinary: wasm.buffer });
});

test("chunks decode to the triangles that the C++ side decodes", () => {
  // By view: triangles, and the sum of x + 3 y + 7 z over the lattice cells of their corners.
  const expected = [
    { 2: [31, 537271700], 3: [7, 121293770], [kUnseen]: [4, 69329072] },
    { 0: [23, 399073937], 3: [10, 173526508] },
    { 1: [33, 573612386] },
  ];
  assert.equal(chunks.length, expected.length);
  expected.forEach((views, i) => {
    const mesh = decodeChunk(draco, toDecode(i));
    const found: Record<number, [number, number]> = {};
    for (let t = 0; t < mesh.indices.length; t += 3) {
      const entry = (found[mesh.views![mesh.indices[t]!]!] ??= [0, 0]);
      entry[0] += 1;
      for (const point of mesh.indices.slice(t, t + 3)) {
        const cell = (axis: number): number => (mesh.positions[3 * point + axis]! + 512) * 1024;
        entry[1] += cell(0) + 3 * cell(1) + 7 * cell(2);
      }
    }
    assert.deepEqual(found, views);
    for (let axis = 0; axis < 3; ++axis) assert.ok(mesh.box.low[axis]! < mesh.box.high[axis]!);
  });
});

test("guesses are the triangles that the C++ side takes them for", () => {
  // tests/codec/packet_codec_test.cpp: the same ranges, the same sums over the corners' lattice cells.
  const expected = [86648919, 86754940, 86915445];
  expected.forEach((sum, i) => {
    const mesh = decodeChunk(draco, { ...toDecode(i), guessed: [3, 4, 11, 1] });
    let found = 0;
    assert.equal(mesh.guessed?.length, 9 * 5);
    mesh.guessed!.forEach((value, k) => (found += (value + 512) * 1024 * [1, 3, 7][k % 3]!));
    assert.equal(found, sum);
  });
  assert.equal(decodeChunk(draco, toDecode(0)).guessed, null);
});

test("a chunk that is not as promised is refused", () => {
  const good = toDecode(0);
  const refused = (change: Partial<ChunkToDecode>): void =>
    assert.throws(() => decodeChunk(draco, { ...good, ...change }), Malformed);
  refused({ triangles: good.triangles + 1 });
  refused({ views: good.views.slice(0, 1) });
  refused({ views: [] });
  refused({ background: true });
  refused({ lattice: { ...lattice, step: 2 ** -9 } });
  refused({ lattice: { ...lattice, lowCorner: [0, 0, 0] } });
  refused({ payload: new Uint8Array(45) });
  refused({ payload: good.payload.subarray(0, 20) });
});

test("a background chunk has colours", () => {
  // Written by draco3d's encoder: two triangles, POSITION on the lattice, COLOR 3 x uint8.
  const payload = readBytes("tests/data/chunk_background.drc");
  const chunk: ChunkToDecode = { payload, triangles: 2, views: [], background: true, lattice };
  const mesh = decodeChunk(draco, chunk);
  assert.equal(mesh.views, null);
  const corners = [...mesh.indices].map((point) => ({
    at: [...mesh.positions.slice(3 * point, 3 * point + 3)],
    color: [...mesh.colors!.slice(3 * point, 3 * point + 3)],
  }));
  assert.equal(corners.length, 6);
  for (const { at, color } of corners) assert.deepEqual(color, [at[0]! * 100, at[1]! * 100, 7]);
  assert.throws(() => decodeChunk(draco, { ...chunk, background: false }), Malformed);
});

test("damaged streams do not get past Draco and our checks", async () => {
  const random = makeRandom(2);
  for (let round = 0; round < 2000; ++round) {
    const chunk = toDecode(round % chunks.length);
    const payload = chunk.payload.slice();
    for (let edits = 1 + random(3); edits > 0; --edits) payload[random(payload.length)] = random(256);
    try {
      const mesh = decodeChunk(draco, { ...chunk, payload });
      assert.equal(mesh.indices.length, 3 * chunk.triangles);
      assert.ok(mesh.positions.every(Number.isFinite));
    } catch (error) {
      if (error instanceof Malformed) continue;
      assert.ok(!(error instanceof assert.AssertionError), String(error));
      draco = await createDecoder({ wasmBinary: readFileSync("node_modules/draco3d/draco_decoder.wasm").buffer as ArrayBuffer });
    }
  }
});
