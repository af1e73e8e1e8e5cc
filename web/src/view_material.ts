import { DataTexture, FloatType, FrontSide, GLSL3, Matrix4, RawShaderMaterial, RGBAFormat, Vector2, Vector3 } from "three";
import { kFadeM } from "./border.ts";
import { kMostViews } from "./draco_chunk.ts";
import { gainOf, kLayers, texturingViews, type Layer } from "./layers.ts";
import type { View } from "./packet.ts";
import type { Picture } from "./picture.ts";

/** RenderOptions of src/mr/render/renderer.h. */
export const kBackground = 0x808080;
export const kNoView = 176 / 255;

// Texels of one view in the table: three rows from the world to its picture, tile, gain and use; of a panorama, camera pixel ->
// atlas, and size. The processor that draws without a graphics card reads them for every corner: few.
const kTexels = 7;
const kPinhole = 1;
const kEquirectangular = 2;
const kKinds = 4; // use: slot of the texture stream times so many, and the kind

const kVertexShader = `
precision highp float;
precision highp int;
precision highp sampler2D;
in vec3 position;         // metres, world
in uint view;             // the same at the three corners of a triangle
in float border;          // metres to where surface ends
uniform vec3 eye;
uniform mat4 T_clip_eye;
uniform sampler2D views;  // ${kTexels} texels each
uniform float slot;       // the texture stream that is bound; triangles of the others are left out
uniform float plain_slot; // with which triangles are drawn that no view textures
out vec3 in_view;         // of a pinhole: texel times depth, depth; of others: camera frame
out float to_border;
flat out int row;         // in the table
flat out int kind;
flat out vec4 tile;       // half a texel inside it: low, high
flat out vec3 gain;       // on what the picture shows

void main() {
  to_border = border;
  bool known = int(view) < textureSize(views, 0).y;
  row = known ? int(view) : 0;
  vec4 at = vec4(position, 1);
  in_view = vec3(dot(texelFetch(views, ivec2(0, row), 0), at), dot(texelFetch(views, ivec2(1, row), 0), at),
                 dot(texelFetch(views, ivec2(2, row), 0), at));
  tile = texelFetch(views, ivec2(3, row), 0);
  vec4 use = texelFetch(views, ivec2(4, row), 0);
  gain = use.xyz;
  float its_slot = floor(use.w / ${kKinds}.0);
  kind = known ? int(use.w - its_slot * ${kKinds}.0) : 0;
  bool elsewhere = (known ? its_slot : plain_slot) != slot;
  gl_Position = elsewhere ? vec4(2, 2, 2, 1) : T_clip_eye * vec4(position - eye, 1);
}
`;

