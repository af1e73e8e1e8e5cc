import type { DracoAttribute, DracoDecoder, DracoMesh, DracoModule } from "draco3d/draco_decoder_nodejs.js";
import { require } from "./bytes.ts";

/** Where vertices may lie; `hello` tells it. */
export interface Lattice {
  readonly lowCorner: readonly [number, number, number];
  readonly step: number;
}

export interface Box {
  readonly low: readonly [number, number, number];
  readonly high: readonly [number, number, number];
}

export interface ChunkToDecode {
  readonly payload: Uint8Array;
  readonly triangles: number;
  readonly views: readonly number[];
  /** As in EncodedChunk. */
  readonly guessed?: readonly number[] | undefined;
  readonly background: boolean;
  readonly lattice: Lattice;
}

/** A chunk as the graphics card takes it. Vertices are doubled where labels meet. */
export interface ChunkMesh {
  readonly box: Box;
  /** Views that texture it. */
  readonly viewIds: readonly number[];
  readonly positions: Float32Array<ArrayBuffer>;
  readonly indices: Uint16Array<ArrayBuffer> | Uint32Array<ArrayBuffer>;
  /** View of each vertex, the same at the corners of a triangle; none for a background. */
  readonly views: Uint16Array<ArrayBuffer> | null;
  /** Of a background. */
  readonly colors: Uint8Array<ArrayBuffer> | null;
  /** [9 G] Corners of the triangles that no sensor measured; null: there are none. */
  readonly guessed: Float32Array<ArrayBuffer> | null;
}

/** Views with a number below this can be drawn; the number is the index of a sensor in the scene. */
export const kMostViews = 4096;
export const kUnseen = 0xffff;

const kNoLabel = 255;
const kCells = 1 << 20;
const kStart = [0x44, 0x52, 0x41, 0x43, 0x4f, 2, 2, 1, 1, 0, 0];

/** What a stream says about itself before anything is allocated for it: Draco 2.2, Edgebreaker, no metadata. */
function requireHeader({ payload, triangles }: ChunkToDecode): void {
  require(payload.length >= kStart.length + 4, "a chunk cut off");
  require(kStart.every((byte, i) => payload[i] === byte), "not an Edgebreaker stream of version 2.2");
  let at = kStart.length + 1; // one byte names the traversal
  const varint = (): number => {
    let value = 0;
    for (let shift = 0; shift < 35; shift += 7) {
      const byte = payload[at++];
      require(byte !== undefined, "a chunk cut off");
      value += (byte & 127) * 2 ** shift;
      if (byte < 128) return value;
    }
    require(false, "a number without end");
  };
  const vertices = varint();
  const faces = varint();
  const seams = payload[at];
  require(
    faces === triangles && faces > 0 && vertices <= 3 * faces && seams !== undefined && seams <= 1,
    "a chunk whose size is not as promised",
  );
}

/** Room in Draco's memory for one array, copied out and freed. */
function copyOut(draco: DracoModule, bytes: number, fill: (at: number) => boolean): ArrayBuffer {
  const at = draco._malloc(bytes);
  require(at !== 0, "no room for a chunk");
  try {
    require(fill(at), "a chunk without values");
    return draco.HEAPU8.slice(at, at + bytes).buffer;
  } finally {
    draco._free(at);
  }
}

/** Decodes and checks one chunk. Throws Malformed for bytes that are none, anything for what Draco's own
 *  code does not survive: the module must then be made anew. */
export function decodeChunk(draco: DracoModule, chunk: ChunkToDecode): ChunkMesh {
  requireHeader(chunk);
  const decoder = new draco.Decoder();
  const mesh = new draco.Mesh();
  try {
    const bytes = new Int8Array(chunk.payload.buffer, chunk.payload.byteOffset, chunk.payload.byteLength);
    const status = decoder.DecodeArrayToMesh(bytes, bytes.length, mesh);
    require(status.ok(), `Draco refuses: ${status.error_msg()}`);
    return readMesh(draco, decoder, mesh, chunk);
  } finally {
    draco.destroy(mesh);
    draco.destroy(decoder);
  }
}

