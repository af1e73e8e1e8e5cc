import assert from "node:assert/strict";
import { test } from "node:test";
import { crc32, withoutChecksum, writeChecksum } from "../../src/crc32.ts";
import { makeRandom } from "./support.ts";

/** Bit by bit, as the standard has it. */
function slowly(bytes: Uint8Array): number {
  let crc = 0xffffffff;
  for (const byte of bytes) {
    crc ^= byte;
    for (let bit = 0; bit < 8; ++bit) crc = (crc >>> 1) ^ ((crc & 1) === 0 ? 0 : 0xedb88320);
  }
  return ~crc >>> 0;
}

test("the check value of CRC-32", () => {
  assert.equal(crc32(new TextEncoder().encode("123456789")), 0xcbf43926);
  assert.equal(crc32(new Uint8Array(0)), 0);
});

test("any length at any place gives what the definition gives", () => {
  const random = makeRandom(3);
  const bytes = Uint8Array.from({ length: 300 }, () => random(256));
  for (let start = 0; start < 9; ++start)
    for (let end = start; end < bytes.length; end += 1 + random(5))
      assert.equal(crc32(bytes.subarray(start, end)), slowly(bytes.subarray(start, end)), `${start} to ${end}`);
});

test("what was written with its checksum is taken off it, and nothing else is", () => {
  const bytes = Uint8Array.from([0, 1, 2, 3, 250, 0, 0, 0, 0, 99]).subarray(1, 9);
  writeChecksum(bytes);
  assert.deepEqual(withoutChecksum(bytes), Uint8Array.from([1, 2, 3, 250]));
  assert.equal(withoutChecksum(bytes.subarray(0, 7)), null);
  assert.equal(withoutChecksum(bytes.subarray(0, 3)), null);
  assert.deepEqual(withoutChecksum(new Uint8Array(4)), new Uint8Array(0), "the checksum of nothing is 0");
});
