import assert from "node:assert/strict";
import { test } from "node:test";
import { decodeAlpha } from "../../src/alpha.ts";
import { Malformed } from "../../src/bytes.ts";
import { kChecksumBytes, writeChecksum } from "../../src/crc32.ts";
import type { Packet } from "../../src/packet.ts";
import { HeadReader, numbersOf, openMessage, readChunksAnswer, readPacket } from "../../src/packet_reader.ts";
import { writeControl } from "../../src/control.ts";
import { makeRandom, readBytes } from "./support.ts";

const kGolden = "../tests/data/packet_v4.bin";
const kGoldenSequence = "../tests/data/packets_v4.bin";
const kRoom = "tests/data/chunks_room.bin";
const kAlpha = "tests/data/packets_alpha.bin"; // tests/codec/alpha_packet_test.cpp

/** What a node sends one after another; each packet after its length. */
function goldenSequence(file = kGoldenSequence): Uint8Array[] {
  const bytes = readBytes(file);
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const out: Uint8Array[] = [];
  for (let at = 0; at < bytes.length; at += 4 + view.getUint32(at, true))
    out.push(bytes.subarray(at + 4, at + 4 + view.getUint32(at, true)));
  return out;
}

test("the golden packet of the C++ side reads", () => {
  const packet = readPacket(readBytes(kGolden));
  assert.equal(packet.scene, "living room");
  assert.equal(packet.node, "merge/root");
  assert.equal(packet.epoch, 2);
  assert.equal(packet.sequence, 1_234_567_890_123);
  assert.equal(packet.coalesced, 0);
  assert.deepEqual(packet.alpha, []);
  assert.equal(packet.capturedAtNs, 1_700_000_000_123_456_789n);
  assert.deepEqual(packet.sources.map((source) => source.sensor), [0, 2, 5]);
  assert.equal(packet.sources[1]!.capturedAtNs, 1_700_000_000_000_000_002n);
  const plan = { simplifyRatio: 0.5, meshSpeed: 7, textureScale: 0.75, textureQp: 33, simplifyErrorM: 0 };
  assert.deepEqual(packet.plan, plan);
  assert.deepEqual(packet.manifest.map((key) => key.name), [
    "-1,2,3,4294967295,0,0,7", "0,0,0,1,0,0,8", "0,0,0,1,0,2,1", "0,0,0,1,1,0,1",
  ]);
  assert.deepEqual(packet.manifest.map((key) => key.layer), [0, 0, 0, 1]);
  const [chunk] = packet.chunks;
  assert.equal(packet.chunks.length, 1);
  assert.equal(chunk!.key.name, "0,0,0,1,0,2,1");
  assert.equal(chunk!.triangles, 12);
  assert.deepEqual([...chunk!.payload], Array.from({ length: 45 }, (_, i) => (i * 37) & 255));
  assert.deepEqual(packet.textures.map(({ data, ...rest }) => ({ ...rest, bytes: data.length })), [
    { stream: 0, serial: 70_000, layout: 3, width: 640, height: 400, keyFrame: true, bytes: 77 },
    { stream: 1, serial: 2, layout: 4, width: 8192, height: 8192, keyFrame: false, bytes: 5 },
  ]);
  assert.deepEqual([...packet.streams], [[0, 70_000], [1, 2], [9, 5], [10, 1]]);
  assert.deepEqual(packet.marks, [
    { stage: "cam0/fuse", atNs: 5n },
    { stage: "cam0/encode_mesh", atNs: 6n },
  ]);
  const pose = { rotation: [0, 0, 1, 1, 0, 0, 0, 1, 0], translation: [1, 2, 3] };
  assert.deepEqual(packet.views[1], {
    id: 5, kind: "equirectangular", width: 1280, height: 720, fx: 600, fy: 601, cx: 640, cy: 360.5, pose,
    imageRect: { x: 10, y: 20, width: 1200, height: 700 },
    atlasRect: { x: 16, y: 32, width: 600, height: 350 },
    gutterPx: 2.5, stream: 9, layout: 3, layer: 0, gain: [1, 1, 1],
  });
  const { stream, layer, gain } = packet.views[2]!;
  assert.deepEqual({ stream, layer, gain }, { stream: 10, layer: 1, gain: [0.5, 1.25, 2] });
});

