// A gateway that says what a test wants: serves the page, and packets over a WebSocket (RFC 6455) of its own.
import { createHash } from "node:crypto";
import { readFile } from "node:fs/promises";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";
import { kLattice, packetOf } from "./packets.mjs";

const kTypes = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".wasm": "application/wasm" };
const [kText, kBinary, kClose] = [1, 2, 8];

/** Neither end says anything longer than 64 kB. */
class Viewer {
  /** What it said, in order. */
  texts = [];
  #rest = Buffer.alloc(0);

  constructor(socket, onText) {
    this.socket = socket;
    socket.on("error", () => {});
    socket.on("data", (bytes) => this.#read(bytes, onText));
  }

  text(message) {
    this.#frame(kText, Buffer.from(JSON.stringify(message)));
  }
  binary(bytes) {
    this.#frame(kBinary, bytes);
  }
  close(code, reason) {
    const words = Buffer.from(reason);
    const bytes = Buffer.alloc(2 + words.length);
    bytes.writeUInt16BE(code);
    bytes.set(words, 2);
    this.#frame(kClose, bytes);
    this.socket.end();
  }

  #frame(kind, bytes) {
    if (!this.socket.writable) return;
    const head = Buffer.alloc(bytes.length > 125 ? 4 : 2);
    head[0] = 0x80 | kind;
    head[1] = Math.min(bytes.length, 126);
    if (bytes.length > 125) head.writeUInt16BE(bytes.length, 2);
    this.socket.write(Buffer.concat([head, bytes]));
  }

  #read(bytes, onText) {
    this.#rest = Buffer.concat([this.#rest, bytes]);
    for (;;) {
      if (this.#rest.length < 4) return;
      const short = this.#rest[1] & 127;
      const head = short === 126 ? 4 : 2;
      const size = short === 126 ? this.#rest.readUInt16BE(2) : short;
      if (this.#rest.length < head + 4 + size) return;
      const mask = this.#rest.subarray(head, head + 4);
      const body = Buffer.from(this.#rest.subarray(head + 4, head + 4 + size)).map((byte, i) => byte ^ mask[i % 4]);
      const kind = this.#rest[0] & 15;
      this.#rest = this.#rest.subarray(head + 4 + size);
      if (kind === kClose) this.socket.end();
      if (kind !== kText) continue;
      const message = JSON.parse(body.toString());
      this.texts.push(message);
      onText(message);
    }
  }
}

export class FakeGateway {
  /** All viewers that ever connected, and all addresses that were asked for. */
  viewers = [];
  requests = [];
  epoch = 1;
  sequence = 0;
  /** What the last packets look like; whoever is not `alive` captures nothing more. */
  sensors = [{ alive: true }, { alive: true }];
  /** What a locked one wants to hear; null: it is not locked. */
  token = null;
  refusal = "wrong token";
  /** The most that it sends, Mbit/s; null: its rate is not controlled. */
  mostMbps = null;

  static async start(folder) {
    const gateway = new FakeGateway();
    gateway.http = createServer((request, response) => gateway.#serve(folder, request, response));
    gateway.http.on("upgrade", (request, socket) => gateway.#opened(request, socket));
    await new Promise((resolve) => gateway.http.listen(0, "127.0.0.1", resolve));
    gateway.url = `http://127.0.0.1:${gateway.http.address().port}`;
    return gateway;
  }

  async stop() {
    this.pause();
    for (const { socket } of this.viewers) socket.destroy();
    this.http.closeAllConnections();
    await new Promise((resolve) => this.http.close(resolve));
  }

  /** The viewer that connected last. */
  get viewer() {
    return this.viewers.at(-1);
  }

  /** Sends packets from now on. */
  run(perSecond = 20) {
    this.pause();
    this.timer = setInterval(() => this.send(++this.sequence), 1000 / perSecond);
  }
  pause() {
    clearInterval(this.timer);
  }

  /** One packet to all who are let in. A sensor that captures nothing is named for half a second more. */
  send(sequence, epoch = this.epoch) {
    const now = Date.now();
    for (const sensor of this.sensors) if (sensor.alive) sensor.capturedAtMs = now;
    const sources = this.sensors
      .map(({ capturedAtMs }, sensor) => ({ sensor, capturedAtMs }))
      .filter(({ capturedAtMs }) => capturedAtMs !== undefined && now - capturedAtMs <= 500);
    const bytes = packetOf({ epoch, sequence, capturedAtMs: now, sources });
    for (const viewer of this.viewers) if (viewer.isIn) viewer.binary(bytes);
    return bytes;
  }

  say(message) {
    for (const viewer of this.viewers) if (viewer.isIn) viewer.text(message);
  }
  closeAll(code, reason) {
    for (const viewer of this.viewers) viewer.close(code, reason);
  }

  hello(viewer) {
    viewer.isIn = true;
    const sensors = this.sensors.map((_, i) => `cam-${i}`);
    const rate = this.mostMbps === null ? {} : { rate: { target_mbps: this.mostMbps } };
    viewer.text({ type: "hello", scene: "fake", up: [0, 0, 1], fps: 20, lattice: kLattice, sensors, ...rate });
  }

  async #serve(folder, request, response) {
    this.requests.push(request.url);
    const { pathname } = new URL(request.url, "http://here");
    const file = join(folder, normalize(pathname === "/" ? "/index.html" : pathname));
    const bytes = await readFile(file).catch(() => null);
    if (bytes === null) return response.writeHead(404).end();
    response.writeHead(200, { "content-type": kTypes[extname(file)] ?? "application/octet-stream" }).end(bytes);
  }

  #opened(request, socket) {
    this.requests.push(request.url);
    const proof = createHash("sha1").update(`${request.headers["sec-websocket-key"]}258EAFA5-E914-47DA-95CA-C5AB0DC85B11`);
    socket.write(
      "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n" +
        `Sec-WebSocket-Accept: ${proof.digest("base64")}\r\n\r\n`,
    );
    const viewer = new Viewer(socket, (message) => this.#said(viewer, message));
    this.viewers.push(viewer);
    if (this.token === null) this.hello(viewer);
    else viewer.text({ type: "locked" });
  }

  #said(viewer, message) {
    if (message.type === "ping" && viewer.isIn) viewer.text({ type: "pong", id: message.id, server_ms: Date.now() });
    if (viewer.isIn) return;
    if (message.type === "token" && message.token === this.token) this.hello(viewer);
    else viewer.close(1008, message.type === "token" ? this.refusal : "no token");
  }
}
