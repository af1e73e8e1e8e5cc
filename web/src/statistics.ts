import { kLayers, kStill, layerOf, type Layer } from "./layers.ts";
import type { Packet } from "./packet.ts";

/** Amounts per second over the last seconds. */
export class Rate {
  private readonly entries: { at: number; amount: number }[] = [];

  constructor(private readonly windowMs = 2000) {}

  add(nowMs: number, amount: number): void {
    this.entries.push({ at: nowMs, amount });
    this.forget(nowMs);
  }

  perSecond(nowMs: number): number {
    this.forget(nowMs);
    return this.entries.reduce((sum, entry) => sum + entry.amount, 0) / (this.windowMs / 1000);
  }

  private forget(nowMs: number): void {
    while (this.entries.length > 0 && this.entries[0]!.at < nowMs - this.windowMs) this.entries.shift();
  }
}

/** Bytes of packets per second, by layer. A picture, with its alpha, is still when it is a plate: when views of still surface show it. */
export class Traffic {
  private readonly mesh = kLayers.map(() => new Rate());
  private readonly texture = kLayers.map(() => new Rate());
  private readonly all = new Rate();

  /** A message of so many bytes, heads and all. */
  addMessage(nowMs: number, bytes: number): void {
    this.all.add(nowMs, bytes);
  }

  bytes(nowMs: number): number {
    return this.all.perSecond(nowMs);
  }

  add(nowMs: number, { views, chunks, textures, alpha }: Pick<Packet, "views" | "chunks" | "textures" | "alpha">): void {
    const plates = new Set(views.filter((view) => layerOf(view) === kStill).map((view) => view.stream));
    const sum = (sizes: readonly number[]): number => sizes.reduce((a, b) => a + b, 0);
    for (const layer of kLayers) {
      const units = [...textures, ...alpha].filter((unit) => plates.has(unit.stream) === (layer === kStill));
      this.mesh[layer]!.add(nowMs, sum(chunks.filter((chunk) => layerOf(chunk.key) === layer).map((chunk) => chunk.payload.length)));
      this.texture[layer]!.add(nowMs, sum(units.map((unit) => unit.data.length)));
    }
  }

  meshBytes(layer: Layer, nowMs: number): number {
    return this.mesh[layer]!.perSecond(nowMs);
  }
  textureBytes(layer: Layer, nowMs: number): number {
    return this.texture[layer]!.perSecond(nowMs);
  }
}

/** The middle one of the last values. */
export class Median {
  private readonly values: number[] = [];

  constructor(private readonly most = 60) {}

  add(value: number): void {
    this.values.push(value);
    if (this.values.length > this.most) this.values.shift();
  }

  value(): number | null {
    return [...this.values].sort((a, b) => a - b)[Math.floor(this.values.length / 2)] ?? null;
  }
}