test("packets that build on another are put together", () => {
  const reader = new HeadReader();
  const packets = goldenSequence().map((bytes) => reader.read(openMessage(bytes))!);
  assert.deepEqual(packets.map((packet) => packet.sequence), [1, 2, 3, 4, 5]);
  const ms = 1_000_000n;
  for (const [i, packet] of packets.slice(0, 4).entries()) {
    assert.equal(packet.scene, "living room");
    assert.equal(packet.capturedAtNs, 33n * ms * BigInt(i + 1));
    assert.deepEqual(packet.sources.map((source) => packet.capturedAtNs - source.capturedAtNs), [2n * ms, 4n * ms]);
    assert.deepEqual(packet.marks[3], { stage: "root/merged", atNs: packet.capturedAtNs + 64n * ms });
    assert.deepEqual(packet.manifest, packets[0]!.manifest);
    assert.deepEqual([...packet.streams], [[0, 1]]);
  }
  const last = packets[4]!;
  assert.deepEqual(last.manifest.map((key) => key.name), [
    "0,0,0,4294967295,0,0,1", "1,0,0,4294967295,1,2,9", "2,0,0,4294967295,0,0,1",
  ]);
  assert.deepEqual(last.chunks.map((chunk) => chunk.key.name), ["1,0,0,4294967295,1,2,9"]);
  assert.deepEqual(last.views.map(({ id, layer, gain, stream }) => ({ id, layer, gain, stream })), [
    { id: 0, layer: 0, gain: [1, 1, 1], stream: 0 },
    { id: 1, layer: 0, gain: [1, 1, 1], stream: 0 },
    { id: 1, layer: 1, gain: [0.5, 1, 2], stream: 1 },
  ]);
  assert.deepEqual([...last.streams], [[0, 2], [1, 0]]);
  assert.equal(last.plan.textureQp, 31);
  assert.equal(last.marks.length, 3);
});

test("a packet whose base did not come is asked for", () => {
  const packets = goldenSequence();
  const read = (i: number): Packet | null => reader.read(openMessage(packets[i]!));
  const reader = new HeadReader();
  assert.equal(read(3), null);
  assert.ok(reader.lacksBase());
  assert.throws(() => readPacket(packets[3]!), Malformed);
  assert.equal(read(2)!.sequence, 3, "it brings the base again");
  assert.ok(!reader.lacksBase());
  assert.equal(read(4)!.manifest.length, 3);
});

test("a base older than the last one is taken: what comes in order is not told by bases", () => {
  const reader = new HeadReader();
  assert.equal(reader.read(openMessage(renumbered(readBytes(kGolden), 2_000_000n)))!.sequence, 2_000_000);
  assert.equal(reader.read(openMessage(renumbered(readBytes(kGolden), 5n)))!.sequence, 5);
});

test("a packet's numbers are exact up to the largest", () => {
  const largest = 2n ** 64n - 1n;
  const message = openMessage(renumbered(readBytes(kGolden), largest));
  assert.deepEqual(numbersOf(message), { epoch: 2, sequence: largest });
  assert.throws(() => new HeadReader().read(message), Malformed);
});

test("a packet with any bit that is another is refused", () => {
  const bytes = readBytes(kGolden);
  for (let at = 0; at < bytes.length; ++at)
    for (let bit = 0; bit < 8; ++bit) {
      bytes[at]! ^= 1 << bit;
      assert.throws(() => openMessage(bytes), Malformed, `bit ${bit} of byte ${at}`);
      bytes[at]! ^= 1 << bit;
    }
  openMessage(bytes);
});

/** Where a field of a table lies. */
function fieldAt(view: DataView, table: number, field: number): number {
  return table + view.getUint16(table - view.getInt32(table, true) + 4 + 2 * field, true);
}

/** The same packet under another sequence number. */
function renumbered(bytes: Uint8Array, sequence: bigint): Uint8Array {
  const view = new DataView(bytes.buffer, bytes.byteOffset);
  view.setBigUint64(fieldAt(view, view.getUint32(0, true), 1), sequence, true);
  writeChecksum(bytes);
  return bytes;
}

test("10,000 corrupted sequences give values within the caps or Malformed", () => {
  const random = makeRandom(5);
  let refused = 0;
  let read = 0;
  for (let round = 0; round < 10_000; ++round) {
    const reader = new HeadReader();
    for (const good of goldenSequence().slice(2)) {
      const bytes = good.slice();
      for (let edits = random(3); edits > 0; --edits) bytes[random(bytes.length)] = random(256);
      writeChecksum(bytes);
      try {
        const packet = reader.read(openMessage(bytes));
        if (packet !== null) requireCaps(packet, bytes.length), ++read;
      } catch (error) {
        assert.ok(error instanceof Malformed, `round ${round}: ${String(error)}`);
        ++refused;
      }
    }
  }
  assert.ok(refused > 1000 && read > 10_000, `${refused} refused, ${read} read`);
});

