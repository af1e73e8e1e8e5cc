import { kChecksumBytes, writeChecksum } from "./crc32.ts";
import type { ChunkKey } from "./packet.ts";
import { kKeyBytes, kLimits } from "./packet_parts.ts";

/** What a viewer lacks. */
export interface Wanted {
  readonly chunks: readonly ChunkKey[];
  /** Streams that need a key frame. */
  readonly keyFrames: readonly number[];
  readonly wholeHead: boolean;
}

export function writeRequest({ chunks, keyFrames, wholeHead }: Wanted): Uint8Array<ArrayBuffer> {
  const asked = chunks.slice(0, kLimits.requestChunks);
  const streams = [...new Set(keyFrames)].sort((a, b) => a - b).slice(0, kLimits.requestStreams);
  const out = new Uint8Array(16 + kKeyBytes * asked.length + 4 * streams.length + kChecksumBytes);
  const view = new DataView(out.buffer);
  out.set([..."MRW3"].map((c) => c.charCodeAt(0)));
  view.setUint32(4, wholeHead ? 1 : 0, true);
  view.setUint32(8, asked.length, true);
  view.setUint32(12, streams.length, true);
  asked.forEach((key, i) => {
    const fields = [key.x, key.y, key.z, key.source, key.layer, key.level, key.version];
    fields.forEach((value, n) => view.setUint32(16 + kKeyBytes * i + 4 * n, value, true));
  });
  streams.forEach((stream, i) => view.setUint32(16 + kKeyBytes * asked.length + 4 * i, stream, true));
  writeChecksum(out);
  return out;
}
