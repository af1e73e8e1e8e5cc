import assert from "node:assert/strict";
import { test } from "node:test";
import { alphaFor, decodeAlpha } from "../../src/alpha.ts";
import { Malformed } from "../../src/bytes.ts";
import { makeRandom, readBytes } from "./support.ts";

interface Golden {
  readonly width: number;
  readonly height: number;
  readonly coded: Uint8Array;
  readonly pixels: Uint8Array;
}

/** Planes that tests/codec/alpha_codec_test.cpp wrote, and what it decodes of any bytes: width, height, number of coded bytes, these, and the
 *  pixels, eight a byte, the first in the lowest bit. */
function goldenPlanes(): Golden[] {
  const bytes = readBytes("tests/data/alpha_planes.bin");
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const out: Golden[] = [];
  for (let at = 0; at < bytes.length;) {
    const [width, height, size] = [0, 4, 8].map((n) => view.getUint32(at + n, true)) as [number, number, number];
    const coded = bytes.subarray(at + 12, at + 12 + size);
    const bits = at + 12 + size;
    const pixels = Uint8Array.from({ length: width * height }, (_, i) => ((bytes[bits + (i >> 3)]! >> (i & 7)) & 1) * 255);
    out.push({ width, height, coded, pixels });
    at = bits + Math.ceil(pixels.length / 8);
  }
  return out;
}

test("planes decode to the pixels that the C++ side codes", () => {
  const planes = goldenPlanes();
  const sizes = new Set(planes.map(({ width, height }) => `${width}x${height}`));
  for (const size of ["1x1", "7x9", "8x8", "17x5", "64x48", "70x50", "320x180", "60x44"]) assert.ok(sizes.has(size), size);
  for (const [i, { width, height, coded, pixels }] of planes.entries())
    assert.deepEqual(decodeAlpha(coded, width, height), pixels, `plane ${i}, ${width}x${height}`);
  const kinds = planes.filter(({ width }) => width === 70).map(({ pixels }) => pixels.filter((value) => value === 255).length);
  assert.deepEqual(kinds.slice(0, 2), [0, 3500]);
  assert.ok(kinds[2]! > 1000 && kinds[2]! < 1500, "a disc");
});

test("truncated and other bytes are planes, or more than there is use for", () => {
  const random = makeRandom(4);
  const golden = goldenPlanes();
  let [refused, decoded] = [0, 0];
  for (let round = 0; round < 4000; ++round) {
    const { width, height, coded } = golden[random(golden.length)]!;
    const bytes = random(2) === 0 ? coded.slice() : Uint8Array.from({ length: random(400) }, () => random(256));
    for (let edits = random(4); edits > 0 && bytes.length > 0; --edits) bytes[random(bytes.length)] = random(256);
    const cut = bytes.subarray(0, random(3) === 0 ? random(bytes.length + 1) : bytes.length);
    try {
      const pixels = decodeAlpha(cut, width, height);
      assert.equal(pixels.length, width * height);
      assert.ok(pixels.every((value) => value === 0 || value === 255));
      ++decoded;
    } catch (error) {
      assert.ok(error instanceof Malformed, `round ${round}: ${String(error)}`);
      ++refused;
    }
  }
  assert.ok(refused > 300 && decoded > 1000, `${refused} refused, ${decoded} decoded`);
});

test("no bytes are a plane, as zeros are, and more than it has use for are refused", () => {
  assert.deepEqual(decodeAlpha(new Uint8Array(0), 70, 50), decodeAlpha(new Uint8Array(4), 70, 50));
  assert.throws(() => decodeAlpha(new Uint8Array(1000), 8, 8), /^Error: alpha plane: more bytes than it has use for$/);
  for (const { width, height, coded } of goldenPlanes()) {
    // Whatever the bytes are, a pixel takes less than one.
    const longer = new Uint8Array(coded.length + 2 * width * height + 8).fill(1);
    longer.set(coded);
    assert.throws(() => decodeAlpha(longer, width, height), Malformed, `${width}x${height}`);
  }
});

test("a plane is of its picture's size, in steps", () => {
  const plane = (width: number, height: number, stepPx: number) => ({ stream: 0, stepPx, width, height, data: new Uint8Array(1) });
  const picture = { width: 66, height: 40 };
  for (const [stepPx, width, height] of [[1, 66, 40], [2, 33, 20], [4, 17, 10], [16, 5, 3]] as const) {
    assert.equal(alphaFor(plane(width, height, stepPx), picture).pixels.length, width * height);
    for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]] as const)
      assert.throws(() => alphaFor(plane(width + dx, height + dy, stepPx), picture), Malformed);
  }
});
