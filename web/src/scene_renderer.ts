import {
  BufferAttribute, BufferGeometry, Camera as ThreeCamera, Color, ColorManagement, DataTexture, IntType, LinearFilter,
  LinearSRGBColorSpace, Matrix4, Mesh, RedFormat, RGBAFormat, RGFormat, Scene, Sphere, UnsignedByteType, Vector2, Vector3,
  WebGLRenderer, WebGLRenderTarget, type RawShaderMaterial,
} from "three";
import type { Alpha } from "./alpha.ts";
import { borderDistances, fadingTriangles, findBorders, kFarM, type Rim, type RimmedMesh } from "./border.ts";
import { clipFromEye, type Camera } from "./camera.ts";
import type { Box } from "./draco_chunk.ts";
import { kLayers, kMoving, kStill, texturingViews, type Layer } from "./layers.ts";
import type { View } from "./packet.ts";
import { planeSizes, type Picture } from "./picture.ts";
import { Stage, type Theme } from "./stage.ts";
import { StillPicture } from "./still_picture.ts";
import type { Vec3 } from "./vec.ts";
import { kBackground, kNoView, kParts, makeColorMaterial, makeTintMaterial, SharedUniforms, streamUniforms, ViewMaterial, type StreamUniforms } from "./view_material.ts";

ColorManagement.enabled = false;

/** What is drawn: a mesh and the pictures of the same capture. */
export interface Drawable {
  readonly views: readonly View[];
  readonly meshes: ReadonlyMap<string, RimmedMesh>;
  readonly pictures: ReadonlyMap<number, Picture>;
  /** By stream; a picture without one is drawn whole. */
  readonly alpha: ReadonlyMap<number, Alpha>;
  /** Of the meshes; moving where it says nothing. */
  readonly layers: ReadonlyMap<string, Layer>;
}

/** By part. */
type Materials = RawShaderMaterial[];

interface DrawnChunk {
  readonly mesh: RimmedMesh;
  readonly geometry: BufferGeometry;
  readonly objects: Map<Materials, Mesh>;
  /** Over what no sensor measured, if that is shown. */
  readonly tint: Mesh | null;
  readonly scene: Scene;
  /** Edges where surface ends, by number in the rim. */
  borders: readonly number[];
}

/** All that the look of the still surface follows from, but for the eye. */
interface StillLook {
  readonly chunks: readonly DrawnChunk[];
  readonly views: string;
  readonly pictures: readonly (Picture | undefined)[];
}

const kGuessedColor = [230, 60, 200] as const;

const kNothing: StillLook = { chunks: [], views: "", pictures: [] };

function isSame(a: StillLook, b: StillLook): boolean {
  const same = <T>(p: readonly T[], q: readonly T[]): boolean => p.length === q.length && p.every((item, i) => item === q[i]);
  return a.views === b.views && same(a.chunks, b.chunks) && same(a.pictures, b.pictures);
}

const kFormats = { 1: RedFormat, 2: RGFormat, 4: RGBAFormat } as const;
const kSamplers = ["luma", "chroma", "chroma_red"] as const;

function bytesTexture(bytes: Uint8Array<ArrayBuffer>, width: number, height: number, components: number): DataTexture {
  const texture = new DataTexture(bytes, width, height, kFormats[components as keyof typeof kFormats], UnsignedByteType);
  texture.magFilter = texture.minFilter = LinearFilter; // clamped at its borders
  texture.unpackAlignment = 1;
  texture.needsUpdate = true;
  return texture;
}

function replaceBytes(texture: DataTexture, bytes: Uint8Array<ArrayBuffer>): void {
  texture.image.data = bytes;
  texture.needsUpdate = true;
}

/** One stream's picture on the graphics card, and its alpha plane where it has one. */
class StreamTexture {
  private readonly uniforms: StreamUniforms;
  /** By layer. */
  private readonly materials: readonly Materials[];
  /** Of what moves, where there is a plane: what discards fragments is slower. */
  private readonly cutting: Materials;
  private readonly planes: DataTexture[];
  private alpha: Alpha | null = null;
  private alphaTexture: DataTexture | null = null;

