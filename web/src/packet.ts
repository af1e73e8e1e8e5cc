import { FlatBuffer, Malformed, require, Table, type Span } from "./bytes.ts";

/** docs/wire-format.md, schema/packet.fbs. */

export const kNoView = 0xffffffff;
export const kBackgroundSource = 0xfffffffe;

const kLimits = {
  packetBytes: 64 << 20,
  manifestChunks: 1 << 16,
  views: 4096,
  viewsOfChunk: 254,
  textures: 1 << 14,
  textureSide: 8192,
  cameraSide: 16384,
  chunkTriangles: 1 << 20,
  packetTriangles: 1 << 24,
  nameBytes: 256,
  marks: 1024,
  requestChunks: 4096,
};
const kCenturies = 1n << 61n;
const kFarthest = 1e8;
const kRigidTolerance = 1e-3;

/** p_world = R p_camera + t; R by rows. */
export interface Pose {
  readonly rotation: readonly number[];
  readonly translation: readonly number[];
}

export interface Rect {
  readonly x: number;
  readonly y: number;
  readonly width: number;
  readonly height: number;
}

/** Names one content for ever; `name` is the same as text. */
export interface ChunkKey {
  readonly x: number;
  readonly y: number;
  readonly z: number;
  readonly source: number;
  readonly level: number;
  readonly version: number;
  readonly name: string;
}

export interface Source {
  readonly sensor: number;
  readonly capturedAtNs: bigint;
  readonly pose: Pose;
}

export interface View {
  readonly id: number;
  readonly kind: "pinhole" | "equirectangular";
  readonly width: number;
  readonly height: number;
  readonly fx: number;
  readonly fy: number;
  readonly cx: number;
  readonly cy: number;
  readonly pose: Pose;
  readonly imageRect: Rect;
  readonly atlasRect: Rect;
  readonly gutterPx: number;
  readonly stream: number;
  readonly layout: number;
}

export interface EncodedChunk {
  readonly key: ChunkKey;
  readonly errorM: number;
  readonly triangles: number;
  readonly views: readonly number[];
  readonly payload: Uint8Array;
}

export interface TextureUnit {
  readonly stream: number;
  readonly layout: number;
  readonly width: number;
  readonly height: number;
  readonly keyFrame: boolean;
  readonly data: Uint8Array;
}

export interface Plan {
  readonly simplifyRatio: number;
  readonly meshSpeed: number;
  readonly textureScale: number;
  readonly textureQp: number;
}

export interface Packet {
  readonly scene: string;
  readonly node: string;
  readonly epoch: number;
  readonly sequence: number;
  readonly capturedAtNs: bigint;
  readonly sources: readonly Source[];
  readonly plan: Plan;
  readonly views: readonly View[];
  readonly manifest: readonly ChunkKey[];
  readonly chunks: readonly EncodedChunk[];
  readonly textures: readonly TextureUnit[];
  readonly marks: readonly { readonly stage: string; readonly atNs: bigint }[];
  readonly coalesced: number;
}

/** What a message is, by its file identifier. */
export function kindOf(bytes: Uint8Array): "packet" | "chunks" {
  require(bytes.byteLength <= kLimits.packetBytes, "more than 64 MiB");
  switch (new FlatBuffer(bytes).identifier()) {
    case "MRPK":
      return "packet";
    case "MRCH":
      return "chunks";
    default:
      throw new Malformed("not one of our messages, or of another version");
  }
}

