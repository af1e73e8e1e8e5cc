import assert from "node:assert/strict";
import { test } from "node:test";
import type { ChunkKey, EncodedChunk, Packet, TextureUnit, View } from "../../src/packet.ts";
import { Receiver } from "../../src/receiver.ts";

function key(x: number, version = 0): ChunkKey {
  return {
    x, y: 0, z: 0, source: 0xffffffff, layer: 0, level: 0, version, name: `${x},0,0,4294967295,0,0,${version}`,
  };
}
function chunk(of: ChunkKey): EncodedChunk {
  return { key: of, errorM: 0, triangles: 1, views: [0], payload: new Uint8Array(1) };
}
function unit(keyFrame: boolean, serial: number, layout = 0, stream = 0): TextureUnit {
  return { stream, serial, layout, width: 16, height: 16, keyFrame, data: new Uint8Array(1) };
}
function view(layout = 0, stream = 0): View {
  return {
    id: stream, kind: "pinhole", width: 16, height: 16, fx: 16, fy: 16, cx: 8, cy: 8,
    pose: { rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1], translation: [0, 0, 0] },
    imageRect: { x: 0, y: 0, width: 16, height: 16 }, atlasRect: { x: 0, y: 0, width: 16, height: 16 },
    gutterPx: 2, stream, layout, layer: 0, gain: [1, 1, 1],
  };
}
/** A packet whose unit of stream 0 has its sequence for a serial. */
function packet(sequence: number, rest: Partial<Packet> = {}): Packet {
  return {
    scene: "room", node: "root", epoch: 1, sequence, capturedAtNs: BigInt(sequence), sources: [],
    plan: { simplifyRatio: 1, meshSpeed: 5, textureScale: 1, textureQp: 28, simplifyErrorM: 0 },
    views: [view()], manifest: [key(0)], chunks: [], textures: [unit(false, sequence)], alpha: [], streams: new Map([[0, sequence]]),
    marks: [], coalesced: 0, ...rest,
  };
}
const first = (): Packet => packet(1, { chunks: [chunk(key(0))], textures: [unit(true, 1)] });

/** Decodes at once whatever is given to decode; meshes and pictures are their names. */
class Client {
  readonly receiver = new Receiver<string, string>();
  give(p: Packet): { shown: string | null; done: number[] } {
    this.decode(this.receiver.accept(p));
    return this.take();
  }
  decode(work: ReturnType<Receiver<string, string>["accept"]>): void {
    for (const { key: { name } } of work?.chunks ?? []) this.receiver.chunkDecoded(name, name);
    for (const { ticket } of work?.units ?? []) this.receiver.pictureDecoded(ticket, `picture ${ticket}`);
  }
  take(): { shown: string | null; done: number[] } {
    const { complete, done } = this.receiver.take();
    const pictures = [...(complete?.pictures.values() ?? [])].join();
    return { shown: complete === null ? null : `${complete.packet.sequence}: ${pictures}`, done };
  }
}

test("a packet is shown when mesh and picture are there, and only then", () => {
  const { receiver } = new Client();
  const work = receiver.accept(first())!;
  assert.deepEqual(work.chunks.map((c) => c.key.name), [key(0).name]);
  assert.equal(work.units.length, 1);
  assert.deepEqual(receiver.take(), { complete: null, done: [] });
  receiver.chunkDecoded(key(0).name, "mesh");
  assert.deepEqual(receiver.take(), { complete: null, done: [] });
  receiver.pictureDecoded(work.units[0]!.ticket, "picture");
  const { complete, done } = receiver.take();
  assert.deepEqual(complete?.pictures, new Map([[0, "picture"]]));
  assert.deepEqual(complete?.meshes, new Map([[key(0).name, "mesh"]]));
  assert.deepEqual(done, [1]);
  assert.deepEqual(receiver.take(), { complete: null, done: [] });
});

test("kept chunks are not decoded again", () => {
  const client = new Client();
  client.give(first());
  const work = client.receiver.accept(packet(2))!;
  assert.equal(work.chunks.length, 0);
  client.decode(work);
  assert.deepEqual(client.take(), { shown: "2: picture 2", done: [2] });
});

test("the newest complete capture wins and ends the older ones", () => {
  const client = new Client();
  const one = client.receiver.accept(first());
  const two = client.receiver.accept(packet(2));
  client.decode(one);
  client.decode(two);
  assert.deepEqual(client.take(), { shown: "2: picture 2", done: [1, 2] });
});

test("a picture never goes with the mesh of another capture", () => {
  const client = new Client();
  client.give(first());
  const two = client.receiver.accept(packet(2, { manifest: [key(0, 1)], chunks: [chunk(key(0, 1))] }))!;
  client.receiver.pictureDecoded(two.units[0]!.ticket, "new picture");
  assert.deepEqual(client.take(), { shown: null, done: [] });
  client.receiver.chunkDecoded(key(0, 1).name, "new mesh");
  assert.deepEqual(client.take(), { shown: "2: new picture", done: [2] });
});

test("a lost unit makes its stream wait for a key frame, and is acknowledged", () => {
  const client = new Client();
  client.give(first());
  assert.deepEqual(client.give(packet(3)), { shown: null, done: [3] });
  assert.deepEqual(client.receiver.streamsWaiting(), [0]);
  assert.deepEqual(client.give(packet(4)), { shown: null, done: [4] });
  assert.deepEqual(client.give(packet(5, { textures: [unit(true, 5)] })), { shown: "5: picture 2", done: [5] });
  assert.deepEqual(client.receiver.streamsWaiting(), []);
});

