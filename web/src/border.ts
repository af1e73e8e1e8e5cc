import type { ChunkMesh } from "./draco_chunk.ts";

/** Where surface ends because no camera saw on. A chunk alone knows only which of its edges have one triangle: the edge of another
 *  chunk in the same place closes one. */

/** What a chunk can tell of its edges. */
export interface Rim {
  /** Triangles before some were cut. */
  readonly triangles: number;
  /** [points] Number of a point's place: vertices that are doubled where labels meet share one. */
  readonly place: Uint32Array<ArrayBuffer>;
  readonly places: number;
  /** [2 E] Places at the ends of the edges that have one triangle. */
  readonly edges: Uint32Array<ArrayBuffer>;
  /** [2 E] Name of each of them by its position, two numbers: equal in all chunks, different for others. */
  readonly names: Uint32Array<ArrayBuffer>;
  /** [4 E] Names of the places at their ends, as unique. */
  readonly ends: Uint32Array<ArrayBuffer>;
  /** [E] metres */
  readonly lengths: Float32Array<ArrayBuffer>;
  /** Triangles that the fade can reach, by number. */
  readonly near: Uint32Array<ArrayBuffer>;
  /** [2 L] Places that an edge of those joins, and its length in metres. */
  readonly links: Uint32Array<ArrayBuffer>;
  readonly spans: Float32Array<ArrayBuffer>;
}

export interface RimmedMesh extends ChunkMesh {
  /** None for a background, which does not fade. */
  readonly rim: Rim | null;
}

/** Metres over which surface fades. */
export const kFadeM = 0.02;
/** Borders that are shorter in all do not fade: holes would grow, and what is thin, such as the backs of chairs, would vanish. What is
 *  longer is the edge of what all sensors together see of a room. */
const kShortestBorderM = 15;
/** The distance of a vertex that the fade does not reach; the same as a 32-bit float. */
export const kFarM = 0.25;

const kEmpty = 0xffffffff;

/** Tells the edges of a chunk, and cuts triangles across it: a triangle with all its corners at edges would fade as a whole. */
export function withRim(mesh: ChunkMesh): RimmedMesh {
  if (mesh.views === null) return { ...mesh, rim: null };
  const { place, places } = placesOf(mesh.positions);
  const edges = new EdgeTable(place, mesh.indices);
  const isRim = edges.openPlaces(places);
  const cut = cutChords(mesh, place, places, edges, isRim);
  const open = edges.open();
  const near = nearOf(cut.mesh.indices, cut.place, cut.places, isRim);
  return {
    ...cut.mesh,
    rim: {
      triangles: mesh.indices.length / 3,
      place: cut.place,
      places: cut.places,
      edges: open,
      ...namesOf(mesh.positions, place, places, open),
      near,
      ...linksOf(cut.mesh, cut.place, near),
    },
  };
}

/** Arrays of a rim, to be moved to another thread. */
export function buffersOf(rim: Rim): ArrayBuffer[] {
  return [rim.place, rim.edges, rim.names, rim.ends, rim.lengths, rim.near, rim.links, rim.spans].map((array) => array.buffer);
}

function tableSize(entries: number): number {
  return 2 ** Math.ceil(Math.log2(2 * Math.max(1, entries)));
}

function mix(hash: number): number {
  let h = hash;
  h = Math.imul(h ^ (h >>> 16), 0x7feb352d);
  h = Math.imul(h ^ (h >>> 15), 0x846ca68b);
  return (h ^ (h >>> 16)) >>> 0;
}

/** Equal positions have equal bits: all lie on one lattice. */
function hashPosition(bits: Uint32Array, point: number, seed: number): number {
  const at = 3 * point;
  return mix(mix(mix(bits[at]! ^ seed) + bits[at + 1]!) + bits[at + 2]!);
}

function placesOf(positions: Float32Array<ArrayBuffer>): { place: Uint32Array<ArrayBuffer>; places: number } {
  const points = positions.length / 3;
  const bits = new Uint32Array(positions.buffer, positions.byteOffset, positions.length);
  const place = new Uint32Array(points);
  const mask = tableSize(points) - 1;
  const firsts = new Uint32Array(mask + 1).fill(kEmpty);
  let places = 0;
  for (let point = 0; point < points; ++point) {
    let slot = hashPosition(bits, point, 1) & mask;
    for (; firsts[slot] !== kEmpty; slot = (slot + 1) & mask) {
      const [p, q] = [3 * firsts[slot]!, 3 * point];
      if (bits[p] === bits[q] && bits[p + 1] === bits[q + 1] && bits[p + 2] === bits[q + 2]) break;
    }
    if (firsts[slot] === kEmpty) {
      firsts[slot] = point;
      place[point] = places++;
    } else place[point] = place[firsts[slot]!]!;
  }
  return { place, places };
}

