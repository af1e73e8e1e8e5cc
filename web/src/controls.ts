import { distanceToSeeAll, lookAlong, usualCamera, usualFocal, type Camera, type Pose } from "./camera.ts";
import type { Box } from "./draco_chunk.ts";
import { add, anyHorizontal, cross, length, scale, subtract, type Vec3 } from "./vec.ts";

export type Mode = "orbit" | "walk";

const kSteepest = (89 * Math.PI) / 180;
const kEyeHeightM = 1.6;
const kWalkMps = 1.4;
const kRunFactor = 4;
const kTurnRadPerS = 1.5;
const kNearestM = 0.1;
const kFarthestM = 5000;
const kStickPx = 60; // full speed
const kStickSide = 0.4; // of the picture's width

interface Finger {
  x: number;
  y: number;
  readonly startX: number;
  readonly startY: number;
  readonly isStick: boolean;
  readonly pans: boolean;
}

/** Mouse, touch and keyboard. Orbit: drag turns around a point, right button or two fingers move it, wheel
 *  or pinch goes nearer. Walk: drag looks around, WASD or the left thumb walks. Any direction may be up. */
export class Controls {
  mode: Mode = "orbit";
  private up: Vec3 = [0, 0, 1];
  private ahead: Vec3 = [1, 0, 0];
  private side: Vec3 = [0, 1, 0];
  private position: Vec3 = [0, 0, 0];
  private yaw = 0;
  private pitch = 0;
  private distance = 3; // to what orbiting turns around
  private readonly keys = new Set<string>();
  private readonly fingers = new Map<number, Finger>();

  /** `onChange`: the camera moved, or keys are held that will move it. */
  constructor(private readonly element: HTMLElement, private readonly onChange: () => void) {
    element.addEventListener("pointerdown", (event) => this.press(event));
    element.addEventListener("pointermove", (event) => this.drag(event));
    for (const kind of ["pointerup", "pointercancel"] as const)
      element.addEventListener(kind, (event) => this.release(event));
    element.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    element.addEventListener("contextmenu", (event) => event.preventDefault());
    window.addEventListener("keydown", (event) => this.key(event, true));
    window.addEventListener("keyup", (event) => this.key(event, false));
    window.addEventListener("blur", () => this.keys.clear());
  }

  setUp(up: Vec3): void {
    this.up = up;
    this.ahead = anyHorizontal(up);
    this.side = cross(up, this.ahead);
  }

  /** `box`: of the scene; who starts to walk outside it is set down in its middle. */
  setMode(mode: Mode, box: Box | null): void {
    this.mode = mode;
    this.keys.clear();
    if (mode === "walk" && box !== null && !this.isInside(box)) this.setDown(box);
    this.onChange();
  }

  pose(): Pose {
    return lookAlong(this.position, this.forward(), this.up);
  }

  camera(width: number, height: number): Camera {
    return usualCamera(this.pose(), width, height);
  }

  /** Looks at the whole box from above one of its sides. */
  frame({ low, high }: Box, width: number, height: number): void {
    this.yaw = (-3 * Math.PI) / 4;
    this.pitch = -Math.atan(0.7);
    const middle = scale(add(low, high), 0.5);
    this.distance = distanceToSeeAll(low, high, this.pose(), this.camera(width, height));
    this.position = subtract(middle, scale(this.forward(), this.distance));
    this.onChange();
  }

  /** Moves by the keys and thumbs that are held; whether any is. */
  advance(seconds: number): boolean {
    const held = (...names: string[]): number => (names.some((name) => this.keys.has(name)) ? 1 : 0);
    const turn = this.mode === "orbit" ? 0 : 1; // arrows walk, or turn around the point
    let right = held("KeyD") - held("KeyA") + turn * (held("ArrowRight") - held("ArrowLeft"));
    let forward = held("KeyW") - held("KeyS") + turn * (held("ArrowUp") - held("ArrowDown"));
    const rise = held("KeyE") - held("KeyQ");
    for (const finger of this.fingers.values())
      if (finger.isStick) {
        right += Math.max(-1, Math.min(1, (finger.x - finger.startX) / kStickPx));
        forward += Math.max(-1, Math.min(1, (finger.startY - finger.y) / kStickPx));
      }
    const { right: sideways } = this.pose();
    const level = cross(this.up, sideways);
    const pace = kWalkMps * (held("ShiftLeft", "ShiftRight") ? kRunFactor : 1) * seconds;
    const step = add(add(scale(sideways, right), scale(level, forward)), scale(this.up, rise));
    this.position = add(this.position, scale(step, pace));
    const around = (1 - turn) * (held("ArrowRight") - held("ArrowLeft"));
    const over = (1 - turn) * (held("ArrowUp") - held("ArrowDown"));
    if (around !== 0 || over !== 0) this.orbit(around * kTurnRadPerS * seconds, -over * kTurnRadPerS * seconds);
    return length(step) > 0 || around !== 0 || over !== 0;
  }

