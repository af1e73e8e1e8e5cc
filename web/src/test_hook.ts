import { lookAlong, type Camera } from "./camera.ts";
import { subtract, type Vec3 } from "./vec.ts";
import type { Pair, Shown, Viewer } from "./viewer.ts";

/** A camera in the words of the C++ side: either a rotation by rows (camera to world), or a target and up. */
interface CameraRequest {
  readonly position: Vec3;
  readonly rotation?: readonly number[];
  readonly target?: Vec3;
  readonly up?: Vec3;
  readonly fx: number;
  readonly fy: number;
  readonly cx: number;
  readonly cy: number;
  readonly width: number;
  readonly height: number;
}

/** What browser tests use, as window.meshreduce. Bytes are base64. */
export interface TestHook {
  state(): string;
  shown(): Shown | null;
  pairs(): readonly Pair[];
  heldPacket(): string | null;
  setCamera(camera: CameraRequest | null): void;
  /** Where the page's own eye is and which way it looks. */
  eye(): { readonly position: Vec3; readonly forward: Vec3 };
  /** Of the picture on the screen, in drawn pixels. */
  size(): readonly [number, number];
  /** RGBA, top row first. */
  pixels(): string;
  /** RGBA, bottom row first, of the picture on the screen; `afresh`: drawn without anything that was kept. */
  screen(afresh: boolean): string;
}

declare global {
  interface Window {
    meshreduce?: TestHook;
  }
}

function base64(bytes: Uint8Array): string {
  let text = "";
  for (let i = 0; i < bytes.length; i += 0x8000) text += String.fromCharCode(...bytes.subarray(i, i + 0x8000));
  return btoa(text);
}

function cameraOf(request: CameraRequest): Camera {
  const { position, rotation: r, target, up, ...lens } = request;
  if (r === undefined)
    return { ...lens, ...lookAlong(position, subtract(target ?? [0, 0, 0], position), up ?? [0, 0, 1]) };
  const axis = (column: number): Vec3 => [r[column]!, r[3 + column]!, r[6 + column]!];
  return { ...lens, position, right: axis(0), down: axis(1), forward: axis(2) };
}

export function installTestHook(viewer: Viewer): void {
  window.meshreduce = {
    state: () => viewer.currentState(),
    shown: () => viewer.shown(),
    pairs: () => viewer.pairs,
    heldPacket: () => {
      const bytes = viewer.client.heldPacket();
      return bytes === null ? null : base64(bytes);
    },
    setCamera: (camera) => viewer.setCamera(camera === null ? null : cameraOf(camera)),
    eye: () => {
      const { position, forward } = viewer.pose();
      return { position, forward };
    },
    size: () => viewer.size(),
    pixels: () => base64(viewer.pixels()),
    screen: (afresh) => base64(viewer.screen(afresh)),
  };
}