/** How many triangles each edge has. */
class EdgeTable {
  private readonly mask: number;
  private readonly low: Uint32Array;
  private readonly high: Uint32Array;
  private readonly count: Uint8Array;

  constructor(place: Uint32Array, indices: ChunkMesh["indices"]) {
    const size = tableSize(indices.length);
    this.mask = size - 1;
    this.low = new Uint32Array(size).fill(kEmpty);
    this.high = new Uint32Array(size);
    this.count = new Uint8Array(size);
    for (let i = 0; i < indices.length; i += 3)
      for (let k = 0; k < 3; ++k) {
        const slot = this.slot(place[indices[i + k]!]!, place[indices[i + ((k + 1) % 3)]!]!);
        if (this.count[slot]! < 255) ++this.count[slot]!;
      }
  }

  /** Where an edge lies, or where it was put now. */
  slot(a: number, b: number): number {
    const [low, high] = a < b ? [a, b] : [b, a];
    let slot = mix(mix(low) + high) & this.mask;
    while (this.low[slot] !== kEmpty && !(this.low[slot] === low && this.high[slot] === high))
      slot = (slot + 1) & this.mask;
    this.low[slot] = low;
    this.high[slot] = high;
    return slot;
  }

  isOpen(slot: number): boolean {
    return this.count[slot] === 1;
  }

  open(): Uint32Array<ArrayBuffer> {
    const out: number[] = [];
    this.count.forEach((count, slot) => {
      if (count === 1) out.push(this.low[slot]!, this.high[slot]!);
    });
    return Uint32Array.from(out);
  }

  openPlaces(places: number): Uint8Array {
    const out = new Uint8Array(places);
    this.count.forEach((count, slot) => {
      if (count === 1) out[this.low[slot]!] = out[this.high[slot]!] = 1;
    });
    return out;
  }
}

const kShortestChordM = 0.04;

/** Cuts the edges inside the chunk whose two ends lie at its edges in their middle, in all their triangles. */
function cutChords(
  mesh: ChunkMesh, place: Uint32Array<ArrayBuffer>, places: number, edges: EdgeTable, isRim: Uint8Array,
): { mesh: ChunkMesh; place: Uint32Array<ArrayBuffer>; places: number } {
  const { positions, indices } = mesh;
  const middles = new Map<number, number>(); // slot of an edge → place of its middle
  const newPositions: number[] = [];
  const newPlaces: number[] = [];
  const newViews: number[] = [];
  const corners: number[] = [];
  const points = positions.length / 3;
  const cutAt = (a: number, b: number): number | null => {
    if (!isRim[place[a]!] || !isRim[place[b]!]) return null;
    const slot = edges.slot(place[a]!, place[b]!);
    const span = [0, 1, 2].map((k) => positions[3 * a + k]! - positions[3 * b + k]!);
    if (edges.isOpen(slot) || Math.hypot(...span) < kShortestChordM) return null;
    if (!middles.has(slot)) middles.set(slot, places + middles.size);
    newPositions.push(...[0, 1, 2].map((k) => (positions[3 * a + k]! + positions[3 * b + k]!) / 2));
    newPlaces.push(middles.get(slot)!);
    newViews.push(mesh.views![a]!);
    return points + newPlaces.length - 1;
  };
  for (let i = 0; i < indices.length; i += 3) {
    const [a, b, c] = [indices[i]!, indices[i + 1]!, indices[i + 2]!];
    const [ab, bc, ca] = [cutAt(a, b), cutAt(b, c), cutAt(c, a)];
    if (ab === null && bc === null && ca === null) corners.push(a, b, c);
    else corners.push(...split(a, b, c, ab, bc, ca));
  }
  if (newPlaces.length === 0) return { mesh, place, places };
  const total = points + newPlaces.length;
  return {
    mesh: {
      ...mesh,
      positions: joined(Float32Array, positions, newPositions),
      views: joined(Uint16Array, mesh.views!, newViews),
      indices: total <= 0xffff ? Uint16Array.from(corners) : Uint32Array.from(corners),
    },
    place: joined(Uint32Array, place, newPlaces),
    places: places + middles.size,
  };
}

