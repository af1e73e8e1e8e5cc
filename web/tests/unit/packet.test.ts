import assert from "node:assert/strict";
import { test } from "node:test";
import { Malformed } from "../../src/bytes.ts";
import { kindOf, readChunksAnswer, readPacket, writeRequest, type Packet } from "../../src/packet.ts";
import { makeRandom, readBytes } from "./support.ts";

const kGolden = "../tests/data/packet_v1.bin";
const kRoom = "tests/data/chunks_room.bin";

test("the golden packet of the C++ side reads", () => {
  const packet = readPacket(readBytes(kGolden));
  assert.equal(packet.scene, "living room");
  assert.equal(packet.node, "merge/root");
  assert.equal(packet.epoch, 2);
  assert.equal(packet.sequence, 1_234_567_890_123);
  assert.equal(packet.coalesced, 0);
  assert.equal(packet.capturedAtNs, 1_700_000_000_123_456_789n);
  assert.deepEqual(packet.sources.map((source) => source.sensor), [0, 2, 5]);
  assert.equal(packet.sources[1]!.capturedAtNs, 1_700_000_000_000_000_002n);
  const plan = { simplifyRatio: 0.5, meshSpeed: 7, textureScale: 0.75, textureQp: 33 };
  assert.deepEqual(packet.plan, plan);
  assert.deepEqual(packet.manifest.map((key) => key.name), ["-1,2,3,4294967295,0,7", "0,0,0,1,0,8", "0,0,0,1,2,1"]);
  const [chunk] = packet.chunks;
  assert.equal(packet.chunks.length, 1);
  assert.equal(chunk!.key.name, "0,0,0,1,2,1");
  assert.equal(chunk!.triangles, 12);
  assert.deepEqual([...chunk!.payload], Array.from({ length: 45 }, (_, i) => (i * 37) & 255));
  assert.deepEqual(packet.textures.map(({ data, ...rest }) => ({ ...rest, bytes: data.length })), [
    { stream: 0, layout: 3, width: 640, height: 400, keyFrame: true, bytes: 77 },
    { stream: 1, layout: 4, width: 8192, height: 8192, keyFrame: false, bytes: 5 },
  ]);
  assert.deepEqual(packet.marks, [
    { stage: "cam0/fuse", atNs: 5n },
    { stage: "cam0/encode_mesh", atNs: 6n },
  ]);
  const pose = { rotation: [0, 0, 1, 1, 0, 0, 0, 1, 0], translation: [1, 2, 3] };
  assert.deepEqual(packet.views[1], {
    id: 5, kind: "equirectangular", width: 1280, height: 720, fx: 600, fy: 601, cx: 640, cy: 360.5, pose,
    imageRect: { x: 10, y: 20, width: 1200, height: 700 },
    atlasRect: { x: 16, y: 32, width: 600, height: 350 },
    gutterPx: 2.5, stream: 9, layout: 3,
  });
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
  assert.equal(kindOf(bytes), "packet");
  assert.throws(() => readChunksAnswer(bytes), Malformed);
  bytes[4] = 0x58;
  assert.throws(() => kindOf(bytes), Malformed);
  assert.throws(() => kindOf(new Uint8Array(0)), Malformed);
});

test("an answer with chunks reads", () => {
  // root, identifier, vtable of one field, table, vector of no tables
  const bytes = new Uint8Array(32);
  const view = new DataView(bytes.buffer);
  view.setUint32(0, 16, true);
  bytes.set([..."MRCH"].map((c) => c.charCodeAt(0)), 4);
  [6, 8, 4].forEach((value, i) => view.setUint16(8 + 2 * i, value, true));
  view.setInt32(16, 8, true);
  view.setUint32(20, 8, true);
  assert.deepEqual(readChunksAnswer(bytes), []);
  view.setUint32(28, 1, true);
  assert.throws(() => readChunksAnswer(bytes), Malformed);
});

test("a request has the bytes of docs/wire-format.md", () => {
  const { manifest } = readPacket(readBytes(kGolden));
  const bytes = writeRequest(manifest.slice(0, 1), true);
  assert.equal(Buffer.from(bytes).toString("hex"),
    "4d525754" + "01000000" + "01000000" + "ffffffff" + "02000000" + "03000000" + "ffffffff" + "00000000" + "07000000");
  assert.equal(writeRequest([], false).length, 12);
});

/** What every packet that was accepted must fulfil, whatever its bytes. */
function requireCaps(packet: Packet, bytes: number): void {
  const payload = [...packet.chunks.map((c) => c.payload), ...packet.textures.map((t) => t.data)];
  assert.ok(payload.reduce((sum, data) => sum + data.length, 0) <= bytes);
  assert.ok(packet.manifest.length <= 65_536 && packet.views.length <= 4096 && packet.textures.length <= 1024);
  for (const view of packet.views) {
    assert.ok([...view.pose.rotation, ...view.pose.translation, view.fx, view.fy, view.cx, view.cy].every(Number.isFinite));
    assert.ok(view.imageRect.width > 0 && view.imageRect.x + view.imageRect.width <= view.width);
    assert.ok(view.atlasRect.height > 0 && view.atlasRect.y + view.atlasRect.height <= 8192);
  }
  for (const chunk of packet.chunks) assert.ok(chunk.triangles >= 1 && chunk.triangles <= 1 << 20);
  for (const unit of packet.textures) assert.ok(unit.width <= 8192 && unit.height % 2 === 0 && unit.data.length > 0);
}

test("20,000 corrupted packets give values within the caps or Malformed", () => {
  const random = makeRandom(1);
  const originals = [readBytes(kGolden), readBytes(kRoom)];
  let refused = 0;
  for (let round = 0; round < 20_000; ++round) {
    let bytes = originals[round % 2]!.slice();
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
    if (random(8) === 0) bytes = bytes.subarray(0, random(bytes.length));
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
  const root = view.getUint32(0, true);
  const vtable = root - view.getInt32(root, true);
  const manifest = root + view.getUint16(vtable + 4 + 2 * 8, true);
  const count = manifest + view.getUint32(manifest, true);
  view.setUint32(count, 60_000, true);
  assert.throws(() => readPacket(bytes), Malformed);
});