/** The planes of a packet of two, after one was changed: a field of the table, and how it is written. */
function readChangedAlpha(plane: number, field: number, write: (view: DataView, at: number) => void): Packet {
  const bytes = goldenSequence(kAlpha)[0]!.slice();
  const view = new DataView(bytes.buffer);
  const list = follow(view, fieldAt(view, view.getUint32(0, true), 13));
  write(view, fieldAt(view, follow(view, list + 4 + 4 * plane), field));
  writeChecksum(bytes);
  return readPacket(bytes);
}
const u16 = (value: number) => (view: DataView, at: number): void => view.setUint16(at, value, true);
const u8 = (value: number) => (view: DataView, at: number): void => view.setUint8(at, value);
const u32 = (value: number) => (view: DataView, at: number): void => view.setUint32(at, value, true);

function follow(view: DataView, at: number): number {
  return at + view.getUint32(at, true);
}

test("alpha planes are read", () => {
  const packets = goldenSequence(kAlpha).map(readPacket);
  assert.deepEqual(packets.map(({ alpha }) => alpha.map(({ stream, stepPx, width, height }) => [stream, stepPx, width, height])), [
    [[0, 2, 32, 24], [1, 2, 32, 24]], [], [[0, 2, 31, 24], [1, 2, 32, 24]], [[0, 2, 32, 24], [1, 2, 32, 24]], [[0, 4, 16, 12]],
    [[0, 4, 16, 12]],
  ]);
  const disc = decodeAlpha(packets[0]!.alpha[0]!.data, 32, 24);
  assert.deepEqual([disc[0], disc[12 * 32 + 4], disc[12 * 32 + 16], disc[12 * 32 + 8]], [0, 0, 255, 255]);
  assert.deepEqual([...packets[0]!.alpha[1]!.data], [0]);
});

test("impossible alpha planes are refused", () => {
  const refused = (words: RegExp, ...change: Parameters<typeof readChangedAlpha>): void =>
    assert.throws(() => readChangedAlpha(...change), (error) => error instanceof Malformed && words.test(error.message));
  assert.equal(readChangedAlpha(1, 1, u8(16)).alpha[1]!.stepPx, 16);
  for (const step of [0, 17, 255]) refused(/^an impossible alpha plane$/, 1, 1, u8(step));
  for (const field of [2, 3]) refused(/^an impossible alpha plane$/, 1, field, u16(0));
  assert.equal(readChangedAlpha(1, 0, u32(9)).alpha[1]!.stream, 9);
  refused(/^unsorted alpha planes$/, 1, 0, u32(0)); // that of the first one
  for (const field of [2, 3]) refused(/^too large an alpha plane$/, 1, field, u16(8193));
  assert.equal(readChangedAlpha(1, 2, u16(8192)).alpha[1]!.width, 8192);
  refused(/payload is empty/, 1, 4, (view, at) => view.setUint32(follow(view, at), 0, true));
  refused(/cut off/, 1, 4, (view, at) => view.setUint32(follow(view, at), view.byteLength - 4, true));
});

test("alpha planes are bounded together", () => {
  const sized = (width: number, height: number) => (): Packet =>
    readChangedAlpha(1, 2, (view, at) => {
      view.setUint16(at, width, true);
      const table = new DataView(view.buffer);
      const list = follow(table, fieldAt(table, table.getUint32(0, true), 13));
      view.setUint16(fieldAt(table, follow(table, list + 8), 3), height, true);
    });
  assert.equal(sized(8192, 2047)().alpha.length, 2);
  assert.throws(sized(8192, 2048), /^Error: too large an alpha plane$/);
});

test("any alignment reads", () => {
  const bytes = readBytes(kGolden);
  for (let shift = 0; shift < 8; ++shift) {
    const shifted = new Uint8Array(bytes.length + 8);
    shifted.set(bytes, shift);
    assert.deepEqual(readPacket(shifted.subarray(shift, shift + bytes.length)), readPacket(bytes));
  }
});

test("every truncation is an error", () => {
  const bytes = readBytes(kGolden);
  for (let n = 0; n < bytes.length; ++n) assert.throws(() => readPacket(bytes.subarray(0, n)), Malformed, `${n}`);
});

test("other bytes are refused", () => {
  const bytes = readBytes(kGolden);
  assert.equal(openMessage(bytes).kind, "packet");
  assert.throws(() => readChunksAnswer(openMessage(bytes)), Malformed);
  for (const other of ["MRP2", "MRC2", "XRP3"]) {
    bytes.set([...other].map((c) => c.charCodeAt(0)), 4);
    writeChecksum(bytes);
    assert.throws(() => openMessage(bytes), /another version/);
  }
  for (let n = 0; n < 12; ++n) assert.throws(() => openMessage(new Uint8Array(n)), Malformed);
});