  constructor(shared: SharedUniforms, readonly slot: number, private picture: Picture) {
    const { width, height, format, planes } = picture;
    this.uniforms = streamUniforms(slot, width, height);
    this.materials = kLayers.map((layer) => viewMaterials(shared, this.uniforms, format, layer));
    this.cutting = viewMaterials(shared, this.uniforms, format, kMoving, true);
    this.planes = planeSizes(picture).map((size, i) => {
      const texture = bytesTexture(planes[i]!, size.width, size.height, size.components);
      this.uniforms[kSamplers[i]!].value = texture;
      return texture;
    });
  }

  materialsOf(layer: Layer): Materials {
    return layer === kMoving && this.alpha !== null ? this.cutting : this.materials[layer]!;
  }

  takes({ width, height, format }: Picture): boolean {
    return width === this.picture.width && height === this.picture.height && format === this.picture.format;
  }

  update(picture: Picture): void {
    if (picture === this.picture) return;
    this.picture = picture;
    this.planes.forEach((texture, i) => replaceBytes(texture, picture.planes[i]!));
  }

  /** Of the picture's size; null: all of it is shown. */
  setAlpha(alpha: Alpha | null): void {
    if (alpha === this.alpha) return;
    const before = this.alpha;
    this.alpha = alpha;
    if (alpha !== null && this.alphaTexture !== null && alpha.width === before?.width && alpha.height === before.height) {
      replaceBytes(this.alphaTexture, alpha.pixels);
    } else {
      this.alphaTexture?.dispose();
      this.alphaTexture = alpha === null ? null : bytesTexture(alpha.pixels, alpha.width, alpha.height, 1);
    }
    this.uniforms.alpha.value = this.alphaTexture;
    if (alpha !== null) this.uniforms.alpha_size.value = new Vector2(alpha.stepPx * alpha.width, alpha.stepPx * alpha.height);
  }

  dispose(): void {
    this.alphaTexture?.dispose();
    for (const texture of this.planes) texture.dispose();
    for (const material of [...this.materials.flat(), ...this.cutting]) material.dispose();
  }
}

function viewMaterials(
  shared: SharedUniforms, uniforms: StreamUniforms, format: Picture["format"], layer: Layer, cuts = false,
): Materials {
  return kParts.map((part) => new ViewMaterial(shared, uniforms, format, layer, part, cuts));
}

/** Copies triangles, those named last; `named`: ascending. Returns where they begin. */
function putLast(indices: ArrayLike<number>, named: ArrayLike<number>, out: { [at: number]: number }): number {
  const begin = indices.length - 3 * named.length;
  let [others, last, next] = [0, begin, 0];
  for (let triangle = 0; 3 * triangle < indices.length; ++triangle) {
    const isNamed = named[next] === triangle;
    if (isNamed) ++next;
    for (let k = 0; k < 3; ++k) out[isNamed ? last++ : others++] = indices[3 * triangle + k]!;
  }
  return begin;
}

function boxAround(chunks: readonly DrawnChunk[]): Box | null {
  const boxes = chunks.map((chunk) => chunk.mesh.box);
  if (boxes.length === 0) return null;
  const fold = (pick: (box: Box) => Vec3, best: (a: number, b: number) => number): Vec3 =>
    boxes.map(pick).reduce((a, b) => [best(a[0], b[0]), best(a[1], b[1]), best(a[2], b[2])]);
  return { low: fold((box) => box.low, Math.min), high: fold((box) => box.high, Math.max) };
}

/** Draws captures with WebGL 2. Draws when told to and never by itself. */
export class SceneRenderer {
  private readonly renderer: WebGLRenderer;
  /** By layer: what stays is drawn first, with the stage. */
  private readonly scenes = kLayers.map(() => new Scene());
  private readonly camera = new ThreeCamera();
  private readonly shared = new SharedUniforms();
  private readonly stage = new Stage(this.scenes[kStill]!, this.shared);
  private readonly plainMaterials = viewMaterials(this.shared, streamUniforms(0, 1, 1), "rgba", kMoving);
  private readonly colorMaterials: Materials;
  private readonly tintMaterial: RawShaderMaterial;
  private unseen = kNoView;
  private readonly empty = new Color();
  private readonly streams = new Map<number, StreamTexture>();
  private readonly chunks = new Map<string, DrawnChunk>();
  private fading: readonly DrawnChunk[] = []; // at borders
  private readonly stillPicture: StillPicture | null;
  private stillLook = kNothing;
  private size: readonly [number, number] = [1, 1];

