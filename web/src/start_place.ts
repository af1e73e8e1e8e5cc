import type { ChunkMesh } from "./draco_chunk.ts";
import { kEyeHeightM, type Start } from "./navigation.ts";
import { add, anyHorizontal, clamp, cross, scale, type Vec3 } from "./vec.ts";

type Surface = Pick<ChunkMesh, "positions" | "indices">;

const kFinestM = 0.2; // cells
const kMostCells = 36; // along the longest side
const kClearM = 0.5; // from the eye to any surface
const kObstacleM = 0.3; // above the floor: nobody stands in it
const kMostPlaces = 60;
const kHeadings = 24;
const kMostSamples = 50_000;
const kFloorShare = 0.25; // of the largest level's area: a floor

/** A piece of surface: one cell of the grid. Coordinates are cells along two level directions and up. */
interface Patch {
  readonly cell: number;
  readonly x: number;
  readonly y: number;
  readonly z: number;
  area: number;
  nx: number; // normals weighted by area
  ny: number;
  nz: number;
}

interface Grid {
  readonly axes: readonly [Vec3, Vec3, Vec3];
  readonly low: readonly [number, number, number]; // metres along the axes
  readonly cellM: number;
  readonly size: readonly [number, number, number];
  /** By cell; 0: empty. */
  readonly filled: Uint8Array;
  readonly patches: readonly Patch[];
  /** Of all surface, in cells along the level axes. */
  readonly middle: readonly [number, number];
}

/** The place, at eye height above the floor, and the direction from which most surface is seen from its front. Coarse: surface is
 *  put into cells, and rays go through those. `fovX`, `fovY`: angles of the picture. Null where nobody could stand. */
export function findStart(surfaces: readonly Surface[], up: Vec3, fovX: number, fovY: number): Start | null {
  const grid = makeGrid(surfaces, up);
  if (grid === null) return null;
  const floor = floorLevel(grid);
  const eyeZ = floor + kEyeHeightM / grid.cellM;
  let best: { score: number; place: readonly [number, number]; yaw: number; pitch: number; depth: number } | null = null;
  for (const place of placesToStand(grid, floor, eyeZ)) {
    const view = bestView(grid, place, eyeZ, fovX, fovY);
    if (view !== null && view.score > (best?.score ?? 0)) best = { place, ...view };
  }
  if (best === null) return null;
  const eye = toWorld(grid, [best.place[0], best.place[1], eyeZ]);
  const level = add(scale(grid.axes[0], Math.cos(best.yaw)), scale(grid.axes[1], Math.sin(best.yaw)));
  const way = add(scale(level, Math.cos(best.pitch)), scale(grid.axes[2], Math.sin(best.pitch)));
  return { eye, lookAt: add(eye, scale(way, best.depth * grid.cellM)) };
}

function toWorld({ axes, low, cellM }: Grid, at: Vec3): Vec3 {
  return axes.reduce<Vec3>((sum, axis, i) => add(sum, scale(axis, low[i]! + at[i]! * cellM)), [0, 0, 0]);
}

