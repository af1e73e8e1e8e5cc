#!/usr/bin/env python3
"""Values of scikit-image for the pictures in a folder.

    /usr/bin/python3 tests/data/ssim/make_values.py tests/data/ssim > tests/data/ssim/values.json
    /usr/bin/python3 tests/data/ssim/make_values.py --pictures tests/data/ssim      draws them anew

Each REFERENCE.png is compared with each REFERENCE-DISTORTION.png beside it; mask.png (not black:
of interest) says what counts for "masked" and "psnr". values.json was made with scikit-image 0.19.3,
the pictures also with SciPy 1.10.1 and NumPy 1.24.2.
"""
import json
import pathlib
import sys

import numpy as np
from PIL import Image
from scipy import ndimage
from skimage.metrics import structural_similarity

SIZE = (93, 122)  # rows, columns


def luma(file):
    rgb = np.asarray(Image.open(file).convert("RGB"), dtype=np.float64)
    return rgb @ np.array([0.2126, 0.7152, 0.0722])


def compare(reference, test, mask):
    full, similarity = structural_similarity(
        reference, test, gaussian_weights=True, sigma=1.5, use_sample_covariance=False,
        data_range=255, full=True)
    windows = ndimage.maximum_filter(mask, size=11, mode="constant")[5:-5, 5:-5]
    mean_square = np.mean((reference - test)[mask] ** 2)
    return {"full": full, "masked": similarity[5:-5, 5:-5][windows].mean(),
            "psnr": 10 * np.log10(255**2 / mean_square) if mean_square > 0 else 100.0}


def values(folder):
    mask = luma(folder / "mask.png") > 0
    out = {}
    for file in sorted(folder.glob("*-*.png")):
        reference = folder / (file.stem.split("-")[0] + ".png")
        out[file.stem] = compare(luma(reference), luma(file), mask)
    return out


def distorted(picture, random):
    blocks = picture.copy()
    for y in range(0, SIZE[0], 8):
        for x in range(0, SIZE[1], 8):
            blocks[y:y + 8, x:x + 8] = picture[y:y + 8, x:x + 8].mean(axis=(0, 1))
    return {
        "blur": ndimage.gaussian_filter(picture, (2, 2, 0)),
        "noise": picture + random.normal(0, 12, picture.shape),
        "grain": picture + random.normal(0, 0.6, picture.shape),
        "shift": np.roll(picture, 2, axis=1),
        "blocks": blocks,
        "bright": picture + 40,
        "inverted": 255 - picture,
    }


def draw(folder):
    random = np.random.default_rng(1)
    y, x = np.mgrid[:SIZE[0], :SIZE[1]].astype(float)
    scene = np.stack([2 * x, 255 - 2 * y, 100 + 60 * np.sin(x / 3) * np.cos(y / 5)], axis=2)
    scene[20:60, 30:70] = [200, 40, 30]
    scene[40:80, 60:110] += ndimage.gaussian_filter(random.normal(0, 300, (40, 50, 1)), (1, 1, 0))
    flat = np.full(SIZE + (3,), 250.0)
    flat[:, :40] = 3
    flat[50:, 80:] = [250, 251, 252]
    mask = np.zeros(SIZE + (3,))
    mask[25:55, 35:50] = mask[0, 0] = mask[70, 110:] = 255
    pictures = {"mask": mask}
    for name, picture in {"scene": scene, "flat": flat}.items():
        pictures[name] = picture = np.clip(np.round(picture), 0, 255)
        for distortion, result in distorted(picture, random).items():
            pictures[f"{name}-{distortion}"] = result
    for name, picture in pictures.items():
        Image.fromarray(np.clip(np.round(picture), 0, 255).astype(np.uint8)).save(
            folder / f"{name}.png", optimize=True)


if __name__ == "__main__":
    if sys.argv[1] == "--pictures":
        draw(pathlib.Path(sys.argv[2]))
    else:
        print(json.dumps(values(pathlib.Path(sys.argv[1])), indent=2))
