import { rayThrough, usualCamera, type Camera, type Pose } from "./camera.ts";
import { Client, type Capture } from "./client.ts";
import type { Hello, LinkState } from "./connection.ts";
import { Controls, type Aim, type Mode } from "./controls.ts";
import { Health } from "./health.ts";
import { kMoving, kStill, layerOf, ofLayer, type Layer } from "./layers.ts";
import { Navigation, type Start } from "./navigation.ts";
import type { Readings } from "./overlay.ts";
import { pick } from "./pick.ts";
import type { Packet, Plan } from "./packet.ts";
import { burntNumber, type Picture } from "./picture.ts";
import { pixelRatio, Resolution, type Motion } from "./resolution.ts";
import { SceneRenderer } from "./scene_renderer.ts";
import { kThemes } from "./stage.ts";
import { findStart } from "./start_place.ts";
import { Median, Rate } from "./statistics.ts";
import type { TokenKeeper } from "./token.ts";

export interface ViewerOptions {
  readonly url: string;
  readonly isSoftware: boolean;
  readonly device: string;
  /** Freezes at the first complete packet. */
  readonly hold: boolean;
  /** Shows the chunks of this layer alone; null: all. */
  readonly layer: Layer | null;
  /** Tints what no sensor measured. */
  readonly showsGuesses: boolean;
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
  /** Of them, of the still surface. */
  readonly stillChunks: number;
}

/** What the viewer needs of the page around its canvas. */
export interface ViewerPage {
  say(message: string): void;
  notice(words: string): void;
  /** Asks for a token; `reason`: why the last one was refused, or empty. */
  locked(reason: string): void;
  unlocked(): void;
  /** The most that the stream takes, Mbit/s; null where its rate is not controlled. */
  rate(mostMbps: number | null): void;
}

const kWaiting = "Connected. Waiting for the first capture …";
const kMostPairs = 10_000;
const kHiddenForMs = 10_000;
const kFirstStepS = 1 / 60;
const kLongestStepS = 0.1;
const kLongestLatencyMs = 3_600_000;
const kStillAfterMs = 500;
const kStillAfterCaptures = 4; // that did not come: drawn by the processor, a still picture takes the time of several others
const kLongestCaptureMs = 1000;
const kCoarsestQp = 51;
const kHealthEveryMs = 100; // a sensor that is missing is told within two seconds
const kStartSettlesMs = 10_000; // sensors that come so soon are still counted for the place to start

function describePlan({ simplifyErrorM, textureScale, textureQp }: Plan): string {
  const error = simplifyErrorM > 0 ? `${(1000 * simplifyErrorM).toFixed(1)} mm, ` : "";
  return `${error}QP ${textureQp}, ${Math.round(100 * textureScale)} % size`;
}