function makeGrid(surfaces: readonly Surface[], up: Vec3): Grid | null {
  const ahead = anyHorizontal(up);
  const axes = [ahead, cross(up, ahead), up] as const;
  const low: [number, number, number] = [Infinity, Infinity, Infinity];
  const high: [number, number, number] = [-Infinity, -Infinity, -Infinity];
  let area = 0;
  forEachTriangle(surfaces, axes, (a, b, c) => {
    for (let i = 0; i < 3; ++i) {
      low[i] = Math.min(low[i]!, a[i]!, b[i]!, c[i]!);
      high[i] = Math.max(high[i]!, a[i]!, b[i]!, c[i]!);
    }
    area += 0.5 * Math.hypot(...crossOf(a, b, c));
  });
  if (!(area > 0)) return null;
  const extent = Math.max(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
  const cellM = Math.max(kFinestM, extent / kMostCells);
  const size = [0, 1, 2].map((i) => Math.floor((high[i]! - low[i]!) / cellM) + 1) as [number, number, number];
  const filled = new Uint8Array(size[0] * size[1] * size[2]);
  const patches = new Map<number, Patch>();
  // Points of the surface, two on the side of a cell.
  const spacing = Math.max(cellM / 2, Math.sqrt(area / kMostSamples));
  forEachTriangle(surfaces, axes, (a, b, c) => {
    const n = crossOf(a, b, c);
    const whole = 0.5 * Math.hypot(...n);
    if (!(whole > 0)) return;
    const longest = Math.max(Math.hypot(b[0] - a[0], b[1] - a[1], b[2] - a[2]), Math.hypot(c[0] - a[0], c[1] - a[1], c[2] - a[2]));
    const steps = Math.max(1, Math.ceil(longest / spacing));
    const share = whole / ((steps * (steps + 1)) / 2);
    for (let i = 0; i < steps; ++i)
      for (let j = 0; i + j < steps; ++j) {
        const [u, v] = [(i + 1 / 3) / steps, (j + 1 / 3) / steps];
        const along = (k: 0 | 1 | 2): number => {
          const at = (a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]) - low[k]) / cellM;
          return clamp(Math.floor(at), 0, size[k] - 1);
        };
        const [x, y, z] = [along(0), along(1), along(2)];
        const cell = (z * size[1] + y) * size[0] + x;
        let patch = patches.get(cell);
        if (patch === undefined) patches.set(cell, (patch = { cell, x, y, z, area: 0, nx: 0, ny: 0, nz: 0 }));
        patch.area += share;
        patch.nx += (share * n[0]) / (2 * whole);
        patch.ny += (share * n[1]) / (2 * whole);
        patch.nz += (share * n[2]) / (2 * whole);
        filled[cell] = 1;
      }
  });
  const list = [...patches.values()];
  const mean = (of: (patch: Patch) => number): number => list.reduce((sum, p) => sum + p.area * (of(p) + 0.5), 0) / area;
  return { axes, low, cellM, size, filled, patches: list, middle: [mean((p) => p.x), mean((p) => p.y)] };
}

type Point = [number, number, number];

function crossOf(a: Point, b: Point, c: Point): Point {
  const [px, py, pz] = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
  const [qx, qy, qz] = [c[0] - a[0], c[1] - a[1], c[2] - a[2]];
  return [py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx];
}

/** Corners along the axes; the same three arrays every time. */
function forEachTriangle(
  surfaces: readonly Surface[], axes: readonly [Vec3, Vec3, Vec3], visit: (a: Point, b: Point, c: Point) => void,
): void {
  const corners: [Point, Point, Point] = [[0, 0, 0], [0, 0, 0], [0, 0, 0]];
  for (const { positions, indices } of surfaces)
    for (let i = 0; i < indices.length; i += 3) {
      for (let corner = 0; corner < 3; ++corner) {
        const at = 3 * indices[i + corner]!;
        for (let k = 0; k < 3; ++k) {
          const axis = axes[k]!;
          corners[corner]![k] = axis[0] * positions[at]! + axis[1] * positions[at + 1]! + axis[2] * positions[at + 2]!;
        }
      }
      visit(...corners);
    }
}

const kUpright = 0.8; // cosine

/** The lowest level with much surface that faces up; the bottom where none does. In cells. */
function floorLevel({ patches, size }: Grid): number {
  const levels = new Float64Array(size[2]);
  for (const patch of patches) if (patch.nz > kUpright * patch.area) levels[patch.z]! += patch.area;
  const most = Math.max(...levels);
  return most > 0 ? levels.findIndex((area) => area >= kFloorShare * most) + 0.5 : 0;
}

/** Points on the floor, in cells, with room for a person and nothing near the eye. */
function placesToStand(grid: Grid, floor: number, eyeZ: number): [number, number][] {
  const { size, cellM, patches } = grid;
  const hasFloor = new Uint8Array(size[0] * size[1]);
  const blocked = new Uint8Array(size[0] * size[1]);
  for (const { x, y, z, area, nz } of patches) {
    const above = (z + 0.5 - floor) * cellM;
    if (Math.abs(above) < kObstacleM && nz > 0.5 * area) hasFloor[y * size[0] + x] = 1;
    if (above > kObstacleM && z + 0.5 < eyeZ + kClearM / cellM) blocked[y * size[0] + x] = 1;
  }
  const reach = Math.ceil(kClearM / cellM);
  const isFree = (x: number, y: number): boolean => {
    for (let dy = -reach; dy <= reach; ++dy)
      for (let dx = -reach; dx <= reach; ++dx) {
        const [at, to] = [x + dx, y + dy];
        if (at < 0 || to < 0 || at >= size[0] || to >= size[1]) continue;
        if (Math.hypot(dx, dy) * cellM <= kClearM && blocked[to * size[0] + at]) return false;
      }
    return true;
  };
  const free: [number, number][] = [];
  for (let y = 0; y < size[1]; ++y)
    for (let x = 0; x < size[0]; ++x)
      if (hasFloor[y * size[0] + x] && isFree(x, y)) free.push([x + 0.5, y + 0.5]);
  const step = Math.ceil(free.length / kMostPlaces);
  return free.filter((_, i) => i % step === 0);
}

