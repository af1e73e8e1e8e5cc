import { FlatBuffer, Malformed, require, type Span, type Table } from "./bytes.ts";
import { withoutChecksum } from "./crc32.ts";
import type { ChunkKey, EncodedChunk, Packet, Plan, Sensor, TextureUnit, View } from "./packet.ts";
import {
  checkConfirmed, isBefore, isViewBefore, kLimits, Masks, numbers, readAlpha, readChunks, readKeys, readNumbers, readPlan, readSources,
  readStreams, readTexture, readViewKeys, readViews, requireTilesInTextures, time, viewKey,
} from "./packet_parts.ts";

/** What came over the network, undamaged. */
export interface Message {
  readonly kind: "packet" | "chunks";
  /** Its FlatBuffer. */
  readonly body: Uint8Array;
}

/** Tells what a message is by its file identifier, and that its checksum fits, before anything else of it is read. */
export function openMessage(bytes: Uint8Array): Message {
  require(bytes.byteLength <= kLimits.packetBytes, "more than 64 MiB");
  const body = withoutChecksum(bytes);
  require(body !== null, "damaged: its checksum does not fit");
  switch (new FlatBuffer(body).identifier()) {
    case "MRP4":
      return { kind: "packet", body };
    case "MRC4":
      return { kind: "chunks", body };
    default:
      throw new Malformed("not one of our messages, or of another version");
  }
}

/** The numbers by which a packet is put in order. */
export function numbersOf({ body }: Message): { epoch: number; sequence: bigint } {
  const root = new FlatBuffer(body).root();
  return { epoch: root.u32(0), sequence: root.u64(1) };
}

/** Most of a packet, as packets of one node have it in common. Lists are sorted. */
interface Head {
  readonly scene: string;
  readonly node: string;
  readonly plan: Plan;
  readonly sources: readonly Sensor[];
  readonly views: readonly View[];
  readonly manifest: readonly ChunkKey[];
  readonly streams: ReadonlyMap<number, number>;
  readonly stages: readonly string[];
}

/** A head on which packets build, and which packet it was. */
interface Base {
  readonly epoch: number;
  readonly sequence: number;
  readonly head: Head;
}

/** Puts a node's packets together, each of which tells its difference to a base that some of them bring. They are given in
 *  order (PacketOrder). */
export class HeadReader {
  private base: Base | null = null;
  private lacking = false;

  /** Whether the gateway should be asked for a whole head. */
  lacksBase(): boolean {
    return this.lacking;
  }

  /** Reads and checks a packet; null where its base did not come. Payloads stay views of the message. Throws
   *  Malformed and nothing else. */
  read({ kind, body }: Message): Packet | null {
    require(kind === "packet", "not a packet");
    const root = new FlatBuffer(body).root();
    const epoch = root.u32(0);
    const exact = root.u64(1);
    require(exact <= BigInt(Number.MAX_SAFE_INTEGER), "a sequence number beyond 2^53");
    const sequence = Number(exact);
    const age = root.u32(3);
    const coalesced = root.u32(10);
    require(coalesced <= sequence, "more folded packets than there were");
    require(age <= sequence, "a base before the first packet");
    const brings = root.has(9);
    require(age > 0 || brings, "its own base, which it does not bring");
    if (brings) {
      this.base = { epoch, sequence: sequence - age, head: readHead(root.table(9, "the head")) };
      this.lacking = false;
    }
    const base = this.base;
    if (base === null || base.epoch !== epoch || base.sequence !== sequence - age) {
      this.lacking = true;
      return null;
    }
    return readRest(root, base.head, { epoch, sequence, coalesced });
  }
}

/** Reads and checks a packet that needs no other. */
export function readPacket(bytes: Uint8Array): Packet {
  const packet = new HeadReader().read(openMessage(bytes));
  require(packet !== null, "a packet that does not bring its base");
  return packet;
}

/** A packet out of its message and the base. */
function readRest(
  root: Table, base: Head, counts: { epoch: number; sequence: number; coalesced: number },
): Packet {
  const capturedAtNs = time(root.i64(2));
  const textures = root.tables(6, kLimits.textures, "textures").map(readTexture);
  const change = root.has(8) ? root.table(8, "the change") : null;
  const head = change === null ? base : changed(base, change);
  const streams = change?.has(9) ? head.streams : streamsAfter(head.streams, textures);
  require(streams.size <= kLimits.views, "too many streams");
  const chunks = readChunks(root, 7);
  const named = new Set(head.manifest.map((key) => key.name));
  for (const chunk of chunks)
    require(named.has(chunk.key.name), "a chunk that the manifest does not name");
  requireTilesInTextures(head.views, textures);
  const alpha = readAlpha(root, 13);
  const sourceTimes = readTimes(root, 4, 11, capturedAtNs, kLimits.views);
  const markTimes = readTimes(root, 5, 12, capturedAtNs, kLimits.marks);
  require(sourceTimes.length === head.sources.length, "not one time for each sensor");
  require(markTimes.length === head.stages.length, "not one time for each mark");
  return {
    ...counts,
    scene: head.scene,
    node: head.node,
    capturedAtNs,
    sources: head.sources.map((source, i) => ({ ...source, capturedAtNs: sourceTimes[i]! })),
    plan: head.plan,
    views: head.views,
    manifest: head.manifest,
    chunks,
    textures,
    alpha,
    streams,
    marks: head.stages.map((stage, i) => ({ stage, atNs: markTimes[i]! })),
  };
}