/** Reads and checks a packet. Payloads stay views of `bytes`. Throws Malformed and nothing else. */
export function readPacket(bytes: Uint8Array): Packet {
  require(kindOf(bytes) === "packet", "not a packet");
  const root = new FlatBuffer(bytes).root();
  const manifest = readManifest(root);
  const chunks = readChunks(root, 9);
  const named = new Set(manifest.map((key) => key.name));
  for (const chunk of chunks)
    require(named.has(chunk.key.name), "a chunk that the manifest does not name");
  const textures = root.tables(10, kLimits.textures, "textures").map(readTexture);
  const sequence = root.u64(3);
  require(sequence <= BigInt(Number.MAX_SAFE_INTEGER), "a sequence number beyond 2^53");
  return {
    scene: root.name(0, kLimits.nameBytes, "the scene's name"),
    node: root.name(1, kLimits.nameBytes, "the node's name"),
    epoch: root.u32(2),
    sequence: Number(sequence),
    capturedAtNs: time(root.i64(4)),
    sources: readSources(root),
    plan: readPlan(root.table(6, "the coding plan")),
    views: readViews(root, textures),
    manifest,
    chunks,
    textures,
    marks: root.tables(11, kLimits.marks, "marks").map((mark) => ({
      stage: mark.name(0, kLimits.nameBytes, "a stage's name"),
      atNs: time(mark.i64(1)),
    })),
    coalesced: root.u32(12),
  };
}

/** Reads and checks the answer to a request. */
export function readChunksAnswer(bytes: Uint8Array): EncodedChunk[] {
  require(kindOf(bytes) === "chunks", "not an answer with chunks");
  return readChunks(new FlatBuffer(bytes).root(), 0);
}

/** A request for chunks, and for a key frame on every stream. */
export function writeRequest(chunks: readonly ChunkKey[], keyFrame: boolean): Uint8Array<ArrayBuffer> {
  const asked = chunks.slice(0, kLimits.requestChunks);
  const out = new Uint8Array(12 + 24 * asked.length);
  const view = new DataView(out.buffer);
  out.set([..."MRWT"].map((c) => c.charCodeAt(0)));
  view.setUint32(4, keyFrame ? 1 : 0, true);
  view.setUint32(8, asked.length, true);
  asked.forEach((key, i) => {
    const fields = [key.x, key.y, key.z, key.source, key.level, key.version];
    fields.forEach((value, n) => view.setUint32(12 + 24 * i + 4 * n, value, true));
  });
  return out;
}

function within(value: number, low: number, high: number): boolean {
  return value >= low && value <= high;
}

function time(ns: bigint): bigint {
  require(ns > -kCenturies && ns < kCenturies, "a time out of range");
  return ns;
}

function readKey(buffer: FlatBuffer, at: number): ChunkKey {
  const view = buffer.view;
  const x = view.getInt32(at, true);
  const y = view.getInt32(at + 4, true);
  const z = view.getInt32(at + 8, true);
  const source = view.getUint32(at + 12, true);
  const level = view.getUint32(at + 16, true);
  const version = view.getUint32(at + 20, true);
  return { x, y, z, source, level, version, name: `${x},${y},${z},${source},${level},${version}` };
}

function isBefore(a: ChunkKey, b: ChunkKey): boolean {
  if (a.x !== b.x) return a.x < b.x;
  if (a.y !== b.y) return a.y < b.y;
  if (a.z !== b.z) return a.z < b.z;
  if (a.source !== b.source) return a.source < b.source;
  if (a.level !== b.level) return a.level < b.level;
  return a.version < b.version;
}

function requireSorted<T>(list: readonly T[], before: (a: T, b: T) => boolean, what: string): void {
  list.forEach((item, i) => require(i === 0 || before(list[i - 1]!, item), `unsorted ${what}`));
}

function readManifest(root: Table): ChunkKey[] {
  const span = root.vector(8, 24, kLimits.manifestChunks, "chunks in the manifest");
  const keys: ChunkKey[] = [];
  for (let i = 0; i < span.count; ++i) keys.push(readKey(root.buffer, span.at + 24 * i));
  requireSorted(keys, isBefore, "manifest");
  return keys;
}