function readMesh(draco: DracoModule, decoder: DracoDecoder, mesh: DracoMesh, chunk: ChunkToDecode): ChunkMesh {
  const faces = mesh.num_faces();
  const points = mesh.num_points();
  require(faces === chunk.triangles && points <= 3 * faces, "a chunk whose size is not as promised");
  const is = (a: DracoAttribute, kind: number, type: number, components: number): boolean =>
    a.attribute_type() === kind && a.data_type() === type && a.num_components() === components;
  const values = (a: DracoAttribute, type: number, bytes: number): ArrayBuffer =>
    copyOut(draco, bytes, (at) => decoder.GetAttributeDataArrayForAllPoints(mesh, a, type, bytes, at));

  const count = mesh.num_attributes();
  require(count === 1 || count === 2, "a chunk with attributes that it may not have");
  const position = decoder.GetAttribute(mesh, 0);
  require(is(position, draco.POSITION, draco.DT_FLOAT32, 3), "a chunk without positions");
  const second = count === 2 ? decoder.GetAttribute(mesh, 1) : null;

  const positions = new Float32Array(values(position, draco.DT_FLOAT32, 12 * points));
  const corners = new Uint32Array(
    copyOut(draco, 12 * faces, (at) => decoder.GetTrianglesUInt32Array(mesh, 12 * faces, at)),
  );
  require(corners.every((point) => point < points), "a triangle names a point that is not there");
  const indices = points <= 0xffff ? Uint16Array.from(corners) : corners;
  const guessed = cornersOf(positions, corners, chunk.guessed ?? []);
  const common = { positions, box: boxOnLattice(positions, chunk.lattice), viewIds: chunk.views, guessed };

  if (chunk.background) {
    require(second !== null && is(second, draco.COLOR, draco.DT_UINT8, 3), "a background without colours");
    const colors = new Uint8Array(values(second, draco.DT_UINT8, 3 * points));
    return { ...common, indices, views: null, colors };
  }
  if (second === null) {
    require(chunk.views.length <= 1, "labels are missing");
    const views = new Uint16Array(points).fill(drawable(chunk.views[0]));
    return { ...common, indices, views, colors: null };
  }
  require(is(second, draco.GENERIC, draco.DT_UINT8, 1), "a chunk whose labels are none");
  const labels = new Uint8Array(values(second, draco.DT_UINT8, points));
  return { ...common, indices, views: viewsOf(labels, corners, chunk.views), colors: null };
}

/** Of the triangles in some ranges: pairs of the first one and their number. */
function cornersOf(positions: Float32Array, corners: Uint32Array, ranges: readonly number[]): Float32Array<ArrayBuffer> | null {
  const out: number[] = [];
  for (let i = 0; i < ranges.length; i += 2)
    for (const point of corners.subarray(3 * ranges[i]!, 3 * (ranges[i]! + ranges[i + 1]!)))
      out.push(...positions.subarray(3 * point, 3 * point + 3));
  return out.length === 0 ? null : Float32Array.from(out);
}

/** All positions must be lattice points. */
function boxOnLattice(positions: Float32Array, { lowCorner, step }: Lattice): Box {
  const low: [number, number, number] = [Infinity, Infinity, Infinity];
  const high: [number, number, number] = [-Infinity, -Infinity, -Infinity];
  for (let axis = 0; axis < 3; ++axis)
    for (let i = axis; i < positions.length; i += 3) {
      const value = positions[i]!;
      const cell = (value - lowCorner[axis]!) / step;
      require(cell >= 0 && cell < kCells && Number.isInteger(cell), "a vertex is not on the lattice");
      low[axis] = Math.min(low[axis]!, value);
      high[axis] = Math.max(high[axis]!, value);
    }
  return { low, high };
}

function drawable(view: number | undefined): number {
  return view !== undefined && view < kMostViews ? view : kUnseen;
}

function viewsOf(labels: Uint8Array, corners: Uint32Array, views: readonly number[]): Uint16Array<ArrayBuffer> {
  for (let i = 0; i < corners.length; i += 3) {
    const label = labels[corners[i]!];
    require(
      label === labels[corners[i + 1]!] && label === labels[corners[i + 2]!],
      "the corners of a triangle have different labels",
    );
  }
  return Uint16Array.from(labels, (label) => {
    require(label < views.length || label === kNoLabel, "a label without view");
    return label === kNoLabel ? kUnseen : drawable(views[label]);
  });
}
