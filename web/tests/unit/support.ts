import { readFileSync } from "node:fs";
import { add, type Vec3 } from "../../src/vec.ts";

/** Bytes of a file, named from the folder web/. */
export function readBytes(file: string): Uint8Array {
  return new Uint8Array(readFileSync(file));
}

/** The same numbers in every run (mulberry32). */
export function makeRandom(seed: number): (below: number) => number {
  let state = seed;
  return (below) => {
    state = (state + 0x6d2b79f5) | 0;
    let t = Math.imul(state ^ (state >>> 15), 1 | state);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return Math.floor((((t ^ (t >>> 14)) >>> 0) / 2 ** 32) * below);
  };
}

export interface TestSurface {
  readonly positions: Float32Array<ArrayBuffer>;
  readonly indices: Uint32Array<ArrayBuffer>;
}

/** A parallelogram of two triangles; its front is where u x v points. */
export function quad(at: Vec3, u: Vec3, v: Vec3): TestSurface {
  const corners = [at, add(at, u), add(add(at, u), v), add(at, v)];
  return { positions: new Float32Array(corners.flat()), indices: new Uint32Array([0, 1, 2, 0, 2, 3]) };
}

/** The inside of a box that stands on z = 0 around the z axis. */
export function roomSurfaces(width: number, depth: number, height: number): TestSurface[] {
  const [x, y] = [width / 2, depth / 2];
  return [
    quad([-x, -y, 0], [width, 0, 0], [0, depth, 0]),
    quad([-x, -y, height], [0, depth, 0], [width, 0, 0]),
    quad([-x, y, 0], [width, 0, 0], [0, 0, height]),
    quad([x, -y, 0], [-width, 0, 0], [0, 0, height]),
    quad([x, y, 0], [0, -depth, 0], [0, 0, height]),
    quad([-x, -y, 0], [0, depth, 0], [0, 0, height]),
  ];
}
