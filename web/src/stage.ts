import {
  BufferAttribute, BufferGeometry, DoubleSide, GLSL3, Mesh, RawShaderMaterial, Sphere, Vector2, Vector3, type Scene,
} from "three";
import type { Camera } from "./camera.ts";
import type { Box } from "./draco_chunk.ts";
import { add, anyHorizontal, cross, dot, length, scale, subtract, type Vec3 } from "./vec.ts";
import type { SharedUniforms } from "./view_material.ts";

/** Colours of the stage, sRGB from 0 to 1. */
export interface Theme {
  readonly zenith: Vec3;
  readonly horizon: Vec3;
  readonly nadir: Vec3;
  readonly line: Vec3;
  /** Surface that no camera saw in colour. */
  readonly unseen: number;
}

export const kThemes: Readonly<Record<"light" | "dark", Theme>> = {
  light: { zenith: [0.8, 0.84, 0.89], horizon: [0.93, 0.94, 0.95], nadir: [0.84, 0.85, 0.87], line: [0.5, 0.54, 0.6], unseen: 176 / 255 },
  dark: { zenith: [0.07, 0.08, 0.1], horizon: [0.16, 0.18, 0.21], nadir: [0.1, 0.11, 0.13], line: [0.45, 0.5, 0.58], unseen: 0.4 },
};

const kSkyVertex = `
precision highp float;
in vec3 position;
uniform vec3 right, down, forward;
uniform vec2 spread; // tangents at the picture's edges
out vec3 ray;
void main() {
  ray = forward + right * (position.x * spread.x) - down * (position.y * spread.y);
  gl_Position = vec4(position.xy, 0.0, 1.0);
}
`;

const kSkyFragment = `
precision highp float;
uniform vec3 up, zenith, horizon, nadir;
in vec3 ray;
out vec4 pixel;
void main() {
  float rise = dot(normalize(ray), up);
  vec3 color = mix(horizon, rise > 0.0 ? zenith : nadir, sqrt(abs(rise)));
  float noise = fract(sin(dot(gl_FragCoord.xy, vec2(12.9898, 78.233))) * 43758.5453) - 0.5;
  pixel = vec4(color + noise / 255.0, 1); // without bands
}
`;

const kFloorVertex = `
precision highp float;
in vec3 position;
uniform vec3 eye, middle, ahead, side;
uniform float radius;
uniform mat4 T_clip_eye;
out vec2 at; // metres from the middle
void main() {
  at = position.xy * radius;
  gl_Position = T_clip_eye * vec4(middle + ahead * at.x + side * at.y - eye, 1);
}
`;

const kFloorFragment = `
precision highp float;
uniform vec3 line;
uniform float radius, step_m;
in vec2 at;
out vec4 pixel;
void main() {
  vec2 cell = at / step_m;
  vec2 width = fwidth(cell);
  vec2 near = abs(fract(cell - 0.5) - 0.5) / max(width, 1e-6);
  // Lines closer than a few pixels become an even tone.
  vec2 lines = (1.0 - smoothstep(0.4, 1.4, near)) * (1.0 - smoothstep(0.15, 0.5, width));
  float border = 1.0 - smoothstep(0.25, 1.0, length(at) / radius);
  pixel = vec4(line, border * (0.08 + 0.3 * max(lines.x, lines.y)));
}
`;

const kBelowM = 0.03; // under the surface's lowest, which it must not cut
const kMarginM = 2;
const kLineEveryM = 1;
const kMostLines = 60;

function square(): BufferGeometry {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array([-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0]), 3));
  geometry.setIndex([0, 1, 2, 0, 2, 3]);
  geometry.boundingSphere = new Sphere(new Vector3(), 1);
  return geometry;
}

/** What is drawn where nothing is known: a plain sky, and a floor that fades out. */
export class Stage {
  private up: Vec3 = [0, 0, 1];
  private readonly sky: Mesh<BufferGeometry, RawShaderMaterial>;
  private readonly floor: Mesh<BufferGeometry, RawShaderMaterial>;

  constructor(scene: Scene, shared: SharedUniforms) {
    const vectors = (...names: string[]) => Object.fromEntries(names.map((name) => [name, { value: new Vector3() }]));
    const sky = new RawShaderMaterial({
      glslVersion: GLSL3, vertexShader: kSkyVertex, fragmentShader: kSkyFragment, depthTest: false, depthWrite: false,
      uniforms: { ...vectors("right", "down", "forward", "up", "zenith", "horizon", "nadir"), spread: { value: new Vector2() } },
    });
    const floor = new RawShaderMaterial({
      glslVersion: GLSL3, vertexShader: kFloorVertex, fragmentShader: kFloorFragment, depthWrite: false, transparent: true,
      side: DoubleSide,
      uniforms: {
        eye: shared.eye, T_clip_eye: shared.T_clip_eye, ...vectors("middle", "ahead", "side", "line"),
        radius: { value: 0 }, step_m: { value: kLineEveryM },
      },
    });
    this.sky = new Mesh(square(), sky);
    this.floor = new Mesh(square(), floor);
    for (const object of [this.sky, this.floor]) {
      object.frustumCulled = false;
      object.matrixAutoUpdate = object.matrixWorldAutoUpdate = false;
      object.renderOrder = -1; // before all surface, and the floor before surface that fades
      scene.add(object);
    }
    this.setTheme(kThemes.dark);
  }

  setTheme(theme: Theme): void {
    for (const name of ["zenith", "horizon", "nadir"] as const) this.sky.material.uniforms[name]!.value.set(...theme[name]);
    this.floor.material.uniforms["line"]!.value.set(...theme.line);
  }

  setUp(up: Vec3): void {
    this.up = up;
    const ahead = anyHorizontal(up);
    this.sky.material.uniforms["up"]!.value.set(...up);
    this.floor.material.uniforms["ahead"]!.value.set(...ahead);
    this.floor.material.uniforms["side"]!.value.set(...cross(up, ahead));
  }

  /** Around all surface. Whether it looks different now. */
  setBox({ low, high }: Box): boolean {
    const middle = scale(add(low, high), 0.5);
    const size = subtract(high, low);
    const depth = 0.5 * this.up.reduce((sum, v, i) => sum + Math.abs(v) * size[i]!, 0);
    const across = length(subtract(size, scale(this.up, dot(size, this.up))));
    const radius = across / 2 + kMarginM;
    const uniforms = this.floor.material.uniforms;
    const foot = subtract(middle, scale(this.up, depth + kBelowM));
    if (uniforms["radius"]!.value === radius && uniforms["middle"]!.value.equals(new Vector3(...foot))) return false;
    uniforms["middle"]!.value.set(...foot);
    uniforms["radius"]!.value = radius;
    uniforms["step_m"]!.value = kLineEveryM * Math.max(1, Math.ceil((2 * radius) / kMostLines));
    return true;
  }

  setCamera(camera: Camera): void {
    const uniforms = this.sky.material.uniforms;
    for (const axis of ["right", "down", "forward"] as const) uniforms[axis]!.value.set(...camera[axis]);
    uniforms["spread"]!.value.set(camera.width / (2 * camera.fx), camera.height / (2 * camera.fy));
  }

  /** Stays away until there is surface to stand on: its programs would hold up the first capture. */
  setVisible(visible: boolean): void {
    this.sky.visible = this.floor.visible = visible && this.floor.material.uniforms["radius"]!.value > 0;
  }
}
