import type { Vec3 } from "./vec.ts";

/** The two surfaces of a scene, as src/mr/core/layer.h counts them. */
export const kMoving = 0;
export const kStill = 1;
export const kLayers = [kMoving, kStill] as const;
export type Layer = (typeof kLayers)[number];

/** A chunk's key, or another thing with a name, and its layer. */
interface Named {
  readonly name: string;
  readonly layer?: number;
}

/** A view as far as layers matter. */
interface Layered {
  readonly id: number;
  readonly layer?: number;
  readonly gain?: Vec3;
}

/** Where nothing is said all is moving. */
export function layerOf(item: Named | Layered): Layer {
  return item.layer === kStill ? kStill : kMoving;
}

/** The shown sRGB value is the decoded one times this, channel by channel. */
export function gainOf(view: Layered): Vec3 {
  return view.gain ?? [1, 1, 1];
}

/** What textures the chunks of a layer, by label: the view of that layer, or where there is none, of the other
 *  (texturing_view() of src/mr/core/view.h). */
export function texturingViews<V extends Layered>(views: readonly V[], layer: Layer): Map<number, V> {
  const found = new Map<number, V>();
  for (const view of views) if (layerOf(view) === layer || !found.has(view.id)) found.set(view.id, view);
  return found;
}

/** What ?layers= asks for; null: all. */
export function askedLayer(words: string | null): Layer | null {
  return words === "still" ? kStill : words === "moving" ? kMoving : null;
}

/** Entries of the chunks of one layer, by name; of all where it is null. */
export function ofLayer<T>(byName: ReadonlyMap<string, T>, manifest: readonly Named[], layer: Layer | null): ReadonlyMap<string, T> {
  if (layer === null) return byName;
  const out = new Map<string, T>();
  for (const key of manifest) {
    const item = byName.get(key.name);
    if (layerOf(key) === layer && item !== undefined) out.set(key.name, item);
  }
  return out;
}