/** The direction in which most of the surface is that a place sees. Angles around up from the first axis, and above level. */
function bestView(
  grid: Grid, [x, y]: readonly [number, number], eyeZ: number, fovX: number, fovY: number,
): { score: number; yaw: number; pitch: number; depth: number } | null {
  const sums = new Float64Array(kHeadings);
  const heights = new Float64Array(kHeadings); // angles above level, weighted
  const depths = new Float64Array(kHeadings);
  for (const patch of grid.patches) {
    const [dx, dy, dz] = [patch.x + 0.5 - x, patch.y + 0.5 - y, patch.z + 0.5 - eyeZ];
    const facing = -(patch.nx * dx + patch.ny * dy + patch.nz * dz);
    if (facing <= 0) continue;
    const level = Math.hypot(dx, dy);
    const elevation = Math.atan2(dz, level);
    if (Math.abs(elevation) > fovY / 2 + kMostTilt || !isSeen(grid, x, y, eyeZ, patch)) continue;
    const heading = Math.floor(((Math.atan2(dy, dx) / (2 * Math.PI) + 1) % 1) * kHeadings) % kHeadings;
    sums[heading]! += patch.area;
    heights[heading]! += patch.area * elevation;
    depths[heading]! += patch.area * Math.hypot(level, dz);
  }
  const inwards = Math.atan2(grid.middle[1] - y, grid.middle[0] - x);
  return bestHeading(sums, heights, depths, fovX, inwards);
}

const kMostTilt = (15 * Math.PI) / 180;

/** The headings, as many as a picture is wide, with most surface; more counts what is in the picture's middle and lies inwards. */
function bestHeading(
  sums: Float64Array, heights: Float64Array, depths: Float64Array, fovX: number, inwards: number,
): { score: number; yaw: number; pitch: number; depth: number } | null {
  const span = clamp(Math.round((fovX / (2 * Math.PI)) * kHeadings), 1, kHeadings);
  const over = (values: Float64Array, from: number): number => {
    let sum = 0;
    for (let i = 0; i < span; ++i) {
      const aside = Math.abs(2 * (i + 0.5) - span) / span;
      sum += (1 - 0.7 * aside) * values[(from + i) % kHeadings]!;
    }
    return sum;
  };
  const yawOf = (from: number): number => ((from + span / 2) / kHeadings) * 2 * Math.PI;
  const scoreOf = (from: number): number => over(sums, from) * (1 + Math.cos(yawOf(from) - inwards));
  let best = 0;
  for (let from = 1; from < kHeadings; ++from) if (scoreOf(from) > scoreOf(best)) best = from;
  const seen = over(sums, best);
  if (!(seen > 0)) return null;
  const pitch = clamp(over(heights, best) / seen, -kMostTilt, kMostTilt);
  return { score: scoreOf(best), yaw: yawOf(best), pitch, depth: over(depths, best) / seen };
}

/** Whether no filled cell lies between; the patch's own neighbours do not count. */
function isSeen({ size, filled }: Grid, x: number, y: number, z: number, patch: Patch): boolean {
  const [dx, dy, dz] = [patch.x + 0.5 - x, patch.y + 0.5 - y, patch.z + 0.5 - z];
  const length = Math.hypot(dx, dy, dz);
  const steps = Math.floor(length - 1.8);
  for (let i = 1; i <= steps; ++i) {
    const t = i / length;
    const [cx, cy, cz] = [Math.floor(x + t * dx), Math.floor(y + t * dy), Math.floor(z + t * dz)];
    if (cx < 0 || cy < 0 || cz < 0 || cx >= size[0] || cy >= size[1] || cz >= size[2]) continue;
    if (filled[(cz * size[1] + cy) * size[0] + cx] && !(Math.abs(cx - patch.x) <= 1 && Math.abs(cy - patch.y) <= 1 && Math.abs(cz - patch.z) <= 1))
      return false;
  }
  return true;
}
