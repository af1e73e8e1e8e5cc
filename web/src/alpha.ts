import { Malformed, require } from "./bytes.ts";
import type { AlphaPlane } from "./packet.ts";

/** The binary alpha plane of a picture: where it is 0, what the picture textures is not drawn. */
export interface Alpha {
  /** Side of the square of the picture's pixels that one pixel of the plane stands for. */
  readonly stepPx: number;
  readonly width: number;
  readonly height: number;
  /** 0 or 255 each, rows from the top, without gaps. */
  readonly pixels: Uint8Array<ArrayBuffer>;
}

/** Decodes a plane for a picture of this size. Throws Malformed and nothing else. */
export function alphaFor(plane: AlphaPlane, picture: { readonly width: number; readonly height: number }): Alpha {
  const { stepPx, width, height, data } = plane;
  const fits = width === Math.ceil(picture.width / stepPx) && height === Math.ceil(picture.height / stepPx);
  require(fits, "an alpha plane that is not of its picture's size");
  return { stepPx, width, height, pixels: decodeAlpha(data, width, height) };
}

const kBlockPx = 8;
const [kZeros, kOnes, kMixed] = [0, 1, 2];

// The range coder of LZMA: probabilities of a 0 in 2048ths.
const kProbabilityBits = 11;
const kAdaptation = 4;
const kLeastRange = 1 << 24;
const kEven = 1 << (kProbabilityBits - 1);

/** Beyond the end it reads zeros. */
class RangeDecoder {
  private read = 0;
  private range = 0xffffffff;
  private code = 0;

  constructor(private readonly bytes: Uint8Array) {
    for (let i = 0; i < 4; ++i) this.code = ((this.code << 8) | this.next()) >>> 0;
  }

  /** The next bit; `zeros[at]` is the probability that it is 0, and adapts. */
  bit(zeros: Uint16Array, at: number): number {
    const zero = zeros[at]!;
    const bound = (this.range >>> kProbabilityBits) * zero; // below 2^32
    const isOne = this.code >= bound;
    if (isOne) {
      this.code -= bound;
      this.range -= bound;
      zeros[at] = zero - (zero >> kAdaptation);
    } else {
      this.range = bound;
      zeros[at] = zero + (((1 << kProbabilityBits) - zero) >> kAdaptation);
    }
    while (this.range < kLeastRange) {
      this.range = (this.range << 8) >>> 0;
      this.code = ((this.code << 8) | this.next()) >>> 0;
    }
    return isOne ? 1 : 0;
  }

  hasReadAll(): boolean {
    return this.read >= this.bytes.length;
  }

  private next(): number {
    const at = this.read++;
    return at < this.bytes.length ? this.bytes[at]! : 0;
  }
}

function evenly(count: number): Uint16Array {
  return new Uint16Array(count).fill(kEven);
}

const kRowsAbove = 2; // of zeros

/** Fills a plane in, block by block. */
class PlaneDecoder {
  private readonly padded: Uint8Array<ArrayBuffer>;
  // By the kinds of the blocks to the left and above; by the pixels around.
  private readonly mixed = evenly(9);
  private readonly ones = evenly(9);
  private readonly pixel = evenly(1 << 10);

  constructor(private readonly coder: RangeDecoder, private readonly width: number, private readonly height: number) {
    this.padded = new Uint8Array(width * (height + kRowsAbove));
  }

  run(): Uint8Array<ArrayBuffer> {
    const columns = Math.ceil(this.width / kBlockPx);
    const above = new Uint8Array(columns).fill(kZeros);
    for (let y = 0; y < this.height; y += kBlockPx)
      for (let column = 0, left = kZeros; column < columns; ++column)
        left = above[column] = this.block(column * kBlockPx, y, 3 * left + above[column]!);
    return this.padded.subarray(kRowsAbove * this.width);
  }

  /** Its kind. */
  private block(x: number, y: number, around: number): number {
    const right = Math.min(x + kBlockPx, this.width);
    const bottom = Math.min(y + kBlockPx, this.height);
    if (this.coder.bit(this.mixed, around) === 1) {
      for (let row = y; row < bottom; ++row) this.row(x, right, row, y);
      return kMixed;
    }
    if (this.coder.bit(this.ones, around) === 0) return kZeros;
    for (let row = y; row < bottom; ++row) this.padded.fill(255, this.begin(row) + x, this.begin(row) + right);
    return kOnes;
  }

  private begin(row: number): number {
    return (row + kRowsAbove) * this.width;
  }

  /** A row of a mixed block that begins at (`x`, `top`) and ends before `right`. Ten known pixels tell how likely a pixel is: two before
   *  it, five above, three above these. Those that are not known yet, or not in the plane, are as the last one before them in their row. */
  private row(x: number, right: number, y: number, top: number): void {
    const { padded, width } = this;
    const [here, up, up2] = [this.begin(y), this.begin(y - 1), this.begin(y - 2)];
    const lastUp = up + (y - 1 < top ? width : right) - 1;
    const lastUp2 = up2 + (y - 2 < top ? width : right) - 1;
    const first = x === 0 ? 0 : x - 1;
    // The nearer one before in the higher bit; else the one to the left.
    let before = x === 0 ? 0 : (bitOf(padded, here + x - 1) << 1) | bitOf(padded, here + x - 2);
    let above = (bitOf(padded, up + (x === 0 ? 0 : x - 2)) << 3) | (bitOf(padded, up + first) << 2) |
      (bitOf(padded, up + x) << 1) | bitOf(padded, Math.min(up + x + 1, lastUp));
    let above2 = (bitOf(padded, up2 + first) << 1) | bitOf(padded, up2 + x);
    for (let column = x; column < right; ++column) {
      above = ((above << 1) | bitOf(padded, Math.min(up + column + 2, lastUp))) & 31;
      above2 = ((above2 << 1) | bitOf(padded, Math.min(up2 + column + 1, lastUp2))) & 7;
      const bit = this.coder.bit(this.pixel, (before << 8) | (above << 3) | above2);
      if (bit === 1) padded[here + column] = 255;
      before = column === 0 ? 3 * bit : (bit << 1) | (before >> 1);
    }
  }
}

function bitOf(pixels: Uint8Array, at: number): number {
  return pixels[at]! & 1;
}

/** The plane of this size, 0 or 255 a pixel, as decode_alpha() of src/mr/codec/alpha_codec.h: docs/wire-format.md, Alpha planes. Bytes that
 *  are more than it has use for throw Malformed; whatever other bytes there are, they are a plane. */
export function decodeAlpha(bytes: Uint8Array, width: number, height: number): Uint8Array<ArrayBuffer> {
  const coder = new RangeDecoder(bytes);
  const pixels = new PlaneDecoder(coder, width, height).run();
  if (!coder.hasReadAll()) throw new Malformed("alpha plane: more bytes than it has use for");
  return pixels;
}
