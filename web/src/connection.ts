import type { Lattice } from "./draco_chunk.ts";
import type { Start } from "./navigation.ts";
import { subtract, type Vec3 } from "./vec.ts";

export interface Hello {
  readonly scene: string;
  readonly up: Vec3;
  readonly fps: number;
  readonly lattice: Lattice;
  /** Names of the sensors by their numbers; the first ones, where there are very many. */
  readonly sensors: readonly string[];
  /** Where the scene wants a viewer to start. */
  readonly start: Start | null;
  /** The most that the scene sends, where its rate is controlled: a viewer can ask for less. Mbit/s. */
  readonly mostMbps: number | null;
}

/** `silent`: nothing comes for now; `ended`: nothing will. `locked`: the gateway wants a token, and is not asked again before it
 *  is told to. */
export type LinkState = "connecting" | "waiting" | "live" | "silent" | "ended" | "lost" | "locked";

export interface ConnectionEvents {
  /** Whatever numbers the next packet has, it is the first. */
  onHello(hello: Hello): void;
  /** Whether the bytes were what they should be; the connection is made anew where not, as packets that
   *  nobody acknowledges would hold up the rest. */
  onBytes(bytes: Uint8Array): boolean;
  /** `reason`: what the gateway gave for closing the connection, until it says hello again; else empty. */
  onState(state: LinkState, reason: string): void;
  /** For a gateway that is locked; null where there is none. */
  token(): string | null;
  /** The gateway did not take it. */
  onTokenRefused(): void;
}

const kShortestBackoffMs = 250;
const kLongestBackoffMs = 4000;
const kPingEveryMs = 1000;
const kWatchEveryMs = 100;
const kSilentAfterMs = 1700; // and some more until it is noticed and read: 2 s
const kPolicyViolation = 1008; // the code of closing for a wrong token
const kDeadAfterPings = 5; // without any word: a network that changed tells nobody
const kPingsKept = 20;
const kMostSensors = 256;
const kLongestName = 64;
const kFarthestM = 1e8;

/** The server's clock against ours, from pings: the middle one of the quickest answers. */
export class ServerClock {
  private readonly samples: { roundTripMs: number; offsetMs: number }[] = [];

  add(sentMs: number, receivedMs: number, serverMs: number): void {
    const roundTripMs = receivedMs - sentMs;
    this.samples.push({ roundTripMs, offsetMs: serverMs - (sentMs + roundTripMs / 2) });
    if (this.samples.length > kPingsKept) this.samples.shift();
  }

  /** Of the server's clock; null before the first answer. */
  offsetMs(): number | null {
    const best = [...this.samples].sort((a, b) => a.roundTripMs - b.roundTripMs).slice(0, 5);
    const offsets = best.map((sample) => sample.offsetMs).sort((a, b) => a - b);
    return offsets[Math.floor(offsets.length / 2)] ?? null;
  }
}

/** Milliseconds since 1970. */
export function nowMs(): number {
  return performance.timeOrigin + performance.now();
}

function numbersOf(value: unknown): Vec3 | null {
  if (!Array.isArray(value) || value.length !== 3 || !value.every(Number.isFinite)) return null;
  if (value.some((number) => Math.abs(number) > kFarthestM)) return null;
  return [value[0], value[1], value[2]];
}

/** Empty where the server tells none; null where what it tells is wrong. */
function readSensors(value: unknown): readonly string[] | null {
  if (value === undefined) return [];
  if (!Array.isArray(value) || value.length > kMostSensors) return null;
  return value.every((name) => typeof name === "string" && name.length <= kLongestName) ? value : null;
}

/** Undefined where the server tells none; null where what it tells is wrong. */
function readStart(value: unknown): Start | null | undefined {
  if (value === undefined) return undefined;
  if (value === null || typeof value !== "object") return null;
  const eye = numbersOf((value as Readonly<Record<string, unknown>>)["eye"]);
  const lookAt = numbersOf((value as Readonly<Record<string, unknown>>)["look_at"]);
  return eye !== null && lookAt !== null && Math.hypot(...subtract(lookAt, eye)) > 0 ? { eye, lookAt } : null;
}

/** Undefined where the rate is not controlled; null where what the server tells is wrong. */
function readMostMbps(value: unknown): number | null | undefined {
  if (value === undefined) return undefined;
  if (value === null || typeof value !== "object") return null;
  const mbps = (value as Readonly<Record<string, unknown>>)["target_mbps"];
  return typeof mbps === "number" && mbps > 0 && Number.isFinite(mbps) ? mbps : null;
}

/** Null unless all is as docs/wire-format.md says. */
export function readHello(message: Readonly<Record<string, unknown>>): Hello | null {
  const lattice = message["lattice"] as Readonly<Record<string, unknown>> | undefined;
  const up = numbersOf(message["up"]);
  const lowCorner = numbersOf(lattice?.["low_corner"]);
  const { scene, fps } = message;
  const step = lattice?.["step"];
  if (typeof scene !== "string" || typeof fps !== "number" || typeof step !== "number") return null;
  if (up === null || lowCorner === null || !(Math.hypot(...up) > 0) || !(step > 0)) return null;
  const sensors = readSensors(message["sensors"]);
  const start = readStart(message["start"]);
  const mostMbps = readMostMbps(message["rate"]);
  if (sensors === null || start === null || mostMbps === null) return null;
  const size = Math.hypot(...up);
  return {
    scene, fps, up: [up[0] / size, up[1] / size, up[2] / size], lattice: { lowCorner, step }, sensors, start: start ?? null,
    mostMbps: mostMbps ?? null,
  };
}