// The same mathematics as src/mr/render/gl_program.cpp.
const kFragmentShader = `
precision highp float;
precision highp int;
precision highp sampler2D;
const float kPi = 3.14159265358979;

uniform sampler2D luma;   // or RGBA
uniform sampler2D chroma; // Cb, or CbCr
uniform sampler2D chroma_red;
uniform vec2 atlas_size;
#ifdef CUT
uniform sampler2D alpha;
uniform vec2 alpha_size;  // of the picture, rounded up to squares of the plane
#endif
uniform float unseen;     // level of what no camera saw in colour
uniform bool fades;       // at borders
uniform sampler2D views;
in vec3 in_view;
in float to_border;
flat in int row;
flat in int kind;
flat in vec4 tile;
flat in vec3 gain;
out vec4 pixel;

// Columns wrap to the turn whose middle is the tile's.
vec2 project_equirectangular(vec3 p) {
  vec4 to_atlas = texelFetch(views, ivec2(5, row), 0); // scale, offset
  vec4 size = texelFetch(views, ivec2(6, row), 0);     // camera pixels; camera column in the tile's middle
  vec2 turns = vec2(atan(p.x, p.z) / (2.0 * kPi), atan(p.y, length(p.xz)) / kPi);
  vec2 at = (turns + 0.5) * size.xy - 0.5;
  at.x = size.z + size.x * (fract((at.x - size.z) / size.x + 0.5) - 0.5);
  return at * to_atlas.xy + to_atlas.zw;
}

#ifdef RGBA
vec3 atlas_at(vec2 texel) { return textureLod(luma, texel / atlas_size, 0.0).rgb; }
#else
// BT.709, limited range.
vec3 atlas_at(vec2 texel) {
  float y = (textureLod(luma, texel / atlas_size, 0.0).r - 16.0 / 255.0) * (255.0 / 219.0);
  vec2 at = texel / atlas_size;
#ifdef NV12
  vec2 c = textureLod(chroma, at, 0.0).rg;
#else
  vec2 c = vec2(textureLod(chroma, at, 0.0).r, textureLod(chroma_red, at, 0.0).r);
#endif
  c = (c - 128.0 / 255.0) * (255.0 / 224.0);
  return vec3(y + 1.5748 * c.y, y - 0.187324 * c.x - 0.468124 * c.y, y + 1.8556 * c.x);
}
#endif

#ifdef CUT
bool is_cut(vec2 texel) { return textureLod(alpha, clamp(texel, tile.xy, tile.zw) / alpha_size, 0.0).r < 0.5; }
#endif

vec3 texture_at(vec2 texel) {
  vec3 decoded = atlas_at(clamp(texel, tile.xy, tile.zw));
  return min(gain * clamp(decoded, 0.0, 1.0), 1.0);
}

void main() {
#ifdef WHOLE
  const float solid = 1.0;
#else
  float solid = fades ? smoothstep(0.0, ${kFadeM}, to_border) : 1.0;
#ifdef FADING
  if (solid >= 1.0) discard;
#else
  if (solid < 1.0) discard;
#endif
#endif
  vec3 color = vec3(unseen);
  if (kind == ${kPinhole}) {
#ifdef CUT
    if (in_view.z > 1e-6 && is_cut(in_view.xy / in_view.z)) discard;
#endif
    if (in_view.z > 1e-6) color = texture_at(in_view.xy / in_view.z);
  } else if (kind == ${kEquirectangular}) {
    color = texture_at(project_equirectangular(in_view));
  }
  pixel = vec4(color, solid);
}
`;

const kColorVertexShader = `
precision highp float;
in vec3 position;
in vec3 color;
uniform vec3 eye;
uniform mat4 T_clip_eye;
out vec3 tint;
void main() {
  tint = color;
  gl_Position = T_clip_eye * vec4(position - eye, 1);
}
`;

const kColorFragmentShader = `
precision highp float;
in vec3 tint;
out vec4 pixel;
void main() { pixel = vec4(tint, 1); }
`;

/** What all materials share. */
export class SharedUniforms {
  readonly eye = { value: new Vector3() };
  readonly T_clip_eye = { value: new Matrix4() };
  readonly unseen = { value: kNoView };
  readonly fades = { value: false };
  /** A row for each label, by the layer of the chunks that have it. */
  readonly views = kLayers.map(() => ({ value: viewTable(1) }));
  /** By layer: the slot with which triangles are drawn that no view textures, one that most chunks are drawn with anyway. */
  readonly plainSlots = kLayers.map(() => ({ value: 0 }));

  /** `slotOf`: which material holds the picture of a stream. */
  setViews(views: readonly View[], slotOf: ReadonlyMap<number, number>): void {
    for (const layer of kLayers) this.setLayer(layer, [...texturingViews(views, layer).values()], slotOf);
  }

  private setLayer(layer: Layer, views: readonly View[], slotOf: ReadonlyMap<number, number>): void {
    const drawn = views.filter((view) => view.id < kMostViews);
    const rows = 2 ** Math.ceil(Math.log2(1 + Math.max(0, ...drawn.map((view) => view.id))));
    const uniform = this.views[layer]!;
    let table = uniform.value;
    if (table.image.height !== rows) {
      table.dispose();
      uniform.value = table = viewTable(rows);
    }
    const plain = slotOf.get(drawn[0]?.stream ?? -1) ?? 0;
    this.plainSlots[layer]!.value = plain;
    const data = table.image.data as Float32Array;
    data.fill(0);
    for (let row = 0; row < rows; ++row) data[4 * kTexels * row + kUseAt] = kKinds * plain;
    for (const view of drawn) data.set(texelsOf(view, slotOf.get(view.stream) ?? plain), 4 * kTexels * view.id);
    table.needsUpdate = true;
  }
}

