import { add, cross, dot, normalized, scale, subtract, type Vec3 } from "./vec.ts";

/** Where an eye is and how it looks: axes of the camera in the world, x right, y down, z forward. */
export interface Pose {
  readonly position: Vec3;
  readonly right: Vec3;
  readonly down: Vec3;
  readonly forward: Vec3;
}

/** A pinhole without distortion; pixel centres lie at integers, rows run from the top. */
export interface Camera extends Pose {
  readonly width: number;
  readonly height: number;
  readonly fx: number;
  readonly fy: number;
  readonly cx: number;
  readonly cy: number;
}

/** 60 degrees across the longer side. */
export function usualFocal(width: number, height: number): number {
  return (0.5 * Math.max(width, height)) / Math.tan(Math.PI / 6);
}

export function usualCamera(pose: Pose, width: number, height: number): Camera {
  const f = usualFocal(width, height);
  return { ...pose, width, height, fx: f, fy: f, cx: 0.5 * (width - 1), cy: 0.5 * (height - 1) };
}

export function lookAlong(position: Vec3, forward: Vec3, up: Vec3): Pose {
  const z = normalized(forward);
  const right = normalized(cross(z, up));
  return { position, right, down: cross(z, right), forward: z };
}

/** Unit vector from the eye through a pixel. */
export function rayThrough(c: Camera, u: number, v: number): Vec3 {
  const sideways = add(scale(c.right, (u - c.cx) / c.fx), scale(c.down, (v - c.cy) / c.fy));
  return normalized(add(c.forward, sideways));
}

const kNearM = 0.05;

/** From metres-from-the-eye to clip space, row-major; as clip_from_eye in src/mr/render/renderer.cpp, but
 *  with the picture's first row on top. The far plane is at infinity. */
export function clipFromEye(c: Camera): number[] {
  const row = (axis: Vec3, f: number, center: number, size: number): number[] =>
    axis.map((v, i) => (v * f + c.forward[i]! * (center + 0.5)) * (2 / size) - c.forward[i]!);
  const right = row(c.right, c.fx, c.cx, c.width);
  const up = row(c.down, c.fy, c.cy, c.height).map((v) => -v);
  return [...right, 0, ...up, 0, ...c.forward, -2 * kNearM, ...c.forward, 0];
}

/** How far an eye must go back from `middle` against `pose.forward` to see the whole box. */
export function distanceToSeeAll(low: Vec3, high: Vec3, pose: Pose, camera: Camera): number {
  const kMargin = 0.95; // of the picture
  const middle: Vec3 = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2];
  let away = 0.2;
  for (let i = 0; i < 8; ++i) {
    const corner: Vec3 = [(i & 1 ? high : low)[0], (i & 2 ? high : low)[1], (i & 4 ? high : low)[2]];
    const p = subtract(corner, middle);
    const x = Math.abs(dot(p, pose.right)) * camera.fx / (0.5 * kMargin * camera.width);
    const y = Math.abs(dot(p, pose.down)) * camera.fy / (0.5 * kMargin * camera.height);
    away = Math.max(away, x - dot(p, pose.forward), y - dot(p, pose.forward));
  }
  return away;
}
