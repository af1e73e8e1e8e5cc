import { kChecksumBytes, writeChecksum } from "./crc32.ts";
import type { ChunkKey } from "./packet.ts";
import { kLimits } from "./packet_parts.ts";

/** What a viewer lacks. */
export interface Wanted {
  readonly chunks: readonly ChunkKey[];
  /** Streams that need a key frame. */
  readonly keyFrames: readonly number[];
  readonly wholeHead: boolean;
}

const kVersion = 1;
/** Kinds of sections, in their order (docs/wire-format.md, Control and answer). */
const kKeyFrames = 1, kChunks = 2, kWholeHead = 4;
const kSectionBytes = 8;

export function writeControl({ chunks, keyFrames, wholeHead }: Wanted): Uint8Array<ArrayBuffer> {
  const keys = chunks.slice(0, kLimits.requestChunks);
  const streams = [...new Set(keyFrames)].sort((a, b) => a - b).slice(0, kLimits.requestStreams);
  const sections: { kind: number; values: number[] }[] = [];
  if (streams.length > 0) sections.push({ kind: kKeyFrames, values: streams });
  if (keys.length > 0)
    sections.push({
      kind: kChunks,
      values: keys.flatMap((k) => [k.x, k.y, k.z, k.source, k.layer, k.level, k.version]),
    });
  if (wholeHead) sections.push({ kind: kWholeHead, values: [] });

  const body = sections.reduce((sum, { values }) => sum + kSectionBytes + 4 * values.length, 0);
  const out = new Uint8Array(8 + body + kChecksumBytes);
  const view = new DataView(out.buffer);
  out.set([..."MRCT"].map((c) => c.charCodeAt(0)));
  view.setUint32(4, kVersion, true);
  let at = 8;
  for (const { kind, values } of sections)
    for (const value of [kind, 4 * values.length, ...values]) {
      view.setUint32(at, value, true);
      at += 4;
    }
  writeChecksum(out);
  return out;
}
