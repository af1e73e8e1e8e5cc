import {
  BufferAttribute, BufferGeometry, DepthTexture, GLSL3, Mesh, NearestFilter, RawShaderMaterial, Scene, UnsignedIntType, WebGLRenderTarget,
  type Camera, type WebGLRenderer,
} from "three";

const kVertexShader = `
precision highp float;
in vec3 position;
void main() { gl_Position = vec4(position, 1); }
`;

const kFragmentShader = `
precision highp float;
precision highp sampler2D;
uniform sampler2D color, depth;
out vec4 pixel;
void main() {
  pixel = texelFetch(color, ivec2(gl_FragCoord.xy), 0);
  gl_FragDepth = texelFetch(depth, ivec2(gl_FragCoord.xy), 0).r;
}
`;

/** Keeps the picture of what stays, with its depth, while neither that nor the eye changes: then a capture costs what moves in it. For
 *  devices to which a room's triangles are many. */
export class StillPicture {
  private readonly target = new WebGLRenderTarget(1, 1, {
    depthTexture: new DepthTexture(1, 1, UnsignedIntType), minFilter: NearestFilter, magFilter: NearestFilter, generateMipmaps: false,
  });
  private readonly scene = new Scene();
  private isOutdated = true;
  private eye = "";

  constructor(private readonly renderer: WebGLRenderer) {
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(new Float32Array([-1, -1, 0, 3, -1, 0, -1, 3, 0]), 3));
    const material = new RawShaderMaterial({
      glslVersion: GLSL3, vertexShader: kVertexShader, fragmentShader: kFragmentShader,
      uniforms: { color: { value: this.target.texture }, depth: { value: this.target.depthTexture } },
    });
    const all = new Mesh(geometry, material);
    all.frustumCulled = all.matrixAutoUpdate = all.matrixWorldAutoUpdate = this.scene.matrixWorldAutoUpdate = false;
    this.scene.add(all);
  }

  resize(width: number, height: number): void {
    this.target.setSize(width, height);
    this.isOutdated = true;
  }

  /** What stays looks different now. */
  outdate(): void {
    this.isOutdated = true;
  }

  /** Draws what stays to the screen, colour and depth, over what is there. `eye`: names the camera. `drawAfresh` is called where the
   *  picture is outdated or another eye's; it clears first. */
  draw(camera: Camera, eye: string, drawAfresh: () => void): void {
    if (this.isOutdated || eye !== this.eye) {
      this.renderer.setRenderTarget(this.target);
      drawAfresh();
      this.renderer.setRenderTarget(null);
      this.isOutdated = false;
      this.eye = eye;
    }
    this.renderer.clearDepth();
    this.renderer.render(this.scene, camera);
  }
}