  /** Without a graphics device what stays is drawn once for an eye. `showsGuesses`: tints what no sensor measured. */
  constructor(canvas: HTMLCanvasElement, isSoftware: boolean, private readonly showsGuesses = false) {
    const antialias = !isSoftware;
    this.renderer = new WebGLRenderer({ canvas, antialias, alpha: false, powerPreference: "high-performance" });
    this.renderer.outputColorSpace = LinearSRGBColorSpace;
    this.renderer.autoClear = false;
    this.stillPicture = isSoftware ? new StillPicture(this.renderer) : null;
    this.colorMaterials = [makeColorMaterial(this.shared)];
    this.tintMaterial = makeTintMaterial(this.shared);
    for (const scene of this.scenes) scene.matrixWorldAutoUpdate = false;
    this.camera.matrixWorldAutoUpdate = false;
  }

  resize(width: number, height: number): void {
    this.size = [width, height];
    this.renderer.setSize(width, height, false);
    this.stillPicture?.resize(width, height);
  }
  width(): number {
    return this.size[0];
  }
  height(): number {
    return this.size[1];
  }

  setUp(up: Vec3): void {
    this.stage.setUp(up);
    this.stillPicture?.outdate();
  }
  setTheme(theme: Theme): void {
    this.stage.setTheme(theme);
    this.unseen = theme.unseen;
    this.empty.setRGB(...theme.horizon);
    this.stillPicture?.outdate();
  }

  /** Swaps mesh, pictures and their alpha together. */
  show({ views, meshes, pictures, alpha, layers }: Drawable): void {
    const used = [...new Set(views.map((view) => view.stream))].filter((stream) => pictures.has(stream));
    this.setPictures(used, pictures);
    for (const [stream, texture] of this.streams) texture.setAlpha(alpha.get(stream) ?? null);
    this.shared.setViews(views, new Map(used.map((stream, slot) => [stream, slot])));
    for (const [name, chunk] of this.chunks)
      if (meshes.get(name) !== chunk.mesh) this.remove(name, chunk);
    const viewsOf = kLayers.map((layer) => texturingViews(views, layer));
    for (const [name, mesh] of meshes) {
      const layer = layers.get(name) ?? kMoving;
      const chunk = this.chunks.get(name) ?? this.add(name, mesh, layer);
      this.paint(chunk, this.materialsFor(mesh, layer, viewsOf[layer]!));
    }
    this.updateBorders(layers);
    const still = [...this.chunks.values()].filter(({ scene }) => scene === this.scenes[kStill]);
    const box = boxAround(still.length > 0 ? still : [...this.chunks.values()]);
    if (box !== null && this.stage.setBox(box)) this.stillPicture?.outdate();
    this.noteStill(still, [...viewsOf[kStill]!.values()], pictures);
  }

  private noteStill(chunks: readonly DrawnChunk[], views: readonly View[], pictures: ReadonlyMap<number, Picture>): void {
    const look =
      chunks.length === 0 ? kNothing : { chunks, views: JSON.stringify(views), pictures: views.map((view) => pictures.get(view.stream)) };
    if (!isSame(look, this.stillLook)) this.stillPicture?.outdate();
    this.stillLook = look;
  }

  /** Draws to the screen: on the stage, with borders that fade. */
  draw(camera: Camera): void {
    this.setCamera(camera);
    this.setNice(true);
    const drawStill = (): void => {
      this.renderer.clear();
      this.renderer.render(this.scenes[kStill]!, this.camera);
    };
    if (this.stillPicture === null) drawStill();
    else this.stillPicture.draw(this.camera, JSON.stringify(camera), drawStill);
    this.renderer.render(this.scenes[kMoving]!, this.camera);
  }

  /** Draws to the screen and reads what is there: RGBA, bottom row first. `afresh`: without the picture that is kept of what stays. */
  screen(camera: Camera, afresh: boolean): Uint8Array {
    if (afresh) this.stillPicture?.outdate();
    this.draw(camera);
    const gl = this.renderer.getContext();
    const out = new Uint8Array(4 * this.size[0] * this.size[1]);
    gl.readPixels(0, 0, ...this.size, gl.RGBA, gl.UNSIGNED_BYTE, out);
    return out;
  }