function readChunks(root: Table, field: number): EncodedChunk[] {
  let triangles = 0;
  const chunks = root.tables(field, kLimits.manifestChunks, "chunks").map((table) => {
    const chunk = readChunk(table);
    triangles += chunk.triangles;
    require(triangles <= kLimits.packetTriangles, "too many triangles");
    return chunk;
  });
  requireSorted(chunks, (a, b) => isBefore(a.key, b.key), "chunks");
  return chunks;
}

function readChunk(table: Table): EncodedChunk {
  const errorM = table.f32(1);
  const triangles = table.u32(2);
  require(within(errorM, 0, 1e6), "an impossible error of a chunk");
  require(within(triangles, 1, kLimits.chunkTriangles), "an impossible number of triangles");
  const span = table.vector(3, 4, kLimits.viewsOfChunk, "views of a chunk");
  const views = numbers(span, 4, (at) => table.buffer.view.getUint32(at, true));
  requireSorted(views, (a, b) => a < b, "views of a chunk");
  require(!views.includes(kNoView), "a chunk that names no view as view");
  const key = readKey(table.buffer, table.struct(0, 24, "a chunk's key"));
  return { key, errorM, triangles, views, payload: table.payload(4, "a chunk's payload") };
}

function numbers(span: Span, bytes: number, read: (at: number) => number): number[] {
  const out: number[] = [];
  for (let i = 0; i < span.count; ++i) out.push(read(span.at + bytes * i));
  return out;
}

function readTexture(table: Table): TextureUnit {
  const width = table.i32(3);
  const height = table.i32(4);
  require(table.u8(1) === 0, "an unknown texture codec");
  for (const side of [width, height])
    require(within(side, 2, kLimits.textureSide) && side % 2 === 0, "an impossible size of a texture");
  return {
    stream: table.u32(0),
    layout: table.u32(2),
    width,
    height,
    keyFrame: table.u8(5) !== 0,
    data: table.payload(6, "a texture's payload"),
  };
}

function readPlan(table: Table): Plan {
  const plan = {
    simplifyRatio: table.f32(0, 1),
    meshSpeed: table.i32(1, 5),
    textureScale: table.f32(2, 1),
    textureQp: table.i32(3, 28),
  };
  require(
    within(plan.simplifyRatio, 0, 1) && within(plan.meshSpeed, 0, 10) &&
      within(plan.textureScale, 0, 16) && within(plan.textureQp, 0, 51),
    "an impossible coding plan",
  );
  return plan;
}

function readPose(buffer: FlatBuffer, at: number): Pose {
  const values = numbers({ at, count: 12 }, 8, (n) => buffer.view.getFloat64(n, true));
  const rotation = values.slice(0, 9);
  const translation = values.slice(9);
  require(isRigid(rotation) && translation.every((v) => Math.abs(v) <= kFarthest), "a pose that is not rigid");
  return { rotation, translation };
}

/** No entry of RᵀR - I exceeds the tolerance, and the determinant is positive. */
function isRigid(r: readonly number[]): boolean {
  const entry = (row: number, column: number): number => r[3 * row + column]!;
  for (let i = 0; i < 3; ++i)
    for (let j = 0; j <= i; ++j) {
      let product = i === j ? -1 : 0;
      for (let k = 0; k < 3; ++k) product += entry(k, i) * entry(k, j);
      if (!(Math.abs(product) <= kRigidTolerance)) return false;
    }
  const minor = (a: number, b: number): number => entry(1, a) * entry(2, b) - entry(1, b) * entry(2, a);
  return entry(0, 0) * minor(1, 2) - entry(0, 1) * minor(0, 2) + entry(0, 2) * minor(0, 1) > 0;
}

interface Lens {
  readonly width: number;
  readonly height: number;
  readonly fx: number;
  readonly fy: number;
  readonly cx: number;
  readonly cy: number;
}

