import assert from "node:assert/strict";
import { test } from "node:test";
import { PacketOrder, type Place } from "../../src/packet_order.ts";

/** Packets of one epoch, 33 ms apart. */
function places(order: PacketOrder, sequences: readonly (number | bigint)[], fromMs = 0, epoch = 1): Place[] {
  return sequences.map((sequence, i) => order.place(fromMs + 33 * i, epoch, BigInt(sequence)));
}

test("packets in order are accepted, gaps up to 4096 too", () => {
  assert.deepEqual(places(new PacketOrder(), [7, 8, 20, 20 + 4096]), ["afresh", "next", "next", "next"]);
});

test("a packet that was there is stale, one far ahead jumps, and neither changes what is next", () => {
  const order = new PacketOrder();
  places(order, [7, 8]);
  assert.deepEqual(places(order, [8, 7, 0, 8 + 4097, 2n ** 64n - 1n], 66), ["stale", "stale", "stale", "jumps", "jumps"]);
  assert.deepEqual(places(order, [9], 300), ["next"]);
});

test("a newer epoch starts afresh, an older one is stale, around the largest number, too", () => {
  const order = new PacketOrder();
  assert.equal(order.place(0, 0xfffffffe, 100n), "afresh");
  assert.equal(order.place(1, 0xfffffffd, 101n), "stale");
  assert.equal(order.place(2, 0xffffffff, 3n), "afresh");
  assert.equal(order.place(3, 0, 0n), "afresh", "the epoch after the largest");
  assert.equal(order.place(4, 0xffffffff, 4n), "stale");
  assert.equal(order.place(5, 2 ** 31, 1n), "stale", "as far behind as ahead");
  assert.equal(order.place(6, 0, 1n), "next");
});

test("one packet with an absurd number stops the stream for a second, no longer", () => {
  const order = new PacketOrder();
  places(order, [1, 2]);
  assert.equal(order.place(100, 1, 4000n), "next");
  const found = places(order, Array.from({ length: 40 }, (_, i) => i + 3), 133);
  const again = found.indexOf("afresh");
  assert.equal(133 + 33 * again, 1123);
  assert.ok(found.slice(0, again).every((place) => place === "stale"));
  assert.ok(found.slice(again + 1).every((place) => place === "next"));
});

test("an absurd epoch stops it no longer either", () => {
  const order = new PacketOrder();
  places(order, [1, 2]);
  assert.equal(order.place(66, 0x7fffffff, 1n), "afresh");
  assert.deepEqual(places(order, [3, 4], 500), ["stale", "stale"]);
  assert.deepEqual(places(order, [5, 6], 1066), ["afresh", "next"]);
});

test("a pause is no reason to take what is out of order", () => {
  const order = new PacketOrder();
  places(order, [50]);
  assert.deepEqual(places(order, [50], 5000), ["stale"]);
  assert.deepEqual(places(order, [51], 9000), ["next"], "one refusal is not enough");
  assert.deepEqual(places(order, [3, 4], 9100), ["stale", "stale"]);
  assert.deepEqual(places(order, [52], 9999), ["next"], "not a second");
  assert.deepEqual(places(order, [5], 20_000), ["stale"], "those before do not count");
});

test("a sequence that a number cannot hold is never the newest, not even when all else is refused", () => {
  const order = new PacketOrder();
  assert.deepEqual(places(order, [2n ** 53n, 2n ** 64n - 1n]), ["jumps", "jumps"]);
  assert.deepEqual(places(order, [2n ** 64n - 1n], 5000), ["jumps"]);
  assert.deepEqual(places(order, [7, 8], 5033), ["afresh", "next"]);
});

test("after a hello any packet is the first", () => {
  const order = new PacketOrder();
  places(order, [500], 0, 9);
  order.startAfresh();
  assert.deepEqual(places(order, [2, 3], 10, 4), ["afresh", "next"]);
});
