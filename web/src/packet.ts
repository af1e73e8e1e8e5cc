import type { Layer } from "./layers.ts";
import type { Vec3 } from "./vec.ts";

/** A packet as values: docs/wire-format.md, schema/packet.fbs. */

export const kNoView = 0xffffffff;
export const kBackgroundSource = 0xfffffffe;

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
  readonly layer: Layer;
  readonly level: number;
  readonly version: number;
  readonly name: string;
}

/** A sensor of a head, which says nothing about times. */
export interface Sensor {
  readonly sensor: number;
  readonly pose: Pose;
}

export interface Source extends Sensor {
  readonly capturedAtNs: bigint;
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
  /** Of the chunks that it textures. */
  readonly layer: Layer;
  /** The shown sRGB value is the decoded one times this, channel by channel. */
  readonly gain: Vec3;
}

export interface EncodedChunk {
  readonly key: ChunkKey;
  readonly errorM: number;
  readonly triangles: number;
  readonly views: readonly number[];
  /** Triangles, in the stream's order, that no sensor measured: pairs of the first one and their number. */
  readonly guessed?: readonly number[];
  readonly payload: Uint8Array;
}

export interface TextureUnit {
  readonly stream: number;
  /** Counts the stream's units. */
  readonly serial: number;
  readonly layout: number;
  readonly width: number;
  readonly height: number;
  readonly keyFrame: boolean;
  readonly data: Uint8Array;
}

/** The coded alpha plane of a stream's picture, in one capture alone: where the plane is 0, what moves and is textured by the picture is
 *  not drawn. */
export interface AlphaPlane {
  readonly stream: number;
  /** Side of the square of the picture's pixels that one pixel of the plane stands for. */
  readonly stepPx: number;
  /** Of the plane. */
  readonly width: number;
  readonly height: number;
  readonly data: Uint8Array;
}

export interface Plan {
  readonly simplifyRatio: number;
  readonly meshSpeed: number;
  readonly textureScale: number;
  readonly textureQp: number;
  /** Error limit of decimating what moves; 0: none. */
  readonly simplifyErrorM: number;
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
  /** Sorted by stream; what a stream without one textures is drawn whole. */
  readonly alpha: readonly AlphaPlane[];
  /** The serial, by stream, of the unit whose picture belongs to the packet. */
  readonly streams: ReadonlyMap<number, number>;
  readonly marks: readonly { readonly stage: string; readonly atNs: bigint }[];
  readonly coalesced: number;
}
