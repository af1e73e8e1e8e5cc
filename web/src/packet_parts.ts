import { FlatBuffer, require, Table, type Span } from "./bytes.ts";
import { kMoving, kStill, type Layer } from "./layers.ts";
import {
  kNoView, type AlphaPlane, type ChunkKey, type EncodedChunk, type Plan, type Pose, type Rect, type Sensor, type TextureUnit, type View,
} from "./packet.ts";
import type { Vec3 } from "./vec.ts";

/** The parts of a packet, each read and checked. Lists are sorted. */

export const kLimits = {
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
  maskTilePx: 256,
  maskTiles: 1 << 26,
  requestChunks: 4096,
  requestStreams: 1024,
  mostGain: 16,
  alphaPixels: 1 << 24,
  alphaStepPx: 16,
};
export const kKeyBytes = 28;
const kCenturies = 1n << 61n;
const kFarthest = 1e8;
const kRigidTolerance = 1e-3;

function within(value: number, low: number, high: number): boolean {
  return value >= low && value <= high;
}

export function time(ns: bigint): bigint {
  require(ns > -kCenturies && ns < kCenturies, "a time out of range");
  return ns;
}

function readLayer(value: number): Layer {
  require(value <= kStill, "an unknown layer");
  return value === kStill ? kStill : kMoving;
}

function readKey(buffer: FlatBuffer, at: number): ChunkKey {
  const view = buffer.view;
  const x = view.getInt32(at, true);
  const y = view.getInt32(at + 4, true);
  const z = view.getInt32(at + 8, true);
  const source = view.getUint32(at + 12, true);
  const layer = readLayer(view.getUint32(at + 16, true));
  const level = view.getUint32(at + 20, true);
  const version = view.getUint32(at + 24, true);
  const name = `${x},${y},${z},${source},${layer},${level},${version}`;
  return { x, y, z, source, layer, level, version, name };
}

export function isBefore(a: ChunkKey, b: ChunkKey): boolean {
  if (a.x !== b.x) return a.x < b.x;
  if (a.y !== b.y) return a.y < b.y;
  if (a.z !== b.z) return a.z < b.z;
  if (a.source !== b.source) return a.source < b.source;
  if (a.layer !== b.layer) return a.layer < b.layer;
  if (a.level !== b.level) return a.level < b.level;
  return a.version < b.version;
}

function requireSorted<T>(list: readonly T[], before: (a: T, b: T) => boolean, what: string): void {
  list.forEach((item, i) => require(i === 0 || before(list[i - 1]!, item), `unsorted ${what}`));
}

export function readKeys(table: Table, field: number): ChunkKey[] {
  const span = table.vector(field, kKeyBytes, kLimits.manifestChunks, "chunks in the manifest");
  const keys: ChunkKey[] = [];
  for (let i = 0; i < span.count; ++i) keys.push(readKey(table.buffer, span.at + kKeyBytes * i));
  requireSorted(keys, isBefore, "manifest");
  return keys;
}

export function readNumbers(table: Table, field: number, most: number, what: string): number[] {
  const span = table.vector(field, 4, most, what);
  const out = numbers(span, 4, (at) => table.buffer.view.getUint32(at, true));
  requireSorted(out, (a, b) => a < b, what);
  return out;
}

/** Pairs of 32-bit numbers. */
function readPairs(table: Table, field: number, what: string): [number, number][] {
  const span = table.vector(field, 8, kLimits.views, what);
  const view = table.buffer.view;
  const out: [number, number][] = [];
  for (let i = 0; i < span.count; ++i)
    out.push([view.getUint32(span.at + 8 * i, true), view.getUint32(span.at + 8 * i + 4, true)]);
  return out;
}

export function readStreams(table: Table, field: number): ReadonlyMap<number, number> {
  const pairs = readPairs(table, field, "streams");
  requireSorted(pairs, (a, b) => a[0] < b[0], "streams");
  return new Map(pairs);
}