  private isInside({ low, high }: Box): boolean {
    return this.position.every((v, i) => v > low[i]! && v < high[i]!);
  }

  private setDown({ low, high }: Box): void {
    const middle = scale(add(low, high), 0.5);
    // The box reaches this far below its middle.
    const depth = 0.5 * this.up.reduce((sum, v, i) => sum + Math.abs(v) * (high[i]! - low[i]!), 0);
    this.position = add(middle, scale(this.up, kEyeHeightM - depth));
    this.pitch = 0;
  }

  private forward(): Vec3 {
    const level = add(scale(this.ahead, Math.cos(this.yaw)), scale(this.side, Math.sin(this.yaw)));
    return add(scale(level, Math.cos(this.pitch)), scale(this.up, Math.sin(this.pitch)));
  }

  private turn(yaw: number, pitch: number): void {
    this.yaw += yaw;
    this.pitch = Math.max(-kSteepest, Math.min(kSteepest, this.pitch + pitch));
  }

  private orbit(yaw: number, pitch: number): void {
    const target = add(this.position, scale(this.forward(), this.distance));
    this.turn(yaw, pitch);
    this.position = subtract(target, scale(this.forward(), this.distance));
  }

  private pan(dx: number, dy: number): void {
    const { right, down } = this.pose();
    const metres = this.distance / usualFocal(this.element.clientWidth, this.element.clientHeight);
    this.position = subtract(this.position, add(scale(right, dx * metres), scale(down, dy * metres)));
  }

  private zoom(factor: number): void {
    const distance = Math.max(kNearestM, Math.min(kFarthestM, this.distance * factor));
    const target = add(this.position, scale(this.forward(), this.distance));
    this.position = subtract(target, scale(this.forward(), distance));
    this.distance = distance;
  }

  private press(event: PointerEvent): void {
    this.element.setPointerCapture(event.pointerId);
    const { clientX: x, clientY: y } = event;
    const isStick = this.mode === "walk" && event.pointerType === "touch" && x < kStickSide * this.element.clientWidth;
    const pans = event.button !== 0 || event.ctrlKey || event.metaKey;
    this.fingers.set(event.pointerId, { x, y, startX: x, startY: y, isStick, pans });
  }

  private release(event: PointerEvent): void {
    this.fingers.delete(event.pointerId);
  }

  private drag(event: PointerEvent): void {
    const finger = this.fingers.get(event.pointerId);
    if (finger === undefined) return;
    const before = this.spread();
    const [dx, dy] = [event.clientX - finger.x, event.clientY - finger.y];
    [finger.x, finger.y] = [event.clientX, event.clientY];
    const after = this.spread();
    const angle = Math.PI / Math.min(this.element.clientWidth, this.element.clientHeight);
    if (this.mode === "walk") {
      if (!finger.isStick) this.turn(0.5 * dx * angle, 0.5 * dy * angle);
    } else if (before !== null && after !== null) {
      this.pan(dx / 2, dy / 2);
      this.zoom(before / after);
    } else if (finger.pans) {
      this.pan(dx, dy);
    } else {
      this.orbit(-dx * angle, -dy * angle);
    }
    this.onChange();
  }

  /** Between two fingers; null unless there are two. */
  private spread(): number | null {
    const [a, b, ...more] = this.fingers.values();
    if (a === undefined || b === undefined || more.length > 0) return null;
    return Math.max(1, Math.hypot(a.x - b.x, a.y - b.y));
  }

  private wheel(event: WheelEvent): void {
    event.preventDefault();
    const lines = event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? event.deltaY / 100 : event.deltaY / 3;
    if (this.mode === "orbit") this.zoom(1.15 ** lines);
    else this.position = subtract(this.position, scale(this.forward(), 0.3 * lines));
    this.onChange();
  }

  private key(event: KeyboardEvent, isDown: boolean): void {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (!isDown) this.keys.delete(event.code);
    else if (/^(Key[WASDQE]|Arrow\w+|Shift\w+)$/.test(event.code)) {
      this.keys.add(event.code);
      if (event.code.startsWith("Arrow")) event.preventDefault();
      this.onChange();
    }
  }
}
