import { alphaFor, type Alpha } from "./alpha.ts";
import type { RimmedMesh } from "./border.ts";
import { Malformed } from "./bytes.ts";
import { Connection, nowMs, type Hello, type LinkState } from "./connection.ts";
import { DecodePool } from "./decode_pool.ts";
import type { Lattice } from "./draco_chunk.ts";
import { kBackgroundSource, type EncodedChunk, type Packet } from "./packet.ts";
import { PacketOrder } from "./packet_order.ts";
import { HeadReader, numbersOf, openMessage, readChunksAnswer, type Message } from "./packet_reader.ts";
import type { Picture } from "./picture.ts";
import { Receiver, type Complete } from "./receiver.ts";
import { writeControl } from "./control.ts";
import { Traffic } from "./statistics.ts";
import type { TokenKeeper } from "./token.ts";
import { Video } from "./video.ts";

export interface Capture extends Complete<RimmedMesh, Picture> {
  /** By stream, of pictures that have one. */
  readonly alpha: ReadonlyMap<number, Alpha>;
}

export interface ClientEvents {
  onHello(hello: Hello): void;
  /** `reason`: what the gateway gave for closing the connection; else empty. */
  onState(state: LinkState, reason: string): void;
  /** A capture may be complete: take() should be called with the next animation frame. */
  onChange(): void;
  /** The viewer cannot go on. */
  onBroken(message: string): void;
}

const kAskEveryMs = 500;

/** From the socket to complete captures. */
export class Client {
  readonly traffic = new Traffic();
  /** Chunks, pictures, alpha planes and messages that were broken. */
  errors = 0;
  /** Packets that were out of order: sent again, or with an absurd number. */
  refused = 0;
  private readonly connection: Connection;
  private readonly video: Video;
  private readonly pool: DecodePool;
  private readonly order = new PacketOrder();
  private heads = new HeadReader();
  private receiver = new Receiver<RimmedMesh, Picture>();
  private lattice: Lattice | null = null;
  private generation = 0;
  private lastAskMs = -Infinity;
  private askTimer = 0;
  private held: Uint8Array | null = null;
  private targetMbps: number | null = null;
  private readonly arrivals = new Map<number, number>(); // of packets that are not acknowledged

  /** `hold`: takes the first packet and nothing after it. */
  constructor(
    url: string, private readonly tokens: TokenKeeper, private readonly hold: boolean, private readonly events: ClientEvents,
  ) {
    this.connection = new Connection(url, {
      onHello: (hello) => {
        this.lattice = hello.lattice;
        this.order.startAfresh();
        this.forget();
        if (this.targetMbps !== null && hello.mostMbps !== null) this.connection.setTarget(this.targetMbps);
        events.onHello(hello);
      },
      onState: (state, reason) => {
        if (state === "connecting") this.forget();
        events.onState(state, reason);
      },
      token: () => tokens.get(),
      onTokenRefused: () => tokens.forget(),
      onBytes: (bytes) => this.received(bytes),
    });
    this.video = new Video({
      onPicture: (ticket, picture) => {
        this.receiver.pictureDecoded(ticket, picture);
        events.onChange();
      },
      onFailed: (stream, message) => {
        this.complain(`stream ${stream}: ${message}`);
        this.receiver.streamFailed(stream);
        events.onChange();
      },
    });
    this.pool = new DecodePool((message) => events.onBroken(`The mesh decoder does not start: ${message}`));
  }

  open(): void {
    this.connection.open();
  }
  close(): void {
    this.connection.close();
  }

  /** Connects with a token, which a locked gateway wants. */
  unlock(token: string): void {
    this.tokens.keep(token);
    this.open();
  }

  /** Asks for a stream of at most so much, also after the connection was lost. */
  setTarget(mbps: number): void {
    this.targetMbps = mbps;
    this.connection.setTarget(mbps);
  }

  /** The newest complete capture since the last call. Acknowledge what it says is done once that is drawn. */
  take(): { complete: Capture | null; done: number[] } {
    const { complete, done } = this.receiver.take();
    this.ask();
    return { complete: complete === null ? null : { ...complete, alpha: this.decodeAlpha(complete) }, done };
  }

  acknowledge(sequences: readonly number[]): void {
    for (const sequence of sequences) {
      this.connection.acknowledge(sequence);
      this.arrivals.delete(sequence);
    }
  }

  /** When a packet came that is not acknowledged; ms of the page's clock. */
  arrivedMs(sequence: number): number {
    return this.arrivals.get(sequence) ?? performance.now();
  }