export function viewKey(view: { readonly id: number; readonly layer: Layer }): string {
  return `${view.id},${view.layer}`;
}

export function isViewBefore(a: View, b: View): boolean {
  return a.id !== b.id ? a.id < b.id : a.layer < b.layer;
}

export function readViewKeys(table: Table, field: number): string[] {
  const pairs = readPairs(table, field, "views");
  requireSorted(pairs, (a, b) => a[0] < b[0] || (a[0] === b[0] && a[1] < b[1]), "views");
  return pairs.map(([id, layer]) => viewKey({ id, layer: readLayer(layer) }));
}

export function readChunks(root: Table, field: number): EncodedChunk[] {
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
  const key = readKey(table.buffer, table.struct(0, kKeyBytes, "a chunk's key"));
  const payload = table.payload(4, "a chunk's payload");
  return { key, errorM, triangles, views, guessed: readGuessed(table, triangles), payload };
}

function readGuessed(table: Table, triangles: number): number[] {
  const span = table.vector(6, 4, triangles + 1, "guesses of a chunk");
  const guessed = numbers(span, 4, (at) => table.buffer.view.getUint32(at, true));
  require(guessed.length % 2 === 0, "impossible guesses");
  for (let i = 0, end = -1; i < guessed.length; i += 2) {
    const [first, count] = [guessed[i]!, guessed[i + 1]!];
    require(first > end && count > 0 && first + count <= triangles, "impossible guesses");
    end = first + count;
  }
  return guessed;
}

export function numbers(span: Span, bytes: number, read: (at: number) => number): number[] {
  const out: number[] = [];
  for (let i = 0; i < span.count; ++i) out.push(read(span.at + bytes * i));
  return out;
}

export function readTexture(table: Table): TextureUnit {
  const width = table.i32(3);
  const height = table.i32(4);
  require(table.u8(1) === 0, "an unknown texture codec");
  for (const side of [width, height])
    require(within(side, 2, kLimits.textureSide) && side % 2 === 0, "an impossible size of a texture");
  return {
    stream: table.u32(0),
    serial: table.u32(7),
    layout: table.u32(2),
    width,
    height,
    keyFrame: table.u8(5) !== 0,
    data: table.payload(6, "a texture's payload"),
  };
}

/** Planes grow when they are decoded: what all hold is bounded. */
export function readAlpha(root: Table, field: number): AlphaPlane[] {
  let pixels = 0;
  const planes = root.tables(field, kLimits.views, "alpha planes").map((table) => {
    const plane = readAlphaPlane(table);
    pixels += plane.width * plane.height;
    require(pixels <= kLimits.alphaPixels, "too large an alpha plane");
    return plane;
  });
  requireSorted(planes, (a, b) => a.stream < b.stream, "alpha planes");
  return planes;
}

function readAlphaPlane(table: Table): AlphaPlane {
  const stepPx = table.u8(1);
  const width = table.u16(2);
  const height = table.u16(3);
  require(within(stepPx, 1, kLimits.alphaStepPx) && width > 0 && height > 0, "an impossible alpha plane");
  require(Math.max(width, height) <= kLimits.textureSide, "too large an alpha plane");
  return { stream: table.u32(0), stepPx, width, height, data: table.payload(4, "an alpha plane's payload") };
}

