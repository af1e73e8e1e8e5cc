import { usualFocal } from "./camera.ts";
import type { Navigation } from "./navigation.ts";
import { clamp, type Vec3 } from "./vec.ts";

export type Mode = "orbit" | "walk";

const kWalkMps = 1.4;
const kRunFactor = 4;
const kTurnRadPerS = 1.5;
const kStickPx = 60; // full speed
const kStickSide = 0.4; // of the picture's width
const kWheelStep = 1.15;
const kWheelWalkM = 0.3;
const kSamePlacePx = 6; // wheel: the point that is zoomed to stays while the pointer does
const kSameWheelMs = 400;

interface Finger {
  x: number;
  y: number;
  readonly startX: number;
  readonly startY: number;
  readonly isStick: boolean;
  readonly pans: boolean;
}

/** What lies under a place of the element; CSS pixels. */
export interface Aim {
  /** Of the ray from the eye; unit length. */
  readonly direction: Vec3;
  /** Where it meets surface. */
  readonly point: Vec3 | null;
}

/** Mouse, touch and keyboard. Orbit: drag turns around what is under the pointer, right button or two fingers move, wheel or pinch
 *  goes nearer to it. Walk: drag looks around, WASD or the left thumb walks. */
export class Controls {
  mode: Mode = "orbit";
  /** Whether somebody has moved by now. */
  touched = false;
  private pivot: Vec3 = [0, 0, 0];
  private lastWheel = { x: 0, y: 0, at: -Infinity };
  private readonly keys = new Set<string>();
  private readonly fingers = new Map<number, Finger>();

  /** `onChange`: the camera moved, or keys are held that will move it. */
  constructor(
    private readonly element: HTMLElement,
    private readonly navigation: Navigation,
    private readonly aim: (x: number, y: number) => Aim,
    private readonly onChange: () => void,
  ) {
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

  setMode(mode: Mode): void {
    this.mode = mode;
    this.keys.clear();
    this.onChange();
  }

  /** Moves by the keys and thumbs that are held; whether any is. */
  advance(seconds: number): boolean {
    const held = (...names: string[]): number => (names.some((name) => this.keys.has(name)) ? 1 : 0);
    const isWalk = this.mode === "walk" ? 1 : 0; // arrows walk, or turn around the point
    let right = held("KeyD") - held("KeyA") + isWalk * (held("ArrowRight") - held("ArrowLeft"));
    let ahead = held("KeyW") - held("KeyS") + isWalk * (held("ArrowUp") - held("ArrowDown"));
    const rise = held("KeyE") - held("KeyQ");
    for (const finger of this.fingers.values())
      if (finger.isStick) {
        right += clamp((finger.x - finger.startX) / kStickPx, -1, 1);
        ahead += clamp((finger.startY - finger.y) / kStickPx, -1, 1);
      }
    const isWalking = right !== 0 || ahead !== 0 || rise !== 0;
    const pace = kWalkMps * (held("ShiftLeft", "ShiftRight") ? kRunFactor : 1) * seconds;
    if (isWalking) this.navigation.walk(right * pace, ahead * pace, rise * pace);
    const around = (1 - isWalk) * (held("ArrowRight") - held("ArrowLeft"));
    const over = (1 - isWalk) * (held("ArrowUp") - held("ArrowDown"));
    if (around !== 0 || over !== 0) this.turnByKeys(around * kTurnRadPerS * seconds, -over * kTurnRadPerS * seconds);
    return isWalking || around !== 0 || over !== 0;
  }

  /** Around what is in the middle of the picture. */
  private turnByKeys(yaw: number, pitch: number): void {
    const middle = this.navigation.pointAtPivot(this.navigation.pose().forward);
    this.navigation.orbit(middle, yaw, pitch);
  }

  /** Takes what is there as pivot; nothing there leaves it as deep as the last one. */
  private takePivot(x: number, y: number): void {
    const { direction, point } = this.aim(x, y);
    this.pivot = point ?? this.navigation.pointAtPivot(direction);
    this.navigation.setPivot(this.pivot);
  }

  private press(event: PointerEvent): void {
    this.element.setPointerCapture(event.pointerId);
    this.touched = true;
    const { clientX: x, clientY: y } = event;
    const isStick = this.mode === "walk" && event.pointerType === "touch" && x < kStickSide * this.element.clientWidth;
    const pans = event.button !== 0 || event.ctrlKey || event.metaKey;
    this.fingers.set(event.pointerId, { x, y, startX: x, startY: y, isStick, pans });
    const fingers = [...this.fingers.values()];
    const middle = (of: (finger: Finger) => number): number => fingers.reduce((sum, f) => sum + of(f), 0) / fingers.length;
    if (this.mode === "orbit") this.takePivot(middle((f) => f.x), middle((f) => f.y));
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
    const { clientWidth: width, clientHeight: height } = this.element;
    const angle = Math.PI / Math.min(width, height);
    if (this.mode === "walk") {
      if (!finger.isStick) this.navigation.turn(0.5 * dx * angle, 0.5 * dy * angle);
    } else if (before !== null && after !== null) {
      this.navigation.pan(dx / 2, dy / 2, usualFocal(width, height));
      this.navigation.zoom(this.pivot, before / after);
    } else if (finger.pans) {
      this.navigation.pan(dx, dy, usualFocal(width, height));
    } else {
      this.navigation.orbit(this.pivot, -dx * angle, -dy * angle);
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
    this.touched = true;
    const lines = event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? event.deltaY / 100 : event.deltaY / 3;
    if (this.mode === "orbit") this.wheelZoom(event, kWheelStep ** lines);
    else this.navigation.advance(-kWheelWalkM * lines);
    this.onChange();
  }

  private wheelZoom({ clientX: x, clientY: y, timeStamp: at }: WheelEvent, factor: number): void {
    const moved = Math.hypot(x - this.lastWheel.x, y - this.lastWheel.y);
    if (moved > kSamePlacePx || at - this.lastWheel.at > kSameWheelMs) this.takePivot(x, y);
    this.lastWheel = { x, y, at };
    this.navigation.zoom(this.pivot, factor);
  }

  private key(event: KeyboardEvent, isDown: boolean): void {
    if (!isDown) {
      this.keys.delete(event.code);
      if (event.key === "Meta") this.keys.clear(); // macOS tells of no key that is released while it is held
      return;
    }
    if (event.ctrlKey || event.altKey || event.metaKey || isInPanel(event.target) || isTyping(event.target)) return;
    if (/^(Key[WASDQE]|Arrow\w+|Shift\w+)$/.test(event.code)) {
      this.keys.add(event.code);
      if (!event.code.startsWith("Shift")) this.touched = true;
      if (event.code.startsWith("Arrow")) event.preventDefault();
      this.onChange();
    }
  }
}

/** Keys that scroll an open panel are the panel's. */
export function isInPanel(target: EventTarget | null): boolean {
  return target instanceof Element && target.closest("#panels") !== null;
}

/** Keys in a field are letters of what is written there. */
export function isTyping(target: EventTarget | null): boolean {
  return target instanceof HTMLInputElement;
}
