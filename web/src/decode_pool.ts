import type { RimmedMesh } from "./border.ts";
import type { ChunkToDecode } from "./draco_chunk.ts";
import type { DecodeAnswer, DecodeRequest } from "./draco_worker.ts";

/** Decodes chunks in a worker, in order. */
export class DecodePool {
  private readonly worker = new Worker(new URL("./draco_worker.ts", import.meta.url), { type: "module" });
  private readonly waiting = new Map<number, (answer: DecodeAnswer) => void>();
  private lastId = 0;

  constructor(onBroken: (message: string) => void) {
    this.worker.addEventListener("message", (event: MessageEvent<DecodeAnswer>) => {
      const { id, isFatal, error } = event.data;
      if (isFatal) onBroken(error);
      else this.waiting.get(id)?.(event.data);
      this.waiting.delete(id);
    });
    this.worker.addEventListener("error", (event) => onBroken(event.message));
  }

  decode(chunk: ChunkToDecode, onMesh: (mesh: RimmedMesh) => void, onError: (message: string) => void): void {
    const id = ++this.lastId;
    this.waiting.set(id, ({ mesh, error }) => (mesh === null ? onError(error) : onMesh(mesh)));
    const payload = chunk.payload.slice();
    const request: DecodeRequest = { id, chunk: { ...chunk, payload } };
    this.worker.postMessage(request, [payload.buffer]);
  }
}
