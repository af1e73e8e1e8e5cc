import { usualCamera, type Camera } from "./camera.ts";
import { Client, type Capture } from "./client.ts";
import type { LinkState } from "./connection.ts";
import { Controls, type Mode } from "./controls.ts";
import type { Readings } from "./overlay.ts";
import { burntNumber, type Picture } from "./picture.ts";
import { SceneRenderer } from "./scene_renderer.ts";
import { Median, Rate } from "./statistics.ts";

export interface ViewerOptions {
  readonly url: string;
  readonly isSoftware: boolean;
  readonly device: string;
  /** Freezes at the first complete packet. */
  readonly hold: boolean;
  /** Reads the number that is burnt into each picture drawn. */
  readonly checkPairs: boolean;
  /** A deliberate mistake for tests: the previous picture with the new mesh. */
  readonly breakPairs: boolean;
}

export interface Pair {
  readonly meshSequence: number;
  readonly textureNumber: number;
}

export interface Shown {
  readonly sequence: number;
  /** ms since 1970 */
  readonly capturedAt: number;
  readonly epoch: number;
  /** How many cameras texture it. */
  readonly views: number;
  readonly triangles: number;
  readonly chunks: number;
}

const kMostPairs = 10_000;
// Drawn by the processor, a larger picture is made smaller and stretched: motion matters more.
const kMostSoftwarePixels = 300_000;
const kHiddenForMs = 10_000;
const kFirstStepS = 1 / 60;
const kLongestStepS = 0.1;
const kLongestLatencyMs = 3_600_000;