  /** Draws into memory what src/mr/render draws: RGBA, top row first. */
  pixels(camera: Camera): Uint8Array {
    const { width, height } = camera;
    const target = new WebGLRenderTarget(width, height, { depthBuffer: true, generateMipmaps: false });
    const bottomUp = new Uint8Array(4 * width * height);
    this.setCamera(camera);
    this.setNice(false);
    this.renderer.setRenderTarget(target);
    this.renderer.clear();
    for (const layer of [kStill, kMoving]) this.renderer.render(this.scenes[layer]!, this.camera);
    this.renderer.readRenderTargetPixels(target, 0, 0, width, height, bottomUp);
    this.renderer.setRenderTarget(null);
    target.dispose();
    const out = new Uint8Array(bottomUp.length);
    for (let y = 0; y < height; ++y)
      out.set(bottomUp.subarray(4 * width * (height - 1 - y), 4 * width * (height - y)), 4 * width * y);
    return out;
  }

  triangles(): number {
    let count = 0;
    for (const { mesh } of this.chunks.values()) count += mesh.rim?.triangles ?? mesh.indices.length / 3;
    return count;
  }

  /** All that is shown. */
  meshes(): RimmedMesh[] {
    return [...this.chunks.values()].map((chunk) => chunk.mesh);
  }

  /** Around all that is shown; null when that is nothing. */
  bounds(): Box | null {
    return boxAround([...this.chunks.values()]);
  }

  private setPictures(used: readonly number[], pictures: ReadonlyMap<number, Picture>): void {
    const slotOf = new Map(used.map((stream, slot) => [stream, slot]));
    for (const [stream, texture] of this.streams) {
      const picture = pictures.get(stream);
      if (picture !== undefined && slotOf.get(stream) === texture.slot && texture.takes(picture))
        texture.update(picture);
      else this.dropStream(stream, texture);
    }
    for (const [stream, slot] of slotOf)
      if (!this.streams.has(stream))
        this.streams.set(stream, new StreamTexture(this.shared, slot, pictures.get(stream)!));
  }

  private dropStream(stream: number, texture: StreamTexture): void {
    this.streams.delete(stream);
    texture.dispose();
  }

  private materialsFor(mesh: RimmedMesh, layer: Layer, views: ReadonlyMap<number, View>): Set<Materials> {
    if (mesh.colors !== null) return new Set([this.colorMaterials]);
    const materials = new Set<Materials>();
    for (const view of mesh.viewIds) {
      const texture = this.streams.get(views.get(view)?.stream ?? -1);
      if (texture !== undefined) materials.add(texture.materialsOf(layer));
    }
    const plain = [...this.streams.values()].find((texture) => texture.slot === this.shared.plainSlots[layer]!.value);
    return materials.add(plain?.materialsOf(layer) ?? this.plainMaterials);
  }

  /** One object for each material that draws a part of the chunk. */
  private paint({ geometry, objects, scene }: DrawnChunk, materials: ReadonlySet<Materials>): void {
    for (const [material, object] of objects)
      if (!materials.has(material)) {
        scene.remove(object);
        objects.delete(material);
      }
    for (const material of materials) {
      if (objects.has(material)) continue;
      const object = new Mesh(geometry, material);
      object.matrixAutoUpdate = object.matrixWorldAutoUpdate = false;
      objects.set(material, object);
      scene.add(object);
    }
  }

  private add(name: string, mesh: RimmedMesh, layer: Layer): DrawnChunk {
    const geometry = new BufferGeometry();
    geometry.setIndex(new BufferAttribute(mesh.indices.slice(), 1));
    geometry.addGroup(0, mesh.indices.length, kParts.indexOf("whole"));
    if (mesh.rim !== null) {
      const far = new Float32Array(mesh.positions.length / 3).fill(kFarM);
      geometry.setAttribute("border", new BufferAttribute(far, 1));
    }
    geometry.setAttribute("position", new BufferAttribute(mesh.positions, 3));
    if (mesh.views !== null) {
      const views = new BufferAttribute(mesh.views, 1);
      views.gpuType = IntType;
      geometry.setAttribute("view", views);
    }
    if (mesh.colors !== null) geometry.setAttribute("color", new BufferAttribute(mesh.colors, 3, true));
    const [low, high] = [new Vector3(...mesh.box.low), new Vector3(...mesh.box.high)];
    geometry.boundingSphere = new Sphere(low.clone().add(high).multiplyScalar(0.5), 0.5 * low.distanceTo(high));
    const chunk: DrawnChunk = { mesh, geometry, objects: new Map(), tint: this.tintOf(mesh), scene: this.scenes[layer]!, borders: [] };
    if (chunk.tint !== null) chunk.scene.add(chunk.tint);
    this.chunks.set(name, chunk);
    return chunk;
  }

