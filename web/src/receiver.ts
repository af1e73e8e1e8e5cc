import type { ChunkKey, EncodedChunk, Packet, TextureUnit, View } from "./packet.ts";

/** A picture to decode; `ticket` names it ever after. */
export interface UnitWork {
  readonly ticket: number;
  readonly unit: TextureUnit;
}

/** What a packet gives to do. `fresh`: another epoch or node, all that was decoded is void. */
export interface Work {
  readonly fresh: boolean;
  readonly chunks: readonly EncodedChunk[];
  readonly units: readonly UnitWork[];
}

/** A capture all of which is there: mesh and pictures belong together. */
export interface Complete<Mesh, Picture> {
  readonly packet: Packet;
  readonly meshes: ReadonlyMap<string, Mesh>;
  readonly pictures: ReadonlyMap<number, Picture>;
}

interface Stream {
  waiting: boolean;
  layout: number;
  serial: number;
  ticket: number;
}

interface Capture {
  readonly packet: Packet;
  /** The picture that each used stream must have; null: it cannot come any more. */
  readonly tickets: ReadonlyMap<number, number> | null;
  acknowledged: boolean;
}

const kFailed = Symbol("failed");

/** The client's end of the protocol, as src/mr/codec/receiver.h: takes packets, says what to decode, and
 *  gives a capture when all of it is there. No socket, decoder or clock inside. */
export class Receiver<Mesh, Picture> {
  private newest: Packet | null = null;
  private named = new Set<string>();
  private captures: Capture[] = [];
  private readonly decoding = new Set<string>();
  private readonly meshes = new Map<string, Mesh>();
  private readonly streams = new Map<number, Stream>();
  private readonly pictures = new Map<number, Picture | typeof kFailed>();
  private readonly outstanding = new Map<number, number>();
  private lastTicket = 0;

  /** Takes a packet; null when a newer one of the same node was taken. */
  accept(packet: Packet): Work | null {
    const last = this.newest;
    const fresh = last === null || last.scene !== packet.scene || last.node !== packet.node ||
      last.epoch !== packet.epoch;
    if (fresh) this.reset();
    else if (packet.sequence <= last.sequence) return null;
    this.newest = packet;
    this.named = new Set(packet.manifest.map((key) => key.name));
    this.forgetStreams(packet);
    const chunks = packet.chunks.filter((chunk) => this.lacks(chunk.key));
    for (const chunk of chunks) this.decoding.add(chunk.key.name);
    const units = this.takeUnits(packet);
    this.captures.push({ packet, tickets: this.ticketsOf(packet), acknowledged: false });
    return { fresh, chunks, units };
  }

  /** Which of the chunks that were asked for are to be decoded. */
  provide(chunks: readonly EncodedChunk[]): EncodedChunk[] {
    const wanted = chunks.filter((chunk) => this.named.has(chunk.key.name) && this.lacks(chunk.key));
    for (const chunk of wanted) this.decoding.add(chunk.key.name);
    return wanted;
  }

  chunkDecoded(name: string, mesh: Mesh): void {
    if (this.decoding.delete(name)) this.meshes.set(name, mesh);
  }
  /** It counts as missing again. */
  chunkFailed(name: string): void {
    this.decoding.delete(name);
  }

  pictureDecoded(ticket: number, picture: Picture): void {
    if (this.outstanding.delete(ticket)) this.pictures.set(ticket, picture);
  }
  /** The stream needs a key frame; what was on its way to the decoder is lost. */
  streamFailed(stream: number): void {
    const state = this.streams.get(stream);
    if (state !== undefined) state.waiting = true;
    for (const [ticket, of] of this.outstanding)
      if (of === stream) {
        this.outstanding.delete(ticket);
        this.pictures.set(ticket, kFailed);
      }
  }

  /** What the newest manifest names and nobody is decoding. */
  missing(): ChunkKey[] {
    return this.newest === null ? [] : this.newest.manifest.filter((key) => this.lacks(key));
  }

  /** Streams that wait for a key frame, or whose layout was lost. */
  streamsWaiting(): number[] {
    if (this.newest === null) return [];
    const waiting = [...this.streams].filter(([, stream]) => stream.waiting).map(([id]) => id);
    const lost = this.newest.views.filter((view) => !this.hasLayout(view)).map((view) => view.stream);
    return [...new Set([...waiting, ...lost])];
  }