export function readPlan(table: Table): Plan {
  const plan = {
    simplifyRatio: table.f32(0, 1),
    meshSpeed: table.i32(1, 5),
    textureScale: table.f32(2, 1),
    textureQp: table.i32(3, 28),
    simplifyErrorM: table.f32(4, 0),
  };
  require(
    within(plan.simplifyRatio, 0, 1) && within(plan.meshSpeed, 0, 10) &&
      within(plan.textureScale, 0, 16) && within(plan.textureQp, 0, 51) &&
      within(plan.simplifyErrorM, 0, 1),
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

/** Sensors' masks are for mergers; here they are only checked. */
export class Masks {
  private tiles = 0;

  check(table: Table): void {
    const tile = table.u16(0);
    const columns = table.u16(1);
    const rows = table.u16(2);
    const bits = table.vector(3, 1, kLimits.maskTiles / 8, "bits of a mask");
    if (tile === 0) {
      require(columns === 0 && rows === 0 && bits.count === 0, "a mask without tiles");
      return;
    }
    const most = Math.ceil(kLimits.textureSide / tile);
    require(within(tile, 1, kLimits.maskTilePx) && within(columns, 1, most) && within(rows, 1, most), "an impossible mask");
    this.tiles += columns * rows;
    require(this.tiles <= kLimits.maskTiles, "too many tiles");
    require(bits.count === Math.ceil((columns * rows) / 8), "a mask that is not as long as it says");
    const rest = (columns * rows) % 8;
    const last = table.buffer.bytes[bits.at + bits.count - 1]!;
    require(rest === 0 || last >> rest === 0, "bits beyond a mask's last tile");
  }
}

export function readSources(table: Table, field: number, masks: Masks): Sensor[] {
  const sources = table.tables(field, kLimits.views, "sources").map((source) => {
    requireDepthCamera(source.table(1, "a depth camera"));
    require(within(source.f64(3), 0, 1e3) && within(source.f64(4), 0, 1e3), "an impossible precision");
    for (const mask of [5, 6, 7]) if (source.has(mask)) masks.check(source.table(mask, "a mask"));
    return {
      sensor: source.u32(0),
      pose: readPose(source.buffer, source.struct(2, 96, "a sensor's pose")),
    };
  });
  requireSorted(sources, (a, b) => a.sensor < b.sensor, "sources");
  return sources;
}

export function checkConfirmed(table: Table, field: number, sources: readonly Sensor[], masks: Masks): void {
  const known = new Set(sources.map((source) => source.sensor));
  const sensors = table.tables(field, kLimits.views, "masks").map((confirmed) => {
    for (const mask of [1, 2, 3]) if (confirmed.has(mask)) masks.check(confirmed.table(mask, "a mask"));
    return confirmed.u32(0);
  });
  requireSorted(sensors, (a, b) => a < b, "masks");
  require(sensors.every((sensor) => known.has(sensor)), "a mask of a sensor that it does not name");
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

export function readViews(table: Table, field: number): View[] {
  const views = table.tables(field, kLimits.views, "views").map(readView);
  requireSorted(views, isViewBefore, "views");
  return views;
}

export function requireTilesInTextures(views: readonly View[], textures: readonly TextureUnit[]): void {
  const sizes = new Map(textures.map((unit) => [unit.stream, unit]));
  for (const view of views) {
    const unit = sizes.get(view.stream);
    require(unit === undefined || fits(view.atlasRect, unit.width, unit.height), "a view's atlas_rect outside its texture");
  }
}

function readGain(table: Table): Vec3 {
  const at = table.optionalStruct(15, 12);
  if (at === 0) return [1, 1, 1];
  const [r, g, b] = numbers({ at, count: 3 }, 4, (n) => table.buffer.view.getFloat32(n, true));
  const usable = (gain: number): boolean => within(gain, 1 / kLimits.mostGain, kLimits.mostGain);
  require(usable(r!) && usable(g!) && usable(b!), "an impossible gain");
  return [r!, g!, b!];
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
    layer: readLayer(table.u8(14)),
    gain: readGain(table),
  };
  const side = kLimits.textureSide;
  require(fits(view.atlasRect, side, side), "a view's atlas_rect outside any texture");
  require(view.id !== kNoView, "a view with the number of no view");
  require(within(view.gutterPx, 0, 1024), "an impossible gutter");
  require(fits(view.imageRect, view.width, view.height), "a view's image_rect outside its picture");
  return view;
}
