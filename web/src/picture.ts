/** One decoded picture's bytes, rows without gaps. Y'CbCr is BT.709, limited range, 4:2:0. */
export interface Picture {
  readonly width: number;
  readonly height: number;
  /** i420: Y, Cb and Cr; nv12: Y and CbCr; rgba: where the decoder gives no planes. */
  readonly format: "i420" | "nv12" | "rgba";
  readonly planes: readonly Uint8Array<ArrayBuffer>[];
}

interface PlaneSize {
  readonly width: number;
  readonly height: number;
  readonly components: number;
}

export function planeSizes({ width, height, format }: Pick<Picture, "width" | "height" | "format">): PlaneSize[] {
  const [w, h] = [width / 2, height / 2];
  switch (format) {
    case "i420":
      return [
        { width, height, components: 1 },
        { width: w, height: h, components: 1 },
        { width: w, height: h, components: 1 },
      ];
    case "nv12":
      return [
        { width, height, components: 1 },
        { width: w, height: h, components: 2 },
      ];
    case "rgba":
      return [{ width, height, components: 4 }];
  }
}

/** Copies what a frame shows. The copy, not the frame, is drawn: how browsers turn a frame into a texture
 *  differs (place of the chroma samples, matrix), and a kept frame stalls some decoders. */
export async function copyPicture(frame: VideoFrame): Promise<Picture> {
  const { width, height } = frame.visibleRect ?? { width: frame.codedWidth, height: frame.codedHeight };
  const format = frame.format === "I420" ? "i420" : frame.format === "NV12" ? "nv12" : "rgba";
  const sizes = planeSizes({ width, height, format });
  const layout: PlaneLayout[] = [];
  let bytes = 0;
  for (const size of sizes) {
    layout.push({ offset: bytes, stride: size.width * size.components });
    bytes += size.width * size.height * size.components;
  }
  const buffer = new Uint8Array(bytes);
  await frame.copyTo(buffer, format === "rgba" ? { layout, format: "RGBA" } : { layout });
  const planes = sizes.map((size, i) => {
    const start = layout[i]!.offset;
    return buffer.subarray(start, start + size.width * size.height * size.components);
  });
  return { width, height, format, planes };
}

const kBlock = 16;

/** The 16-bit number that the server's test variant paints into the top left corner: two rows of eight
 *  blocks of 16 x 16 pixels, white is 1, most significant first. */
export function burntNumber({ planes, width, format }: Picture): number {
  const plane = planes[0]!;
  const components = format === "rgba" ? 4 : 1;
  let number = 0;
  for (let bit = 0; bit < 16; ++bit) {
    const x = ((bit % 8) + 0.5) * kBlock;
    const y = (Math.floor(bit / 8) + 0.5) * kBlock;
    number = 2 * number + (plane[(y * width + x) * components]! >= 128 ? 1 : 0);
  }
  return number;
}