  /** Packets that became complete or never will by what is at hand, oldest first, are let go; the newest
   *  complete one is given. `done`: sequence numbers to acknowledge. */
  take(): { complete: Complete<Mesh, Picture> | null; done: number[] } {
    const best = this.captures.findLastIndex((capture) => this.isComplete(capture));
    const chosen = this.captures[best];
    const complete = chosen === undefined ? null : this.assemble(chosen);
    const isNewest = (i: number): boolean => i === this.captures.length - 1;
    const done: number[] = [];
    const kept: Capture[] = [];
    this.captures.forEach((capture, i) => {
      const settled = this.isSettled(capture);
      if ((i <= best || settled) && !capture.acknowledged) {
        capture.acknowledged = true;
        done.push(capture.packet.sequence);
      }
      // The newest may still get what it lacks by asking.
      if (i > best && (!settled || isNewest(i))) kept.push(capture);
    });
    this.captures = kept;
    this.forgetUnused();
    return { complete, done };
  }

  private reset(): void {
    this.captures = [];
    this.decoding.clear();
    this.meshes.clear();
    this.streams.clear();
    this.outstanding.clear();
    this.pictures.clear();
  }

  private lacks(key: ChunkKey): boolean {
    return !this.meshes.has(key.name) && !this.decoding.has(key.name);
  }

  private hasLayout(view: View): boolean {
    const stream = this.streams.get(view.stream);
    return stream !== undefined && stream.layout === view.layout;
  }

  private forgetStreams(packet: Packet): void {
    const used = new Set([...packet.views, ...packet.textures].map((item) => item.stream));
    for (const stream of this.streams.keys()) if (!used.has(stream)) this.streams.delete(stream);
  }

  private takeUnits(packet: Packet): UnitWork[] {
    const work: UnitWork[] = [];
    for (const unit of packet.textures) {
      const stream = this.streams.get(unit.stream) ??
        { waiting: true, layout: unit.layout, serial: unit.serial, ticket: 0 };
      this.streams.set(unit.stream, stream);
      const follows = unit.layout === stream.layout && unit.serial === (stream.serial + 1) >>> 0;
      if (unit.keyFrame) stream.waiting = false;
      else if (!follows) stream.waiting = true;
      if (stream.waiting) continue;
      stream.layout = unit.layout;
      stream.serial = unit.serial;
      stream.ticket = ++this.lastTicket;
      this.outstanding.set(stream.ticket, unit.stream);
      work.push({ ticket: stream.ticket, unit });
    }
    // A stream whose newest unit was lost shows an older capture.
    for (const [id, serial] of packet.streams) {
      const stream = this.streams.get(id);
      if (stream !== undefined && stream.serial !== serial) stream.waiting = true;
    }
    return work;
  }

  private ticketsOf(packet: Packet): Map<number, number> | null {
    const tickets = new Map<number, number>();
    for (const view of packet.views) {
      const stream = this.streams.get(view.stream);
      if (stream === undefined || stream.waiting || stream.layout !== view.layout) return null;
      tickets.set(view.stream, stream.ticket);
    }
    return tickets;
  }

  private isComplete({ packet, tickets }: Capture): boolean {
    if (tickets === null) return false;
    for (const ticket of tickets.values()) {
      const picture = this.pictures.get(ticket);
      if (picture === undefined || picture === kFailed) return false;
    }
    return packet.manifest.every((key) => this.meshes.has(key.name));
  }

  /** Nothing that is being decoded can complete it. */
  private isSettled({ packet, tickets }: Capture): boolean {
    if (packet.manifest.some((key) => this.decoding.has(key.name))) return false;
    return tickets === null || ![...tickets.values()].some((ticket) => this.outstanding.has(ticket));
  }

  private assemble({ packet, tickets }: Capture): Complete<Mesh, Picture> {
    const meshes = new Map<string, Mesh>();
    for (const { name } of packet.manifest) meshes.set(name, this.meshes.get(name)!);
    const pictures = new Map<number, Picture>();
    for (const [stream, ticket] of tickets ?? []) {
      const picture = this.pictures.get(ticket);
      if (picture !== undefined && picture !== kFailed) pictures.set(stream, picture);
    }
    return { packet, meshes, pictures };
  }

  /** A stream's newest picture stays: a later capture may come without one. */
  private forgetUnused(): void {
    const tickets = new Set([...this.streams.values()].map((stream) => stream.ticket));
    const names = new Set(this.named);
    for (const capture of this.captures) {
      for (const ticket of capture.tickets?.values() ?? []) tickets.add(ticket);
      for (const key of capture.packet.manifest) names.add(key.name);
    }
    for (const ticket of this.pictures.keys()) if (!tickets.has(ticket)) this.pictures.delete(ticket);
    for (const name of this.meshes.keys()) if (!names.has(name)) this.meshes.delete(name);
  }
}