function joined<T extends Float32Array<ArrayBuffer> | Uint16Array<ArrayBuffer> | Uint32Array<ArrayBuffer>>(
  kind: new (length: number) => T, first: T, second: readonly number[],
): T {
  const out = new kind(first.length + second.length);
  out.set(first);
  out.set(second, first.length);
  return out;
}

/** A triangle as triangles, given points in the middle of at least one of its edges. */
function split(
  a: number, b: number, c: number, ab: number | null, bc: number | null, ca: number | null,
): number[] {
  if (ab !== null && bc !== null && ca !== null) return [a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca];
  // Turned until the edges that are cut come first.
  if (ab === null || (ca !== null && bc === null)) return split(b, c, a, bc, ca, ab);
  if (bc === null) return [a, ab, c, ab, b, c];
  return [ab, b, bc, a, ab, bc, a, bc, c];
}

function namesOf(
  positions: Float32Array<ArrayBuffer>, place: Uint32Array, places: number, edges: Uint32Array,
): Pick<Rim, "names" | "ends" | "lengths"> {
  const bits = new Uint32Array(positions.buffer, positions.byteOffset, positions.length);
  const pointAt = new Uint32Array(places);
  place.forEach((p, point) => (pointAt[p] = point));
  const count = edges.length / 2;
  const out = { names: new Uint32Array(2 * count), ends: new Uint32Array(4 * count), lengths: new Float32Array(count) };
  // The same in either direction.
  const both = (p: number, q: number): number => mix(p + q) ^ mix(Math.imul(p ^ 0x9e3779b9, q ^ 0x9e3779b9));
  for (let i = 0; i < count; ++i) {
    const [a, b] = [pointAt[edges[2 * i]!]!, pointAt[edges[2 * i + 1]!]!];
    const ends = [hashPosition(bits, a, 1), hashPosition(bits, a, 2), hashPosition(bits, b, 1), hashPosition(bits, b, 2)];
    out.ends.set(ends, 4 * i);
    out.names[2 * i] = both(ends[0]!, ends[2]!);
    out.names[2 * i + 1] = both(ends[1]!, ends[3]!);
    out.lengths[i] = spanOf(positions, a, b);
  }
  return out;
}

function spanOf(p: Float32Array, a: number, b: number): number {
  const [x, y, z] = [p[3 * a]! - p[3 * b]!, p[3 * a + 1]! - p[3 * b + 1]!, p[3 * a + 2]! - p[3 * b + 2]!];
  return Math.sqrt(x * x + y * y + z * z);
}

/** Triangles with a corner at the rim, and those beside them. */
function nearOf(
  indices: ChunkMesh["indices"], place: Uint32Array, places: number, isRim: Uint8Array,
): Uint32Array<ArrayBuffer> {
  const touches = (marks: Uint8Array, i: number): boolean =>
    (marks[place[indices[i]!]!]! | marks[place[indices[i + 1]!]!]! | marks[place[indices[i + 2]!]!]!) !== 0;
  const isBeside = new Uint8Array(places);
  for (let i = 0; i < indices.length; i += 3)
    if (touches(isRim, i)) for (let k = 0; k < 3; ++k) isBeside[place[indices[i + k]!]!] = 1;
  const near: number[] = [];
  for (let i = 0; i < indices.length; i += 3) if (touches(isBeside, i)) near.push(i / 3);
  return Uint32Array.from(near);
}

function linksOf(
  { positions, indices }: ChunkMesh, place: Uint32Array, near: Uint32Array,
): Pick<Rim, "links" | "spans"> {
  const links: number[] = [];
  const spans: number[] = [];
  for (const triangle of near)
    for (let k = 0; k < 3; ++k) {
      const [a, b] = [indices[3 * triangle + k]!, indices[3 * triangle + ((k + 1) % 3)]!];
      const [p, q] = [place[a]!, place[b]!];
      // The triangle on an edge's other side names it the other way round.
      if (p > q) continue;
      links.push(p, q);
      spans.push(spanOf(positions, a, b));
    }
  return { links: Uint32Array.from(links), spans: Float32Array.from(spans) };
}

/** Gives each name a number, from 0. */
class Numbering {
  count = 0;
  private readonly mask: number;
  private readonly slots: Int32Array;
  private readonly names: Uint32Array;

  constructor(most: number) {
    this.mask = tableSize(most) - 1;
    this.slots = new Int32Array(this.mask + 1).fill(-1);
    this.names = new Uint32Array(2 * most);
  }