  private tintOf({ guessed }: RimmedMesh): Mesh | null {
    if (guessed === null || !this.showsGuesses) return null;
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(guessed, 3));
    const colors = Uint8Array.from({ length: guessed.length }, (_, i) => kGuessedColor[i % 3]!);
    geometry.setAttribute("color", new BufferAttribute(colors, 3, true));
    const tint = new Mesh(geometry, this.tintMaterial);
    tint.frustumCulled = tint.matrixAutoUpdate = tint.matrixWorldAutoUpdate = false;
    return tint;
  }

  /** Beside a still surface only that fades: what moves is small, and people would lose their hands. */
  private updateBorders(layers: ReadonlyMap<string, Layer>): void {
    const layered = [...layers.values()].includes(kStill);
    const [fading, others]: [DrawnChunk[], DrawnChunk[]] = [[], []];
    for (const [name, chunk] of this.chunks) (!layered || layers.get(name) === kStill ? fading : others).push(chunk);
    if (fading.length === this.fading.length && fading.every((chunk, i) => chunk === this.fading[i])) return;
    this.fading = fading;
    const found = findBorders(fading.flatMap(({ mesh }) => mesh.rim ?? []));
    let next = 0;
    for (const chunk of fading) if (chunk.mesh.rim !== null) this.fade(chunk, chunk.mesh.rim, found[next++]!);
    for (const chunk of others) if (chunk.mesh.rim !== null) this.fade(chunk, chunk.mesh.rim, []);
  }

  /** Lets a chunk fade where surface ends now. */
  private fade(chunk: DrawnChunk, rim: Rim, borders: readonly number[]): void {
    const { mesh, geometry } = chunk;
    if (borders.length === chunk.borders.length && borders.every((edge, i) => edge === chunk.borders[i])) return;
    chunk.borders = borders;
    const distances = borderDistances(rim, borders);
    const attribute = geometry.getAttribute("border") as BufferAttribute;
    attribute.array.set(distances);
    attribute.needsUpdate = true;
    const index = geometry.index!;
    const whole = putLast(mesh.indices, fadingTriangles(mesh, rim, distances), index.array);
    index.needsUpdate = true;
    const reached = mesh.indices.length - whole;
    geometry.clearGroups();
    geometry.addGroup(0, whole, kParts.indexOf("whole"));
    if (reached === 0) return;
    geometry.addGroup(whole, reached, kParts.indexOf("solid"));
    geometry.addGroup(whole, reached, kParts.indexOf("fading"));
  }

  private remove(name: string, { geometry, objects, tint, scene }: DrawnChunk): void {
    if (tint !== null) {
      scene.remove(tint);
      tint.geometry.dispose();
    }
    this.chunks.delete(name);
    scene.remove(...objects.values());
    geometry.dispose();
  }

  private setNice(nice: boolean): void {
    this.stage.setVisible(nice);
    this.renderer.setClearColor(nice ? this.empty : kBackground, 1);
    this.shared.fades.value = nice;
    this.shared.unseen.value = nice ? this.unseen : kNoView;
  }

  private setCamera(camera: Camera): void {
    this.stage.setCamera(camera);
    const eye = this.shared.eye.value;
    eye.set(...camera.position).set(Math.fround(eye.x), Math.fround(eye.y), Math.fround(eye.z));
    const clip = this.shared.T_clip_eye.value;
    clip.fromArray(clipFromEye(camera)).transpose();
    // Only for leaving out what is not in the picture.
    this.camera.projectionMatrix.copy(clip).multiply(new Matrix4().makeTranslation(-eye.x, -eye.y, -eye.z));
    this.camera.projectionMatrixInverse.copy(this.camera.projectionMatrix).invert();
  }
}
