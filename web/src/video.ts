import { copyPicture, type Picture } from "./picture.ts";
import type { UnitWork } from "./receiver.ts";

export interface VideoEvents {
  onPicture(ticket: number, picture: Picture): void;
  /** The stream needs a key frame; all that was given to it before is lost. */
  onFailed(stream: number, message: string): void;
}

const kSps = 7;

/** "avc1.PPCCLL" of an Annex B access unit; null where it holds no sequence parameters. */
export function codecOf(unit: Uint8Array): string | null {
  for (let i = 0; i + 6 < unit.length; ++i) {
    if (unit[i] !== 0 || unit[i + 1] !== 0 || unit[i + 2] !== 1 || (unit[i + 3]! & 31) !== kSps) continue;
    const bytes = [...unit.subarray(i + 4, i + 7)];
    return `avc1.${bytes.map((byte) => byte.toString(16).padStart(2, "0")).join("")}`;
  }
  return null;
}

/** Decodes one texture stream; pictures come back under the ticket of their access unit. */
class VideoStream {
  private decoder: VideoDecoder | null = null;
  private codec = "";
  private readonly sizes = new Map<number, { width: number; height: number }>();

  constructor(private readonly stream: number, private readonly events: VideoEvents) {}

  decode({ ticket, unit }: UnitWork): void {
    try {
      if (unit.keyFrame) this.configure(codecOf(unit.data));
      if (this.decoder === null) return;
      this.sizes.set(ticket, { width: unit.width, height: unit.height });
      this.decoder.decode(
        new EncodedVideoChunk({ type: unit.keyFrame ? "key" : "delta", timestamp: ticket, data: unit.data }),
      );
    } catch (error) {
      this.fail(error);
    }
  }

  /** Brings out what the decoder still holds; only a key frame may follow. */
  flush(): void {
    this.decoder?.flush().catch((error: unknown) => this.fail(error));
  }

  close(): void {
    if (this.decoder !== null && this.decoder.state !== "closed") this.decoder.close();
    this.decoder = null;
    this.codec = "";
    this.sizes.clear();
  }

  private configure(codec: string | null): void {
    if (codec === null) throw new Error("a key frame without sequence parameters");
    if (this.decoder !== null && codec === this.codec) return;
    this.close();
    this.codec = codec;
    const decoder = new VideoDecoder({
      output: (frame) => void this.take(decoder, frame),
      error: (error) => {
        if (decoder === this.decoder) this.fail(error);
      },
    });
    this.decoder = decoder;
    decoder.configure({
      codec,
      optimizeForLatency: true,
      colorSpace: { primaries: "bt709", transfer: "bt709", matrix: "bt709", fullRange: false },
    });
  }

  private async take(decoder: VideoDecoder, frame: VideoFrame): Promise<void> {
    const promised = this.sizes.get(frame.timestamp);
    this.sizes.delete(frame.timestamp);
    const ticket = frame.timestamp;
    try {
      const picture = await copyPicture(frame);
      if (decoder !== this.decoder || promised === undefined) return;
      if (picture.width !== promised.width || picture.height !== promised.height)
        throw new Error("the picture's size is not as promised");
      this.events.onPicture(ticket, picture);
    } catch (error) {
      if (decoder === this.decoder) this.fail(error);
    } finally {
      frame.close();
    }
  }

  private fail(error: unknown): void {
    this.close();
    this.events.onFailed(this.stream, error instanceof Error ? error.message : String(error));
  }
}

/** All texture streams. */
export class Video {
  private readonly streams = new Map<number, VideoStream>();

  constructor(private readonly events: VideoEvents) {}

  decode(work: readonly UnitWork[]): void {
    for (const item of work) {
      const id = item.unit.stream;
      const stream = this.streams.get(id) ?? new VideoStream(id, this.events);
      this.streams.set(id, stream);
      stream.decode(item);
    }
  }

  flush(): void {
    for (const stream of this.streams.values()) stream.flush();
  }

  /** Ends the streams that nothing uses any more. */
  keepOnly(used: ReadonlySet<number>): void {
    for (const [id, stream] of this.streams)
      if (!used.has(id)) {
        stream.close();
        this.streams.delete(id);
      }
  }
}