function readHead(table: Table): Head {
  const masks = new Masks();
  return {
    scene: table.name(0, kLimits.nameBytes, "the scene's name"),
    node: table.name(1, kLimits.nameBytes, "the node's name"),
    plan: readPlan(table.table(2, "the coding plan")),
    sources: readSources(table, 3, masks),
    views: readViews(table, 4),
    manifest: readKeys(table, 5),
    streams: readStreams(table, 6),
    stages: table.names(7, kLimits.marks, kLimits.nameBytes, "a stage's name"),
  };
}

/** The head of a packet: its base, changed. */
function changed(base: Head, table: Table): Head {
  const masks = new Masks();
  const sources = changedList(
    base.sources, readNumbers(table, 4, kLimits.views, "sources"), readSources(table, 5, masks),
    (source) => source.sensor, (a, b) => a.sensor < b.sensor, kLimits.views, "sensors",
  );
  checkConfirmed(table, 6, sources, masks);
  return {
    ...base,
    plan: table.has(7) ? readPlan(table.table(7, "the coding plan")) : base.plan,
    sources,
    views: changedList(
      base.views, readViewKeys(table, 2), readViews(table, 3), viewKey, isViewBefore, kLimits.views, "views",
    ),
    manifest: changedManifest(base.manifest, readKeys(table, 0), readKeys(table, 1)),
    streams: table.has(9) ? readStreams(table, 9) : base.streams,
    stages: table.has(8) ? table.names(8, kLimits.marks, kLimits.nameBytes, "a stage's name") : base.stages,
  };
}

function changedManifest(
  base: readonly ChunkKey[], removed: readonly ChunkKey[], added: readonly ChunkKey[],
): readonly ChunkKey[] {
  if (removed.length === 0 && added.length === 0) return base;
  const gone = removed.map((key) => key.name);
  const manifest = changedList(base, gone, added, (key) => key.name, isBefore, kLimits.manifestChunks, "chunks");
  require(manifest.length === base.length - removed.length + added.length, "it adds chunks that were there");
  return manifest;
}

/** A sorted list without what is removed, with what has come or is another. */
function changedList<T, Key>(
  list: readonly T[], removed: readonly Key[], come: readonly T[], keyOf: (item: T) => Key,
  before: (a: T, b: T) => boolean, most: number, what: string,
): readonly T[] {
  if (removed.length === 0 && come.length === 0) return list;
  const gone = new Set(removed);
  const replaced = new Set(come.map(keyOf));
  let found = 0;
  const kept = list.filter((item) => {
    const key = keyOf(item);
    if (gone.has(key)) ++found;
    return !gone.has(key) && !replaced.has(key);
  });
  require(found === gone.size, `it removes unknown ${what}`);
  const out = [...kept, ...come].sort((a, b) => (before(a, b) ? -1 : before(b, a) ? 1 : 0));
  require(out.length <= most, `too many ${what}`);
  return out;
}

/** How far the streams are after some units. */
function streamsAfter(
  before: ReadonlyMap<number, number>, units: readonly TextureUnit[],
): ReadonlyMap<number, number> {
  if (units.length === 0) return before;
  const streams = new Map(before);
  for (const { stream, serial } of units) streams.set(stream, serial);
  return streams;
}

/** Times that are told in 32 bits after `from`, or as they are. */
function readTimes(root: Table, delays: number, times: number, from: bigint, most: number): bigint[] {
  require(!(root.has(delays) && root.has(times)), "times told twice");
  const view = root.buffer.view;
  const short = root.vector(delays, 4, most, "times");
  const long = root.vector(times, 8, most, "times");
  return [
    ...numbers(short, 4, (at) => view.getInt32(at, true)).map((delay) => time(from + BigInt(delay))),
    ...bigints(long, (at) => time(view.getBigInt64(at, true))),
  ];
}

function bigints(span: Span, read: (at: number) => bigint): bigint[] {
  const out: bigint[] = [];
  for (let i = 0; i < span.count; ++i) out.push(read(span.at + 8 * i));
  return out;
}

/** Reads and checks the answer to a request. */
export function readChunksAnswer({ kind, body }: Message): EncodedChunk[] {
  require(kind === "chunks", "not an answer with chunks");
  return readChunks(new FlatBuffer(body).root(), 0);
}