function readLens(table: Table, first: number): Lens {
  const lens = {
    width: table.i32(first),
    height: table.i32(first + 1),
    fx: table.f64(first + 2),
    fy: table.f64(first + 3),
    cx: table.f64(first + 4),
    cy: table.f64(first + 5),
  };
  require([lens.fx, lens.fy, lens.cx, lens.cy].every(Number.isFinite), "intrinsics that are not finite");
  require(
    within(lens.width, 1, kLimits.cameraSide) && within(lens.height, 1, kLimits.cameraSide),
    "a camera of impossible size",
  );
  return lens;
}

function requirePinhole({ width, height, fx, fy, cx, cy }: Lens): void {
  require(
    within(fx, 0.05 * width, 100 * width) && within(fy, 0.05 * height, 100 * height),
    "focal lengths that do not fit the size",
  );
  require(within(cx, 0, width - 1) && within(cy, 0, height - 1), "a principal point outside the picture");
}

function readSources(root: Table): Source[] {
  const sources = root.tables(5, kLimits.views, "sources").map((table) => {
    requireDepthCamera(table.table(2, "a depth camera"));
    require(within(table.f64(4), 0, 1e3) && within(table.f64(5), 0, 1e3), "an impossible precision");
    return {
      sensor: table.u32(0),
      capturedAtNs: time(table.i64(1)),
      pose: readPose(table.buffer, table.struct(3, 96, "a sensor's pose")),
    };
  });
  requireSorted(sources, (a, b) => a.sensor < b.sensor, "sources");
  return sources;
}

function requireDepthCamera(table: Table): void {
  const model = table.u8(0);
  require(model <= 2, "an unknown camera model");
  const lens = readLens(table, 1);
  for (const field of [7, 8]) {
    const span = table.vector(field, 8, kLimits.cameraSide, "LiDAR beams");
    const beams = numbers(span, 8, (at) => table.buffer.view.getFloat64(at, true));
    require(beams.every((angle) => within(angle, -7, 7)), "an impossible LiDAR beam");
    require(model !== 2 || beams.length === lens.height, "a LiDAR without one beam per row");
  }
  if (model === 0) requirePinhole(lens);
}

function readRect(buffer: FlatBuffer, at: number): Rect {
  const [x, y, width, height] = numbers({ at, count: 4 }, 4, (n) => buffer.view.getInt32(n, true));
  return { x: x!, y: y!, width: width!, height: height! };
}

function fits(inner: Rect, width: number, height: number): boolean {
  return inner.x >= 0 && inner.y >= 0 && inner.width > 0 && inner.height > 0 &&
    inner.x + inner.width <= width && inner.y + inner.height <= height;
}

function readViews(root: Table, textures: readonly TextureUnit[]): View[] {
  const sizes = new Map(textures.map((unit) => [unit.stream, unit]));
  const views = root.tables(7, kLimits.views, "views").map((table) => {
    const view = readView(table);
    const { width, height } = sizes.get(view.stream) ??
      { width: kLimits.textureSide, height: kLimits.textureSide };
    require(fits(view.atlasRect, width, height), "a view's atlas_rect outside its texture");
    return view;
  });
  requireSorted(views, (a, b) => a.id < b.id, "views");
  return views;
}

function readView(table: Table): View {
  const kind = table.u8(1);
  require(kind <= 1, "an unknown kind of view");
  const lens = readLens(table, 2);
  if (kind === 0) requirePinhole(lens);
  const view: View = {
    ...lens,
    id: table.u32(0),
    kind: kind === 0 ? "pinhole" : "equirectangular",
    pose: readPose(table.buffer, table.struct(8, 96, "a view's pose")),
    imageRect: readRect(table.buffer, table.struct(9, 16, "a view's image_rect")),
    atlasRect: readRect(table.buffer, table.struct(10, 16, "a view's atlas_rect")),
    gutterPx: table.f32(11),
    stream: table.u32(12),
    layout: table.u32(13),
  };
  require(view.id !== kNoView, "a view with the number of no view");
  require(within(view.gutterPx, 0, 1024), "an impossible gutter");
  require(fits(view.imageRect, view.width, view.height), "a view's image_rect outside its picture");
  return view;
}