test("a gap without a lost unit changes nothing", () => {
  const client = new Client();
  client.give(first());
  const quiet = { textures: [], streams: new Map([[0, 1]]) };
  assert.equal(client.give(packet(9, quiet)).shown, "9: picture 1");
  assert.equal(client.give(packet(10, { textures: [unit(false, 2)], streams: new Map([[0, 2]]) })).shown, "10: picture 2");
});

test("a stream whose last unit was lost waits, though nothing follows", () => {
  const client = new Client();
  const plate = { ...view(0, 1), layer: 1 as const };
  const both = { views: [view(), plate] };
  client.give({
    ...first(), ...both, textures: [unit(true, 1), unit(true, 7, 0, 1)], streams: new Map([[0, 1], [1, 7]]),
  });
  assert.equal(client.give(packet(2, { ...both, streams: new Map([[0, 2], [1, 7]]) })).shown, "2: picture 3,picture 2");
  assert.equal(client.give(packet(3, { ...both, streams: new Map([[0, 3], [1, 8]]) })).shown, null);
  assert.deepEqual(client.receiver.streamsWaiting(), [1]);
  const again = packet(4, {
    ...both, textures: [unit(false, 4), unit(true, 9, 0, 1)], streams: new Map([[0, 4], [1, 9]]),
  });
  assert.equal(client.give(again).shown, "4: picture 5,picture 6");
});

test("folded packets are no gap, and their last picture belongs to the mesh", () => {
  const client = new Client();
  client.give(first());
  const folded = packet(4, { coalesced: 2, textures: [unit(false, 2), unit(false, 3), unit(false, 4)] });
  assert.deepEqual(client.give(folded), { shown: "4: picture 4", done: [4] });
  assert.deepEqual(client.give(packet(7, { coalesced: 1 })), { shown: null, done: [7] });
});

test("older packets are refused, another epoch or node starts afresh", () => {
  const client = new Client();
  client.give(first());
  client.give(packet(2));
  assert.equal(client.receiver.accept(packet(2)), null);
  assert.equal(client.receiver.accept(first()), null);
  const again = client.receiver.accept({ ...first(), epoch: 2 })!;
  assert.ok(again.fresh);
  assert.equal(again.chunks.length, 1, "its chunk is another content");
  client.decode(again);
  assert.deepEqual(client.take(), { shown: "1: picture 3", done: [1] });
  assert.ok(client.receiver.accept({ ...first(), epoch: 2, node: "other" })!.fresh);
});

test("what is missing is asked for, given up for now, and shown when it comes", () => {
  const client = new Client();
  client.give(first());
  const two = packet(2, { manifest: [key(0), key(1)] });
  assert.deepEqual(client.give(two), { shown: null, done: [2] });
  assert.deepEqual(client.receiver.missing(), [key(1)]);
  assert.deepEqual(client.receiver.provide([chunk(key(1)), chunk(key(9))]).map((c) => c.key), [key(1)]);
  assert.deepEqual(client.receiver.missing(), []);
  client.receiver.chunkDecoded(key(1).name, "mesh");
  assert.deepEqual(client.take(), { shown: "2: picture 2", done: [] });
});

test("a broken chunk counts as missing", () => {
  const { receiver } = new Client();
  receiver.accept(first());
  assert.deepEqual(receiver.missing(), []);
  receiver.chunkFailed(key(0).name);
  assert.deepEqual(receiver.missing(), [key(0)]);
});

test("a broken picture makes its stream wait, and ends what waited for it", () => {
  const client = new Client();
  client.give(first());
  client.receiver.accept(packet(2));
  client.receiver.accept(packet(3));
  client.receiver.streamFailed(0);
  assert.deepEqual(client.receiver.streamsWaiting(), [0]);
  assert.deepEqual(client.take(), { shown: null, done: [2, 3] });
  assert.deepEqual(client.give(packet(4, { textures: [unit(true, 4)] })).done, [4]);
});

test("a layout changes with a key frame only", () => {
  const client = new Client();
  client.give(first());
  const wrong = packet(2, { views: [view(1)], textures: [unit(false, 2, 1)] });
  assert.deepEqual(client.give(wrong), { shown: null, done: [2] });
  assert.deepEqual(client.receiver.streamsWaiting(), [0]);
  const right = packet(3, { views: [view(1)], textures: [unit(true, 3, 1)] });
  assert.equal(client.give(right).shown, "3: picture 2");
});

test("a stream without a new unit keeps its picture", () => {
  const client = new Client();
  client.give(first());
  const streams = new Map([[0, 1]]);
  assert.equal(client.give(packet(2, { textures: [], streams })).shown, "2: picture 1");
  assert.equal(client.give(packet(3, { textures: [], streams })).shown, "3: picture 1");
});

test("a view of a stream that never came needs a key frame", () => {
  const client = new Client();
  const late = { ...first(), views: [view(), view(0, 7)] };
  assert.deepEqual(client.give(late), { shown: null, done: [1] });
  assert.deepEqual(client.receiver.streamsWaiting(), [7]);
});

test("a scene without views needs no picture", () => {
  const client = new Client();
  const plain = packet(1, { views: [], textures: [], streams: new Map(), chunks: [chunk(key(0))] });
  assert.deepEqual(client.give(plain), { shown: "1: ", done: [1] });
  assert.deepEqual(client.receiver.streamsWaiting(), []);
});