function viewTable(rows: number): DataTexture {
  return new DataTexture(new Float32Array(4 * kTexels * rows), kTexels, rows, RGBAFormat, FloatType);
}

/** Where the use of a view lies among its numbers. */
const kUseAt = 4 * 4 + 3;

function texelsOf(view: View, slot: number): number[] {
  const { imageRect: source, atlasRect: tile, pose } = view;
  const [r, t] = [pose.rotation, pose.translation];
  const [sx, sy] = [tile.width / source.width, tile.height / source.height];
  const [ox, oy] = [(0.5 - source.x) * sx + tile.x, (0.5 - source.y) * sy + tile.y];
  // World -> camera.
  const axis = (i: number): number[] =>
    [r[i]!, r[3 + i]!, r[6 + i]!, -(r[i]! * t[0]! + r[3 + i]! * t[1]! + r[6 + i]! * t[2]!)];
  const [right, down, forward] = [axis(0), axis(1), axis(2)];
  const isPinhole = view.kind === "pinhole";
  // Texel times depth.
  const texel = (across: number[], f: number, c: number, scale: number, offset: number): number[] =>
    across.map((value, i) => f * scale * value + (c * scale + offset) * forward[i]!);
  return [
    ...(isPinhole ? texel(right, view.fx, view.cx, sx, ox) : right),
    ...(isPinhole ? texel(down, view.fy, view.cy, sy, oy) : down),
    ...forward,
    tile.x + 0.5, tile.y + 0.5, tile.x + tile.width - 0.5, tile.y + tile.height - 0.5,
    ...gainOf(view), kKinds * slot + (isPinhole ? kPinhole : kEquirectangular),
    sx, sy, ox, oy,
    view.width, view.height, source.x + 0.5 * source.width - 0.5, 0,
  ];
}

/** What the materials of one texture stream share. */
export type StreamUniforms = Record<
  "slot" | "luma" | "chroma" | "chroma_red" | "atlas_size" | "alpha" | "alpha_size", { value: unknown }
>;

export function streamUniforms(slot: number, width: number, height: number): StreamUniforms {
  return {
    slot: { value: slot },
    luma: { value: null },
    chroma: { value: null },
    chroma_red: { value: null },
    atlas_size: { value: new Vector2(width, height) },
    alpha: { value: null },
    alpha_size: { value: null },
  };
}

/** Triangles that the fade does not reach: drawn without looking at it, so that what is hidden costs nothing; of those that it
 *  reaches, what is solid; and what fades towards a border. */
export const kParts = ["whole", "solid", "fading"] as const;
export type Part = (typeof kParts)[number];

/** Paints chunks of one layer by projection into the views of one texture stream. `cuts`: not where the alpha of a pinhole's picture is
 *  under a half. */
export class ViewMaterial extends RawShaderMaterial {
  constructor(
    shared: SharedUniforms, stream: StreamUniforms, format: Picture["format"], layer: Layer, part: Part, cuts: boolean,
  ) {
    const isFading = part === "fading";
    super({
      glslVersion: GLSL3,
      side: FrontSide,
      vertexShader: kVertexShader,
      fragmentShader: kFragmentShader,
      defines: { [format.toUpperCase()]: "", [part.toUpperCase()]: "", ...(cuts ? { CUT: "" } : {}) },
      transparent: isFading,
      depthWrite: !isFading,
      uniforms: {
        eye: shared.eye,
        T_clip_eye: shared.T_clip_eye,
        views: shared.views[layer]!,
        plain_slot: shared.plainSlots[layer]!,
        unseen: shared.unseen,
        fades: shared.fades,
        ...stream,
      },
    });
  }
}

/** Paints the vertices' own colours. */
export function makeColorMaterial(shared: SharedUniforms): RawShaderMaterial {
  return new RawShaderMaterial({
    glslVersion: GLSL3,
    side: FrontSide,
    vertexShader: kColorVertexShader,
    fragmentShader: kColorFragmentShader,
    uniforms: { eye: shared.eye, T_clip_eye: shared.T_clip_eye },
  });
}

/** The same, over surface in the same place. */
export function makeTintMaterial(shared: SharedUniforms): RawShaderMaterial {
  const material = makeColorMaterial(shared);
  material.polygonOffset = true;
  material.polygonOffsetFactor = material.polygonOffsetUnits = -2;
  return material;
}