/** The WebSocket to the gateway: connects again by itself, and knows when nothing comes any more. */
export class Connection {
  readonly clock = new ServerClock();
  private socket: WebSocket | null = null;
  private state: LinkState = "connecting";
  private backoffMs = kShortestBackoffMs;
  private retry = 0;
  private ticker = 0;
  private isWelcome = false; // a hello came
  private isProving = false; // a token was sent, and nothing came since
  private reason = "";
  private lastBytesMs = 0;
  private lastPingMs = 0;
  private unanswered = 0;
  private lastPing = 0;
  private readonly pings = new Map<number, number>();

  constructor(private readonly url: string, private readonly events: ConnectionEvents) {}

  open(): void {
    this.close();
    this.isWelcome = this.isProving = false;
    this.setState("connecting");
    const socket = new WebSocket(this.url);
    this.socket = socket;
    socket.binaryType = "arraybuffer";
    socket.addEventListener("open", () => this.opened());
    socket.addEventListener("message", (event: MessageEvent<ArrayBuffer | string>) => {
      if (socket === this.socket) this.received(event.data);
    });
    socket.addEventListener("close", (event) => {
      if (socket === this.socket) this.closed(event);
    });
  }

  /** For good, unless opened again. */
  close(): void {
    clearTimeout(this.retry);
    clearInterval(this.ticker);
    const socket = this.socket;
    this.socket = null;
    socket?.close();
  }

  ask(request: Uint8Array<ArrayBuffer>): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(request);
  }

  /** Not by way of JSON.stringify, which knows no numbers of 64 bits. */
  acknowledge(sequence: number | bigint): void {
    this.send(`{"type":"shown","sequence":${sequence}}`);
  }

  /** Asks for a stream of at most so much. */
  setTarget(mbps: number): void {
    if (this.isWelcome) this.send(JSON.stringify({ type: "target", mbps }));
  }

  private send(text: string): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(text);
  }

  private setState(state: LinkState): void {
    if (state === this.state) return;
    this.state = state;
    this.events.onState(state, this.reason);
  }

  /** The gateway has the first word: where it is locked, ours must be the token. */
  private opened(): void {
    this.unanswered = 0;
    this.lastPingMs = performance.now();
    this.ticker = window.setInterval(() => this.watch(), kWatchEveryMs);
  }

  private welcome(hello: Hello): void {
    if (!this.isWelcome) {
      this.isWelcome = true;
      this.isProving = false;
      this.reason = "";
      this.lastBytesMs = performance.now();
      this.setState("waiting");
      this.ping();
    }
    this.events.onHello(hello);
  }

  /** Without a token there is nothing to wait for: the connection is made anew once there is one. */
  private prove(): void {
    if (this.isWelcome || this.isProving) return;
    const token = this.events.token();
    if (token === null) {
      this.lock("");
      return;
    }
    this.isProving = true;
    this.send(JSON.stringify({ type: "token", token }));
  }

  private lock(reason: string): void {
    this.close();
    this.reason = reason;
    this.setState("locked");
  }

  private closed({ code, reason }: CloseEvent): void {
    if (this.isProving && code === kPolicyViolation) {
      this.events.onTokenRefused();
      this.lock(reason);
      return;
    }
    this.reason = reason;
    this.lost();
  }

  private lost(): void {
    this.close();
    this.setState("lost");
    this.retry = window.setTimeout(() => this.open(), this.backoffMs);
    this.backoffMs = Math.min(2 * this.backoffMs, kLongestBackoffMs);
  }

  private watch(): void {
    const now = performance.now();
    if (now - this.lastPingMs >= kPingEveryMs) {
      this.lastPingMs = now;
      if (this.unanswered++ >= kDeadAfterPings) {
        this.lost();
        return;
      }
      if (this.isWelcome) this.ping();
    }
    if (this.isWelcome && this.state !== "ended" && now - this.lastBytesMs > kSilentAfterMs) this.setState("silent");
  }

  private ping(): void {
    this.pings.set(++this.lastPing, nowMs());
    this.pings.delete(this.lastPing - kPingsKept);
    this.send(JSON.stringify({ type: "ping", id: this.lastPing }));
  }

  private received(data: ArrayBuffer | string): void {
    this.unanswered = 0;
    if (typeof data === "string") {
      this.receivedText(data);
      return;
    }
    this.lastBytesMs = performance.now();
    this.setState("live");
    if (this.events.onBytes(new Uint8Array(data))) this.backoffMs = kShortestBackoffMs;
    else this.lost();
  }

  private receivedText(text: string): void {
    let message: Readonly<Record<string, unknown>> | null = null;
    try {
      message = JSON.parse(text);
    } catch {
      return; // not ours
    }
    if (message === null || typeof message !== "object") return;
    if (message["type"] === "hello") {
      const hello = readHello(message);
      if (hello !== null) this.welcome(hello);
    } else if (message["type"] === "locked") {
      this.prove();
    } else if (message["type"] === "stopped") {
      this.setState(message["ended"] === true ? "ended" : "silent");
    } else if (message["type"] === "error") {
      console.warn(`the gateway: ${String(message["message"])}`);
    } else if (message["type"] === "pong") {
      const { id, server_ms: serverMs } = message;
      const sent = typeof id === "number" ? this.pings.get(id) : undefined;
      if (sent === undefined || typeof serverMs !== "number") return;
      this.pings.delete(Number(id));
      this.clock.add(sent, nowMs(), serverMs);
    }
  }
}
