import createDecoder, { type DracoModule } from "draco3d/draco_decoder_nodejs.js";
import wasmUrl from "draco3d/draco_decoder.wasm?url";
import { Malformed } from "./bytes.ts";
import { buffersOf, withRim, type RimmedMesh } from "./border.ts";
import { decodeChunk, type ChunkToDecode } from "./draco_chunk.ts";

export interface DecodeRequest {
  readonly id: number;
  readonly chunk: ChunkToDecode;
}

export interface DecodeAnswer {
  readonly id: number;
  readonly mesh: RimmedMesh | null;
  readonly error: string;
  /** No chunk can ever be decoded. */
  readonly isFatal: boolean;
}

const kMostMemory = 512 << 20;

const wasm = fetch(new URL(wasmUrl, import.meta.url)).then((response) => {
  if (!response.ok) throw new Error(`its WebAssembly is missing on the server (${response.status})`);
  return response.arrayBuffer();
});
let isLoaded = false;
let module: Promise<DracoModule> | null = null;

async function decode({ id, chunk }: DecodeRequest): Promise<void> {
  let answer: DecodeAnswer;
  try {
    module ??= wasm.then((wasmBinary) => createDecoder({ wasmBinary }));
    const draco = await module;
    isLoaded = true;
    answer = { id, mesh: withRim(decodeChunk(draco, chunk)), error: "", isFatal: false };
    if (draco.HEAPU8.byteLength > kMostMemory) module = null; // its memory never shrinks
  } catch (error) {
    if (!(error instanceof Malformed)) module = null;
    const message = error instanceof Error ? error.message : String(error);
    answer = { id, mesh: null, error: message, isFatal: !isLoaded };
  }
  const mesh = answer.mesh;
  const arrays = mesh === null ? [] : [mesh.positions, mesh.indices, mesh.views, mesh.colors, mesh.guessed];
  const buffers = arrays.flatMap((array) => (array === null ? [] : [array.buffer]));
  self.postMessage(answer, { transfer: mesh?.rim == null ? buffers : [...buffers, ...buffersOf(mesh.rim)] });
}

let last: Promise<void> = Promise.resolve();
self.addEventListener("message", (event: MessageEvent<DecodeRequest>) => {
  last = last.then(() => decode(event.data));
});