/** Shows the newest complete capture; draws only when something changed, once per animation frame. */
export class Viewer {
  readonly client: Client;
  readonly pairs: Pair[] = [];
  private readonly controls: Controls;
  private readonly renderer: SceneRenderer;
  private state: LinkState | "held" | "broken" = "connecting";
  private shownCapture: Capture | null = null;
  private newChunks = 0;
  private fixed: Camera | null = null;
  private framed = false;
  private scheduled = false;
  private isDirty = false;
  private isMoving = false;
  private lastFrameMs = 0;
  private lastCameMs: number | null = null;
  private hiddenTimer = 0;
  private readonly captures = new Rate();
  private readonly latency = new Median();

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly options: ViewerOptions,
    private readonly say: (message: string) => void,
  ) {
    this.renderer = new SceneRenderer(canvas, !options.isSoftware);
    this.controls = new Controls(canvas, () => this.redraw());
    this.client = new Client(options.url, options.hold, {
      onHello: (hello) => {
        document.title = `${hello.scene} · MeshReduce`;
        this.controls.setUp(hello.up);
      },
      onState: (state) => this.setState(state),
      onChange: () => this.schedule(),
      onBroken: (message) => this.fail(message),
    });
    new ResizeObserver(() => this.resize()).observe(canvas);
    canvas.addEventListener("webglcontextlost", () => this.say("The graphics device was lost. Reload the page."));
    document.addEventListener("visibilitychange", () => this.visibilityChanged());
  }

  start(): void {
    this.resize();
    this.tell();
    this.client.open();
  }

  home(): void {
    const box = this.renderer.bounds();
    this.fixed = null;
    if (box !== null) this.controls.frame(box, this.renderer.width(), this.renderer.height());
  }

  switchMode(): Mode {
    this.controls.setMode(this.controls.mode === "orbit" ? "walk" : "orbit", this.renderer.bounds());
    return this.controls.mode;
  }

  currentState(): string {
    return this.state;
  }

  shown(): Shown | null {
    if (this.shownCapture === null) return null;
    const { packet } = this.shownCapture;
    return {
      sequence: packet.sequence,
      capturedAt: Number(packet.capturedAtNs) / 1e6,
      epoch: packet.epoch,
      views: packet.views.length,
      triangles: this.renderer.triangles(),
      chunks: packet.manifest.length,
    };
  }

  /** Looks from a given camera until told otherwise (null). */
  setCamera(camera: Camera | null): void {
    this.fixed = camera;
    this.redraw();
  }

  /** RGBA, top row first, of the camera that was set, else of what is on the screen. */
  pixels(): Uint8Array {
    return this.renderer.pixels(this.fixed ?? this.camera());
  }

  readings(): Readings {
    const now = performance.now();
    const mbps = (rate: Rate): string => `${((rate.perSecond(now) * 8) / 1e6).toFixed(1)} Mbit/s`;
    const latency = this.latency.value();
    const shown = this.shown();
    const errors = this.client.errors;
    return {
      "frame-rate": `${this.captures.perSecond(now).toFixed(1)} /s`,
      latency: latency === null ? "–" : `${latency.toFixed(0)} ms`,
      "mesh-rate": mbps(this.client.meshBytes),
      "texture-rate": mbps(this.client.textureBytes),
      triangles: this.renderer.triangles().toLocaleString("en"),
      chunks: shown === null ? "–" : `${shown.chunks - this.newChunks} kept, ${this.newChunks} new`,
      capture: shown === null ? "–" : `${shown.sequence}${errors > 0 ? `, ${errors} broken parts` : ""}`,
      device: this.options.device,
    };
  }

  private fail(message: string): void {
    this.client.close();
    this.state = "broken";
    this.say(message);
  }

  private setState(state: LinkState): void {
    if (this.state === "held" || this.state === "broken") return;
    this.state = state;
    this.tell();
  }

  private tell(): void {
    const host = location.host;
    const since = this.lastCameMs === null ? "" : ` since ${new Date(this.lastCameMs).toLocaleTimeString()}`;
    switch (this.state) {
      case "connecting":
        return this.say(this.lastCameMs === null ? `Connecting to ${host} …` : `Connecting to ${host} again …`);
      case "waiting":
        return this.say("Connected. Waiting for the first capture …");
      case "silent":
        return this.say(`The stream has stopped: nothing has come${since}. It goes on by itself.`);
      case "lost":
        return this.say(`The connection to ${host} is lost. Trying again …`);
      case "live":
        return this.say(this.shownCapture === null ? "Connected. Waiting for the first capture …" : "");
      case "held":
        return this.say("");
    }
  }

  private visibilityChanged(): void {
    clearTimeout(this.hiddenTimer);
    if (this.state === "held" || this.state === "broken") return;
    // Nobody looks and nothing would be acknowledged: the server need not send.
    if (document.hidden) this.hiddenTimer = window.setTimeout(() => this.pause(), kHiddenForMs);
    else if (this.state === "connecting") this.client.open();
  }

  private pause(): void {
    this.client.close();
    this.state = "connecting";
  }

  private resize(): void {
    const shown = Math.max(1, window.innerWidth * window.innerHeight);
    const ratio = this.options.isSoftware
      ? Math.min(1, Math.sqrt(kMostSoftwarePixels / shown))
      : Math.min(2, window.devicePixelRatio);
    const width = Math.max(1, Math.round(this.canvas.clientWidth * ratio));
    const height = Math.max(1, Math.round(this.canvas.clientHeight * ratio));
    if (width === this.renderer.width() && height === this.renderer.height()) return;
    this.renderer.resize(width, height);
    this.redraw();
  }

  private redraw(): void {
    this.isDirty = true;
    this.schedule();
  }

  private schedule(): void {
    if (this.scheduled) return;
    this.scheduled = true;
    requestAnimationFrame((time) => this.frame(time));
  }

  private frame(timeMs: number): void {
    this.scheduled = false;
    const seconds = this.isMoving ? Math.min(kLongestStepS, (timeMs - this.lastFrameMs) / 1000) : kFirstStepS;
    this.lastFrameMs = timeMs;
    this.isMoving = this.controls.advance(seconds);
    const { complete, done } = this.client.take();
    if (complete !== null) this.swap(complete);
    if (this.isMoving || complete !== null || this.isDirty) this.renderer.draw(this.camera());
    this.isDirty = false;
    this.client.acknowledge(done);
    if (this.isMoving) this.schedule();
    if (complete !== null) requestAnimationFrame(() => this.drawn(complete));
  }

  /** Mesh and pictures of one capture, together. */
  private swap(capture: Capture): void {
    const before = this.shownCapture;
    const { packet, meshes } = capture;
    const pictures = this.options.breakPairs && before !== null ? before.pictures : capture.pictures;
    this.renderer.show({ views: packet.views, meshes, pictures });
    this.newChunks = [...meshes].filter(([name, mesh]) => before?.meshes.get(name) !== mesh).length;
    this.shownCapture = capture;
    this.lastCameMs = Date.now();
    this.captures.add(performance.now(), 1);
    if (this.options.checkPairs) this.notePair(packet.sequence, pictures);
    if (!this.framed && this.renderer.triangles() > 0) {
      this.framed = true;
      this.home();
    }
    if (before === null) this.tell();
    if (this.options.hold) {
      this.client.close();
      this.state = "held";
      this.tell();
    }
  }

  private notePair(meshSequence: number, pictures: ReadonlyMap<number, Picture>): void {
    for (const picture of pictures.values()) this.pairs.push({ meshSequence, textureNumber: burntNumber(picture) });
    if (this.pairs.length > kMostPairs) this.pairs.splice(0, this.pairs.length - kMostPairs);
  }

  private drawn(capture: Capture): void {
    const now = this.client.serverNowMs();
    if (now === null) return;
    const latency = now - Number(capture.packet.capturedAtNs) / 1e6;
    if (Math.abs(latency) < kLongestLatencyMs) this.latency.add(latency); // recordings have other times
  }

  private camera(): Camera {
    const [width, height] = [this.renderer.width(), this.renderer.height()];
    return this.fixed === null ? this.controls.camera(width, height) : usualCamera(this.fixed, width, height);
  }
}