  /** The server's clock, ms since 1970; null before the first answer. */
  serverNowMs(): number | null {
    const offset = this.connection.clock.offsetMs();
    return offset === null ? null : nowMs() + offset;
  }

  /** The bytes of the packet that is held. */
  heldPacket(): Uint8Array | null {
    return this.held;
  }

  private forget(): void {
    this.heads = new HeadReader();
    this.receiver = new Receiver();
    this.held = null;
    this.startAfresh();
  }

  private startAfresh(): void {
    ++this.generation;
    this.arrivals.clear();
    this.video.keepOnly(new Set());
  }

  private complain(message: string): void {
    ++this.errors;
    console.warn(message);
  }

  private received(bytes: Uint8Array): boolean {
    this.traffic.addMessage(performance.now(), bytes.length);
    try {
      const message = openMessage(bytes);
      if (message.kind === "chunks") this.decode(this.receiver.provide(readChunksAnswer(message)));
      else if (this.hold && this.held !== null) return true;
      else if (this.isInOrder(message)) this.accept(this.heads.read(message), bytes);
      return true;
    } catch (error) {
      if (!(error instanceof Malformed)) throw error;
      this.complain(`a broken message: ${error.message}`);
      return false;
    }
  }

  /** A refused packet is acknowledged: else it would hold up the rest. */
  private isInOrder(message: Message): boolean {
    const { epoch, sequence } = numbersOf(message);
    const place = this.order.place(performance.now(), epoch, sequence);
    if (place === "afresh") this.forget();
    if (place === "afresh" || place === "next") return true;
    ++this.refused;
    this.connection.acknowledge(sequence);
    return false;
  }

  private accept(packet: Packet | null, bytes: Uint8Array): void {
    if (packet === null) {
      this.complain("a packet whose base did not come");
      this.ask();
      return;
    }
    const work = this.receiver.accept(packet);
    if (work === null) {
      this.connection.acknowledge(packet.sequence);
      return;
    }
    if (work.fresh) this.startAfresh();
    this.traffic.add(performance.now(), packet);
    this.arrivals.set(packet.sequence, performance.now());
    this.decode(work.chunks);
    this.video.keepOnly(new Set([...packet.views, ...packet.textures].map((item) => item.stream)));
    this.video.decode(work.units);
    if (this.hold) {
      this.held = bytes;
      this.video.flush();
    }
    this.events.onChange();
  }

  /** What has a broken plane is shown whole. */
  private decodeAlpha({ packet, pictures }: Complete<RimmedMesh, Picture>): ReadonlyMap<number, Alpha> {
    const out = new Map<number, Alpha>();
    for (const plane of packet.alpha) {
      const picture = pictures.get(plane.stream);
      if (picture === undefined) continue;
      try {
        out.set(plane.stream, alphaFor(plane, picture));
      } catch (error) {
        if (!(error instanceof Malformed)) throw error;
        this.complain(`stream ${plane.stream}: ${error.message}`);
      }
    }
    return out;
  }

  private decode(chunks: readonly EncodedChunk[]): void {
    const generation = this.generation;
    const lattice = this.lattice;
    for (const { key, payload, triangles, views, guessed } of chunks) {
      const done = (report: () => void): void => {
        if (generation !== this.generation) return;
        report();
        this.events.onChange();
      };
      const failed = (message: string): void =>
        done(() => {
          this.complain(`chunk ${key.name}: ${message}`);
          this.receiver.chunkFailed(key.name);
        });
      if (lattice === null) {
        failed("it came before the lattice");
        continue;
      }
      const background = key.source === kBackgroundSource;
      this.pool.decode(
        { payload, triangles, views, guessed, background, lattice },
        (mesh) => done(() => this.receiver.chunkDecoded(key.name, mesh)),
        failed,
      );
    }
  }

  /** Asks for what is missing, not too often. */
  private ask(): void {
    if (this.hold) return;
    const missing = this.receiver.missing();
    const keyFrames = this.receiver.streamsWaiting();
    const wholeHead = this.heads.lacksBase();
    if (missing.length === 0 && keyFrames.length === 0 && !wholeHead) return;
    const wait = this.lastAskMs + kAskEveryMs - performance.now();
    clearTimeout(this.askTimer);
    this.askTimer = window.setTimeout(() => this.ask(), wait > 0 ? wait : kAskEveryMs);
    if (wait > 0) return;
    this.lastAskMs = performance.now();
    this.connection.ask(writeControl({ chunks: missing, keyFrames, wholeHead }));
  }
}
