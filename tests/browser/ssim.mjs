// Structural similarity (Wang et al. 2004): luma, Gaussian window of 11 pixels, sigma 1.5.

const kRadius = 5;
const kWeights = (() => {
  const w = Array.from({ length: 2 * kRadius + 1 }, (_, i) => Math.exp(-((i - kRadius) ** 2) / (2 * 1.5 ** 2)));
  const sum = w.reduce((a, b) => a + b);
  return w.map((v) => v / sum);
})();

/** Blurs rows, then columns; the border repeats. */
function blur(values, width, height) {
  const clamp = (v, most) => Math.min(Math.max(v, 0), most);
  const rows = new Float64Array(values.length);
  const out = new Float64Array(values.length);
  for (let y = 0; y < height; ++y)
    for (let x = 0; x < width; ++x)
      for (let k = -kRadius; k <= kRadius; ++k)
        rows[y * width + x] += kWeights[k + kRadius] * values[y * width + clamp(x + k, width - 1)];
  for (let y = 0; y < height; ++y)
    for (let x = 0; x < width; ++x)
      for (let k = -kRadius; k <= kRadius; ++k)
        out[y * width + x] += kWeights[k + kRadius] * rows[clamp(y + k, height - 1) * width + x];
  return out;
}

/** Mean SSIM of two luma pictures over the pixels of a mask. */
export function maskedSsim(a, b, mask, width, height) {
  const c1 = (0.01 * 255) ** 2;
  const c2 = (0.03 * 255) ** 2;
  const product = (p, q) => p.map((v, i) => v * q[i]);
  const [ma, mb] = [blur(a, width, height), blur(b, width, height)];
  const [aa, bb, ab] = [product(a, a), product(b, b), product(a, b)].map((p) => blur(p, width, height));
  let sum = 0;
  let count = 0;
  for (let i = 0; i < a.length; ++i) {
    if (!mask[i]) continue;
    const [va, vb, vab] = [aa[i] - ma[i] ** 2, bb[i] - mb[i] ** 2, ab[i] - ma[i] * mb[i]];
    sum +=
      ((2 * ma[i] * mb[i] + c1) * (2 * vab + c2)) / ((ma[i] ** 2 + mb[i] ** 2 + c1) * (va + vb + c2));
    ++count;
  }
  return { ssim: sum / count, count };
}

/** Rec. 709 luma of interleaved 8-bit pixels. */
export function luma(pixels, channels) {
  const out = new Float64Array(pixels.length / channels);
  for (let i = 0; i < out.length; ++i)
    out[i] =
      0.2126 * pixels[i * channels] + 0.7152 * pixels[i * channels + 1] + 0.0722 * pixels[i * channels + 2];
  return out;
}
