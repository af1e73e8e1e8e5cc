import type { Box, ChunkMesh } from "./draco_chunk.ts";
import { add, scale, type Vec3 } from "./vec.ts";

type Surface = Pick<ChunkMesh, "box" | "positions" | "indices">;

/** The nearest point where a ray meets the front of a surface; null where it meets none. */
export function pick(surfaces: Iterable<Surface>, origin: Vec3, direction: Vec3): Vec3 | null {
  let nearest = Infinity;
  for (const surface of surfaces)
    if (meetsBox(surface.box, origin, direction, nearest)) nearest = hit(surface, origin, direction, nearest);
  return nearest < Infinity ? add(origin, scale(direction, nearest)) : null;
}

function meetsBox({ low, high }: Box, origin: Vec3, direction: Vec3, farthest: number): boolean {
  let [from, to] = [0, farthest];
  for (let axis = 0; axis < 3; ++axis) {
    const inverse = 1 / direction[axis]!;
    const a = (low[axis]! - origin[axis]!) * inverse;
    const b = (high[axis]! - origin[axis]!) * inverse;
    if (Number.isNaN(a) || Number.isNaN(b)) continue; // along a face
    from = Math.max(from, Math.min(a, b));
    to = Math.min(to, Math.max(a, b));
  }
  return from <= to;
}

/** Moeller and Trumbore 1997, front faces only; a smaller distance than `nearest`, or that. */
function hit({ positions: p, indices }: Surface, origin: Vec3, direction: Vec3, nearest: number): number {
  const [ox, oy, oz] = origin;
  const [dx, dy, dz] = direction;
  for (let i = 0; i < indices.length; i += 3) {
    const [a, b, c] = [3 * indices[i]!, 3 * indices[i + 1]!, 3 * indices[i + 2]!];
    const [e1x, e1y, e1z] = [p[b]! - p[a]!, p[b + 1]! - p[a + 1]!, p[b + 2]! - p[a + 2]!];
    const [e2x, e2y, e2z] = [p[c]! - p[a]!, p[c + 1]! - p[a + 1]!, p[c + 2]! - p[a + 2]!];
    const [hx, hy, hz] = [dy * e2z - dz * e2y, dz * e2x - dx * e2z, dx * e2y - dy * e2x];
    const volume = e1x * hx + e1y * hy + e1z * hz;
    if (!(volume > 0)) continue;
    const [sx, sy, sz] = [ox - p[a]!, oy - p[a + 1]!, oz - p[a + 2]!];
    const u = sx * hx + sy * hy + sz * hz;
    if (u < 0 || u > volume) continue;
    const [qx, qy, qz] = [sy * e1z - sz * e1y, sz * e1x - sx * e1z, sx * e1y - sy * e1x];
    const v = dx * qx + dy * qy + dz * qz;
    if (v < 0 || u + v > volume) continue;
    const distance = (e2x * qx + e2y * qy + e2z * qz) / volume;
    if (distance > 0 && distance < nearest) nearest = distance;
  }
  return nearest;
}