  of(first: number, second: number): number {
    let slot = first & this.mask;
    for (; this.slots[slot] !== -1; slot = (slot + 1) & this.mask) {
      const number = this.slots[slot]!;
      if (this.names[2 * number] === first && this.names[2 * number + 1] === second) return number;
    }
    this.slots[slot] = this.count;
    this.names[2 * this.count] = first;
    this.names[2 * this.count + 1] = second;
    return this.count++;
  }
}

/** Which edges of each chunk are borders that fade, by number: those that have one triangle in all chunks together, and are `shortestM`
 *  metres long with what they hang together with. */
export function findBorders(rims: readonly Rim[], shortestM = kShortestBorderM): number[][] {
  const total = rims.reduce((sum, rim) => sum + rim.lengths.length, 0);
  const numbering = new Numbering(total);
  const counts = new Uint32Array(total);
  const numbers = rims.map(({ names, lengths }) => {
    const out = new Uint32Array(lengths.length);
    for (let i = 0; i < out.length; ++i) ++counts[(out[i] = numbering.of(names[2 * i]!, names[2 * i + 1]!))]!;
    return out;
  });
  const joined = new JoinedLengths(2 * total);
  const borders = rims.map(({ ends, lengths }, n) => {
    const out: number[] = [];
    numbers[n]!.forEach((number, i) => {
      if (counts[number] !== 1) return;
      out.push(i);
      joined.add(ends, i, lengths[i]!);
    });
    return out;
  });
  return rims.map(({ ends }, n) => borders[n]!.filter((i) => joined.lengthAt(ends, i) >= shortestM));
}

/** Lengths of edges that hang together (union-find over their ends). */
class JoinedLengths {
  private readonly numbering: Numbering;
  private readonly parents: Uint32Array;
  private readonly lengths: Float64Array;

  constructor(mostEnds: number) {
    this.numbering = new Numbering(mostEnds);
    this.parents = new Uint32Array(mostEnds).map((_, i) => i);
    this.lengths = new Float64Array(mostEnds);
  }

  add(ends: Uint32Array, edge: number, length: number): void {
    const from = this.root(this.numbering.of(ends[4 * edge]!, ends[4 * edge + 1]!));
    const to = this.root(this.numbering.of(ends[4 * edge + 2]!, ends[4 * edge + 3]!));
    this.lengths[to]! += length;
    if (from === to) return;
    this.parents[from] = to;
    this.lengths[to]! += this.lengths[from]!;
  }

  lengthAt(ends: Uint32Array, edge: number): number {
    return this.lengths[this.root(this.numbering.of(ends[4 * edge]!, ends[4 * edge + 1]!))]!;
  }

  private root(number: number): number {
    let at = number;
    while (this.parents[at] !== at) at = this.parents[at] = this.parents[this.parents[at]!]!;
    return at;
  }
}

/** [points] Metres to the nearest border, along edges and as far as the fade can reach. */
export function borderDistances(rim: Rim, borders: readonly number[]): Float32Array<ArrayBuffer> {
  const { place, edges, links, spans } = rim;
  const at = new Float32Array(rim.places).fill(kFarM);
  for (const edge of borders) at[edges[2 * edge]!] = at[edges[2 * edge + 1]!] = 0;
  for (let round = 0; round < 2; ++round)
    for (let i = 0; i < spans.length; ++i) {
      const [p, q] = [links[2 * i]!, links[2 * i + 1]!];
      if (at[p] === kFarM && at[q] === kFarM) continue;
      at[p] = reached(at[p]!, at[q]! + spans[i]!);
      at[q] = reached(at[q]!, at[p]! + spans[i]!);
    }
  const out = new Float32Array(place.length);
  for (let point = 0; point < out.length; ++point) out[point] = at[place[point]!]!;
  return out;
}

/** A distance that is larger than kFarM still tells how steeply the fade goes. */
function reached(before: number, now: number): number {
  return before === kFarM ? now : Math.min(before, now);
}

/** Numbers of the triangles in which the fade shows. */
export function fadingTriangles({ indices }: ChunkMesh, rim: Rim, distances: Float32Array): Uint32Array {
  return rim.near.filter(
    (i) => distances[indices[3 * i]!]! < kFadeM || distances[indices[3 * i + 1]!]! < kFadeM || distances[indices[3 * i + 2]!]! < kFadeM,
  );
}