test("an answer with chunks reads", () => {
  // root, identifier, vtable of one field, table, vector of no tables
  const bytes = new Uint8Array(32 + kChecksumBytes);
  const view = new DataView(bytes.buffer);
  view.setUint32(0, 16, true);
  bytes.set([..."MRC4"].map((c) => c.charCodeAt(0)), 4);
  [6, 8, 4].forEach((value, i) => view.setUint16(8 + 2 * i, value, true));
  view.setInt32(16, 8, true);
  view.setUint32(20, 8, true);
  writeChecksum(bytes);
  assert.deepEqual(readChunksAnswer(openMessage(bytes)), []);
  view.setUint32(28, 1, true);
  assert.throws(() => openMessage(bytes), /checksum/);
  writeChecksum(bytes);
  assert.throws(() => readChunksAnswer(openMessage(bytes)), Malformed);
});

test("a request has the bytes of docs/wire-format.md", () => {
  const { manifest } = readPacket(readBytes(kGolden));
  const bytes = writeControl({ chunks: manifest.slice(3, 4), keyFrames: [7, 4, 7], wholeHead: true });
  assert.equal(Buffer.from(bytes.subarray(0, -4)).toString("hex"),
    "4d524354" + "01000000" +
    "01000000" + "08000000" + "04000000" + "07000000" +
    "02000000" + "1c000000" +
    "000000000000000000000000" + "01000000" + "01000000" + "00000000" + "01000000" +
    "04000000" + "00000000");
  assert.equal(writeControl({ chunks: [], keyFrames: [], wholeHead: false }).length, 12);
});

/** What every packet that was accepted must fulfil, whatever its bytes. */
function requireCaps(packet: Packet, bytes: number): void {
  const payload = [...packet.chunks.map((c) => c.payload), ...[...packet.textures, ...packet.alpha].map((t) => t.data)];
  assert.ok(payload.reduce((sum, data) => sum + data.length, 0) <= bytes);
  assert.ok(packet.manifest.length <= 65_536 && packet.views.length <= 4096 && packet.textures.length <= 1024);
  for (const view of packet.views) {
    assert.ok([...view.pose.rotation, ...view.pose.translation, view.fx, view.fy, view.cx, view.cy].every(Number.isFinite));
    assert.ok(view.imageRect.width > 0 && view.imageRect.x + view.imageRect.width <= view.width);
    assert.ok(view.atlasRect.height > 0 && view.atlasRect.y + view.atlasRect.height <= 8192);
  }
  for (const chunk of packet.chunks) assert.ok(chunk.triangles >= 1 && chunk.triangles <= 1 << 20);
  const pixels = packet.alpha.map(({ width, height }) => width * height);
  assert.ok(pixels.every((count) => count > 0) && pixels.reduce((a, b) => a + b, 0) <= 1 << 24);
  for (const plane of packet.alpha) assert.ok(plane.stepPx >= 1 && plane.stepPx <= 16 && plane.data.length > 0);
  for (const unit of packet.textures) assert.ok(unit.width <= 8192 && unit.height % 2 === 0 && unit.data.length > 0);
}

test("20,000 corrupted packets give values within the caps or Malformed", () => {
  const random = makeRandom(1);
  const originals = [readBytes(kGolden), readBytes(kRoom), goldenSequence(kAlpha)[2]!];
  let refused = 0;
  for (let round = 0; round < 20_000; ++round) {
    let bytes = originals[round % 3]!.slice();
    const view = new DataView(bytes.buffer);
    for (let edits = 1 + random(4); edits > 0; --edits) {
      const at = random(bytes.length - 4);
      const kind = random(5);
      if (kind === 0) bytes[at]! ^= 1 << random(8);
      else if (kind === 1) bytes[at] = random(256);
      else if (kind === 2) view.setUint32(at & ~3, [0, 1, 0xffffffff, 0x7fffffff, bytes.length, random(bytes.length)][random(6)]!, true);
      else if (kind === 3) view.setUint16(at & ~1, random(65_536), true);
      else bytes.copyWithin(at, random(bytes.length), random(bytes.length));
    }
    if (random(8) === 0) bytes = bytes.subarray(0, kChecksumBytes + random(bytes.length - kChecksumBytes));
    writeChecksum(bytes);
    try {
      requireCaps(readPacket(bytes), bytes.length);
    } catch (error) {
      assert.ok(error instanceof Malformed, `round ${round}: ${String(error)}`);
      ++refused;
    }
  }
  assert.ok(refused > 5000 && refused < 20_000, `${refused} refused`);
});

test("small packets that name the same bytes often do not grow", () => {
  const bytes = readBytes(kGolden);
  const view = new DataView(bytes.buffer);
  const headOffset = fieldAt(view, view.getUint32(0, true), 9);
  const manifest = fieldAt(view, headOffset + view.getUint32(headOffset, true), 5);
  const count = manifest + view.getUint32(manifest, true);
  view.setUint32(count, 60_000, true);
  writeChecksum(bytes);
  assert.throws(() => readPacket(bytes), Malformed);
});
