import { distanceToSeeAll, lookAlong, usualCamera, type Camera, type Pose } from "./camera.ts";
import type { Box } from "./draco_chunk.ts";
import { add, anyHorizontal, clamp, cross, dot, length, scale, subtract, type Vec3 } from "./vec.ts";

/** Where to stand and where to look; metres, world. */
export interface Start {
  readonly eye: Vec3;
  readonly lookAt: Vec3;
}

export const kEyeHeightM = 1.6;
/** Zooming comes no nearer to what is under the pointer. */
export const kNearestM = 0.3;
/** Who walks gets so far out of the scene's box. */
export const kWalkMarginM = 3;
const kSteepest = (89 * Math.PI) / 180;
const kFarthestSizes = 3; // of the scene: half its diagonal
const kUsualPivotM = 3;

/** The eye: turns, moves and keeps its limits. Any direction may be up. */
export class Navigation {
  private up: Vec3 = [0, 0, 1];
  private ahead: Vec3 = [1, 0, 0];
  private side: Vec3 = [0, 1, 0];
  private position: Vec3 = [0, 0, 0];
  private yaw = 0;
  private pitch = 0;
  private box: Box | null = null;
  private pivotM = kUsualPivotM; // how far ahead the last pivot was

  setUp(up: Vec3): void {
    this.up = up;
    this.ahead = anyHorizontal(up);
    this.side = cross(up, this.ahead);
  }

  /** Around all surface. */
  setBox(box: Box): void {
    this.box = box;
  }

  pose(): Pose {
    return lookAlong(this.position, this.forward(), this.up);
  }

  camera(width: number, height: number): Camera {
    return usualCamera(this.pose(), width, height);
  }

  /** Stands at a place and looks at another. */
  stand({ eye, lookAt }: Start): void {
    const way = subtract(lookAt, eye);
    this.position = eye;
    this.pivotM = length(way);
    this.pitch = clamp(Math.asin(clamp(dot(way, this.up) / this.pivotM, -1, 1)), -kSteepest, kSteepest);
    this.yaw = Math.atan2(dot(way, this.side), dot(way, this.ahead));
  }

  /** Looks at the whole box from above one of its sides. */
  frame({ low, high }: Box, width: number, height: number): void {
    this.yaw = (-3 * Math.PI) / 4;
    this.pitch = -Math.atan(0.7);
    this.pivotM = distanceToSeeAll(low, high, this.pose(), this.camera(width, height));
    this.position = subtract(scale(add(low, high), 0.5), scale(this.forward(), this.pivotM));
  }

  isInside(): boolean {
    return this.box !== null && this.position.every((v, i) => v > this.box!.low[i]! && v < this.box!.high[i]!);
  }

  /** Looks level from the middle of the box, at eye height; stays where the box is lower than that. */
  setDown(): void {
    if (this.box === null) return;
    const { low, high } = this.box;
    // The box reaches this far below its middle.
    const depth = 0.5 * this.up.reduce((sum, v, i) => sum + Math.abs(v) * (high[i]! - low[i]!), 0);
    if (2 * depth < kEyeHeightM + kNearestM) return;
    this.position = add(scale(add(low, high), 0.5), scale(this.up, kEyeHeightM - depth));
    this.pitch = 0;
  }

  /** The point on a ray from the eye that is as deep as the last pivot. */
  pointAtPivot(direction: Vec3): Vec3 {
    const ahead = dot(direction, this.forward());
    return add(this.position, scale(direction, this.pivotM / Math.max(ahead, 0.1)));
  }

  /** What later movements are measured by. */
  setPivot(pivot: Vec3): void {
    this.pivotM = Math.max(kNearestM, dot(subtract(pivot, this.position), this.forward()));
  }

  turn(yaw: number, pitch: number): void {
    this.yaw += yaw;
    this.pitch = clamp(this.pitch + pitch, -kSteepest, kSteepest);
  }

  /** Turns around a point, which stays where it is in the picture. */
  orbit(pivot: Vec3, yaw: number, pitch: number): void {
    const before = this.pose();
    const away = subtract(this.position, pivot);
    this.turn(yaw, pitch);
    const after = this.pose();
    this.position = pivot;
    for (const axis of ["right", "down", "forward"] as const)
      this.position = add(this.position, scale(after[axis], dot(away, before[axis])));
    this.keepNear();
  }

  /** Goes to `factor` of the distance to a point, which stays where it is in the picture. */
  zoom(point: Vec3, factor: number): void {
    const away = subtract(this.position, point);
    const distance = length(away);
    const wanted = factor < 1 ? Math.max(Math.min(kNearestM, distance), distance * factor) : distance * factor;
    this.position = add(point, scale(away, wanted / Math.max(distance, 1e-6)));
    this.keepNear();
    this.setPivot(point);
  }

  /** By pixels; `focal` in pixels. What is as deep as the pivot follows the pointer. */
  pan(dx: number, dy: number, focal: number): void {
    const { right, down } = this.pose();
    const metres = this.pivotM / focal;
    this.position = subtract(this.position, add(scale(right, dx * metres), scale(down, dy * metres)));
    this.keepNear();
  }

  /** Metres to the right, level ahead and up. */
  walk(right: number, ahead: number, rise: number): void {
    const sideways = this.pose().right;
    const level = cross(this.up, sideways);
    this.position = add(add(this.position, scale(sideways, right)), add(scale(level, ahead), scale(this.up, rise)));
    this.keepAbout();
  }

  /** Metres along where the eye looks. */
  advance(metres: number): void {
    this.position = add(this.position, scale(this.forward(), metres));
    this.keepAbout();
  }

  private forward(): Vec3 {
    const level = add(scale(this.ahead, Math.cos(this.yaw)), scale(this.side, Math.sin(this.yaw)));
    return add(scale(level, Math.cos(this.pitch)), scale(this.up, Math.sin(this.pitch)));
  }

  /** Not farther than a few sizes of the scene. */
  private keepNear(): void {
    if (this.box === null) return;
    const middle = scale(add(this.box.low, this.box.high), 0.5);
    const most = kFarthestSizes * length(subtract(this.box.high, this.box.low)) / 2 + kWalkMarginM;
    const away = subtract(this.position, middle);
    if (length(away) > most) this.position = add(middle, scale(away, most / length(away)));
  }

  /** Not farther than some metres out of the box. */
  private keepAbout(): void {
    if (this.box === null) return;
    const { low, high } = this.box;
    const kept = (i: 0 | 1 | 2): number => clamp(this.position[i], low[i] - kWalkMarginM, high[i] + kWalkMarginM);
    this.position = [kept(0), kept(1), kept(2)];
  }
}