/** Shows the newest complete capture; draws only when something changed, once per animation frame. */
export class Viewer {
  readonly client: Client;
  readonly pairs: Pair[] = [];
  private readonly navigation = new Navigation();
  private readonly controls: Controls;
  private readonly renderer: SceneRenderer;
  private state: LinkState | "held" | "broken" = "connecting";
  private closingReason = "";
  private asksForToken = false; // also while the gateway looks at one
  private shownCapture: Capture | null = null;
  private newChunks = 0;
  private fixed: Camera | null = null;
  private hello: Hello | null = null;
  private startPlace: Start | null = null;
  private startSources: number | null = null;
  private firstMs: number | null = null;
  private readonly resolution = new Resolution();
  private motion: Motion = "eye";
  private eyeMovedMs = 0;
  private stillTimer = 0;
  private health: Health | null = null;
  private scheduled = false;
  private isDirty = false;
  private hasMoved = false;
  private isMoving = false;
  private lastFrameMs = 0;
  private lastCameMs: number | null = null;
  private hiddenTimer = 0;
  private readonly captures = new Rate();
  private readonly latency = new Median();

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly options: ViewerOptions,
    tokens: TokenKeeper,
    private readonly page: ViewerPage,
  ) {
    this.renderer = new SceneRenderer(canvas, options.isSoftware, options.showsGuesses);
    this.controls = new Controls(canvas, this.navigation, (x, y) => this.aim(x, y), () => {
      this.hasMoved = true;
      this.schedule();
    });
    this.client = new Client(options.url, tokens, options.hold, {
      onHello: (hello) => {
        this.stopAsking();
        document.title = `${hello.scene} · MeshReduce`;
        if (this.hello?.scene !== hello.scene) {
          this.startSources = this.firstMs = null;
          this.controls.touched = false;
        }
        this.hello = hello;
        this.navigation.setUp(hello.up);
        this.renderer.setUp(hello.up);
        this.health = new Health(hello.sensors, hello.fps);
        page.rate(hello.mostMbps);
      },
      onState: (state, reason) => this.setState(state, reason),
      onChange: () => this.schedule(),
      onBroken: (message) => this.fail(message),
    });
    new ResizeObserver(() => this.resize()).observe(canvas);
    canvas.addEventListener("webglcontextlost", () => page.say("The graphics device was lost. Reload the page."));
    document.addEventListener("visibilitychange", () => this.visibilityChanged());
  }

  start(): void {
    this.resize();
    this.tell();
    this.client.open();
    window.setInterval(() => this.checkHealth(), kHealthEveryMs);
  }

  /** Connects with a token, which a locked gateway wants. */
  unlock(token: string): void {
    if (this.state !== "held" && this.state !== "broken") this.client.unlock(token);
  }

  /** Back to where the page started. */
  home(): void {
    const box = this.renderer.bounds();
    this.fixed = null;
    if (this.startPlace !== null) this.navigation.stand(this.startPlace);
    else if (box !== null) this.navigation.frame(box, this.renderer.width(), this.renderer.height());
    this.redraw();
  }

  /** Who starts to walk outside the scene is set down in it. */
  switchMode(): Mode {
    this.controls.setMode(this.controls.mode === "orbit" ? "walk" : "orbit");
    this.controls.touched = true;
    if (this.controls.mode === "walk" && !this.navigation.isInside()) {
      if (this.startPlace !== null) this.navigation.stand(this.startPlace);
      else this.navigation.setDown();
    }
    return this.controls.mode;
  }

  setTarget(mbps: number): void {
    this.client.setTarget(mbps);
  }

  setTheme(theme: keyof typeof kThemes): void {
    this.renderer.setTheme(kThemes[theme]);
    this.redraw();
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
      views: new Set(packet.views.map((view) => view.id)).size,
      triangles: this.renderer.triangles(),
      chunks: packet.manifest.length,
      stillChunks: packet.manifest.filter((key) => layerOf(key) === kStill).length,
    };
  }

  /** Looks from a given camera until told otherwise (null). */
  setCamera(camera: Camera | null): void {
    this.fixed = camera;
    this.redraw();
  }

  size(): readonly [number, number] {
    return [this.renderer.width(), this.renderer.height()];
  }

  /** Where the eye is and which way it looks. */
  pose(): Pose {
    return this.navigation.pose();
  }

  /** RGBA, top row first, of the camera that was set, else of what is on the screen. */
  pixels(): Uint8Array {
    return this.renderer.pixels(this.fixed ?? this.camera());
  }

  /** RGBA, bottom row first, of what is on the screen; `afresh`: drawn without anything that was kept. */
  screen(afresh: boolean): Uint8Array {
    return this.renderer.screen(this.camera(), afresh);
  }

  readings(): Readings {
    const now = performance.now();
    const mbps = (bytes: number): string => `${((bytes * 8) / 1e6).toFixed(bytes < 12_500 ? 3 : 1)} Mbit/s`;
    const { traffic } = this.client;
    const latency = this.latency.value();
    const shown = this.shown();
    const { errors, refused } = this.client;
    const counts = `${errors > 0 ? `, ${errors} broken parts` : ""}${refused > 0 ? `, ${refused} out of order` : ""}`;
    const plan = this.shownCapture?.packet.plan;
    return {
      received: mbps(traffic.bytes(now)),
      "frame-rate": `${this.captures.perSecond(now).toFixed(1)} /s`,
      latency: latency === null ? "–" : `${latency.toFixed(0)} ms`,
      "mesh-rate": mbps(traffic.meshBytes(kMoving, now)),
      "still-mesh-rate": mbps(traffic.meshBytes(kStill, now)),
      "texture-rate": mbps(traffic.textureBytes(kMoving, now)),
      "plate-rate": mbps(traffic.textureBytes(kStill, now)),
      triangles: this.renderer.triangles().toLocaleString("en"),
      chunks: shown === null ? "–" : `${shown.chunks - this.newChunks} kept, ${this.newChunks} new`,
      capture: shown === null ? "–" : `${shown.sequence}${counts}`,
      coding: plan === undefined ? "–" : describePlan(plan),
      device: this.options.device,
    };
  }

  private fail(message: string): void {
    this.client.close();
    this.state = "broken";
    this.stopAsking();
    this.page.say(message);
  }

  private stopAsking(): void {
    if (!this.asksForToken) return;
    this.asksForToken = false;
    this.page.unlocked();
    this.tell();
  }

  private setState(state: LinkState, reason: string): void {
    if (this.state === "held" || this.state === "broken") return;
    this.state = state;
    this.closingReason = reason;
    this.tell();
  }

  private tell(): void {
    if (this.state === "lost") this.stopAsking();
    if (this.state === "locked") {
      this.asksForToken = true;
      this.page.locked(this.closingReason);
    }
    this.page.say(this.asksForToken ? "" : this.words());
  }

  private words(): string {
    const host = location.host;
    const closed = this.closingReason === "" ? null : `The connection to ${host} was closed (${this.closingReason}). Trying again …`;
    const since = this.lastCameMs === null ? "" : ` since ${new Date(this.lastCameMs).toLocaleTimeString()}`;
    switch (this.state) {
      case "connecting":
        return closed ?? (this.lastCameMs === null ? `Connecting to ${host} …` : `Connecting to ${host} again …`);
      case "waiting":
        return kWaiting;
      case "silent":
        return `The stream has stopped: nothing has come${since}. It goes on by itself.`;
      case "ended":
        return "The recording has ended.";
      case "lost":
        return closed ?? `The connection to ${host} is lost. Trying again …`;
      case "live":
        return this.shownCapture === null ? kWaiting : "";
      default:
        return "";
    }
  }

  private visibilityChanged(): void {
    clearTimeout(this.hiddenTimer);
    if (this.state === "held" || this.state === "broken" || this.state === "locked") return;
    // Nobody looks and nothing would be acknowledged: the server need not send.
    if (document.hidden) this.hiddenTimer = window.setTimeout(() => this.pause(), kHiddenForMs);
    else if (this.state === "connecting") this.client.open();
  }

  private pause(): void {
    this.client.close();
    this.state = "connecting";
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.canvas;
    const screen = { width: clientWidth, height: clientHeight, devicePixelRatio: window.devicePixelRatio };
    const ratio = pixelRatio(screen, this.options.isSoftware, this.motion, this.resolution.scale());
    const width = Math.max(1, Math.round(clientWidth * ratio));
    const height = Math.max(1, Math.round(clientHeight * ratio));
    if (width === this.renderer.width() && height === this.renderer.height()) return;
    this.renderer.resize(width, height);
    this.redraw();
  }

  /** Something is about to be drawn: once nothing more is, it is drawn again as well as the device can. */
  private stir(): void {
    clearTimeout(this.stillTimer);
    const perSecond = this.options.isSoftware && this.state === "live" ? this.captures.perSecond(performance.now()) : 0;
    const captureMs = perSecond > 0 ? Math.min(kLongestCaptureMs, 1000 / perSecond) : 0;
    this.stillTimer = window.setTimeout(() => this.setMotion("nothing"), Math.max(kStillAfterMs, kStillAfterCaptures * captureMs));
    const now = performance.now();
    if (this.isMoving || this.hasMoved) this.eyeMovedMs = now;
    this.setMotion(now - this.eyeMovedMs < kStillAfterMs ? "eye" : "scene");
  }

  private setMotion(motion: Motion): void {
    if (motion === this.motion) return;
    this.motion = motion;
    this.resize();
  }

  private aim(x: number, y: number): Aim {
    const camera = this.navigation.camera(this.canvas.clientWidth, this.canvas.clientHeight);
    const direction = rayThrough(camera, x - 0.5, y - 0.5);
    return { direction, point: pick(this.renderer.meshes(), camera.position, direction) };
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
    const isLively = this.isMoving || this.hasMoved || complete !== null;
    if (isLively) this.stir();
    if (isLively || this.isDirty) this.renderer.draw(this.camera());
    this.isDirty = this.hasMoved = false;
    const arrivedMs = complete === null ? 0 : this.client.arrivedMs(complete.packet.sequence);
    this.client.acknowledge(done);
    if (this.isMoving) this.schedule();
    if (isLively) requestAnimationFrame((nextMs) => this.drawn(complete, nextMs - timeMs, arrivedMs));
  }

  /** Mesh and pictures of one capture, together. */
  private swap(capture: Capture): void {
    const before = this.shownCapture;
    const { packet } = capture;
    const meshes = ofLayer(capture.meshes, packet.manifest, this.options.layer);
    const layers = new Map(packet.manifest.map((key) => [key.name, layerOf(key)]));
    const { pictures, alpha } = this.options.breakPairs && before !== null ? before : capture;
    this.renderer.show({ views: packet.views, meshes, pictures, alpha, layers });
    this.newChunks = [...capture.meshes].filter(([name, mesh]) => before?.meshes.get(name) !== mesh).length;
    this.shownCapture = capture;
    this.lastCameMs = Date.now();
    this.captures.add(performance.now(), 1);
    if (this.options.checkPairs) this.notePair(packet, pictures);
    if (this.renderer.triangles() > 0) this.findPlace(packet.sources.length);
    if (before === null) this.tell();
    if (this.options.hold) {
      this.client.close();
      this.state = "held";
      this.tell();
    }
  }

  /** Plates stay for many captures, and have no number. */
  private notePair({ sequence, views }: Packet, pictures: ReadonlyMap<number, Picture>): void {
    const live = new Set(views.filter((view) => layerOf(view) === kMoving).map((view) => view.stream));
    for (const [stream, picture] of pictures)
      if (live.has(stream)) this.pairs.push({ meshSequence: sequence, textureNumber: burntNumber(picture) });
    if (this.pairs.length > kMostPairs) this.pairs.splice(0, this.pairs.length - kMostPairs);
  }

  /** Limits around what is shown, and once a place to start. While sensors still come and nobody has moved, it is looked for again. */
  private findPlace(sources: number): void {
    const box = this.renderer.bounds();
    if (box === null) return;
    this.navigation.setBox(box);
    this.firstMs ??= performance.now();
    const isSettled = this.controls.touched || performance.now() - this.firstMs > kStartSettlesMs;
    if (this.startSources !== null && (isSettled || sources <= this.startSources)) return;
    this.startSources = sources;
    this.startPlace = this.hello?.start ?? this.bestPlace();
    if (this.fixed === null) this.home();
  }

  private bestPlace(): Start | null {
    const { width, height, fx, fy } = this.navigation.camera(this.canvas.clientWidth, this.canvas.clientHeight);
    const angle = (size: number, focal: number): number => 2 * Math.atan(size / (2 * focal));
    return findStart(this.renderer.meshes(), this.hello?.up ?? [0, 0, 1], angle(width, fx), angle(height, fy));
  }

  /** `frameMs`: until the frame after. */
  private drawn(capture: Capture | null, frameMs: number, arrivedMs: number): void {
    if (!this.options.isSoftware && this.resolution.drew(frameMs)) this.resize();
    if (capture === null) return;
    const now = this.client.serverNowMs();
    const { capturedAtNs, sources, plan } = capture.packet;
    const latency = now === null ? null : now - Number(capturedAtNs) / 1e6;
    const latencyMs = latency !== null && Math.abs(latency) < kLongestLatencyMs ? latency : null; // recordings have other times
    if (latencyMs !== null) this.latency.add(latencyMs);
    const atMs = performance.now();
    this.health?.came({ atMs, capturedAtNs, sources, workMs: atMs - arrivedMs, latencyMs, isCoarsest: plan.textureQp >= kCoarsestQp });
  }

  private checkHealth(): void {
    const isLive = this.state === "live" && !document.hidden;
    this.page.notice(isLive ? (this.health?.words(performance.now()) ?? []).join(" ") : "");
  }

  private camera(): Camera {
    const [width, height] = [this.renderer.width(), this.renderer.height()];
    return this.fixed === null ? this.navigation.camera(width, height) : usualCamera(this.fixed, width, height);
  }
}
