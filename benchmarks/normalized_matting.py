"""Is normalized matting (Kim & Jeong 2014, eq. 3) better than closed form? Arguments: SHARED_FOLDER [TREE ...]

Both objectives on the same scribbles, the same Laplacian, against known alpha: the paper's toy images
redrawn (fig. 2: 150 x 100 px), and leaf and wood of the trees of known truth. Dabs of 5 px are laid at random
where the truth is plain: few or many. SAD (thousands of px), MSE (thousandths), gradient error (Rhemann
et al. 2009, sigma 1.4) over all pixels; eq. 3 of both mattes as a share of the true alpha's: far below 1,
the criterion prefers a wrong matte, whoever solves it; processor seconds of PyMatting's closed form and of ours,
at full size too. The paper's Table 1 compares the two objectives' own values, which says nothing about mattes.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import redirect_stdout
from pathlib import Path
from time import process_time

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.photo import load_photo
from forestgen.tree.segment.laplacian import matting_laplacian
from forestgen.tree.segment.matte_pyramid import normalized_alpha
from forestgen.tree.segment.matte_ratio import Criterion
from forestgen.tree.segment.trimap import BACKGROUND, TREE, UNKNOWN

Picture = NDArray[np.float64]
FINE = 4  # toy images are drawn so much larger and shrunk: their edges are mixed as a photo's are
DAB = 2  # radius in px
NUMBERS = {"few": 10, "many": 500}  # dabs a side in a photo
EPSILON, TOY_EPSILON = 1e-4, 1e-7  # a photo has noise; the toys are lines in colour but for theirs
SHARES = ("closed form eq. 3 / truth's", "normalized eq. 3 / truth's")
PLAIN = (0.01, 0.99)  # alpha below and above which a dab may be laid


def toy(kind: str, noise: float) -> tuple[Picture, Picture]:
    """A toy image (100, 150, 3) and its alpha: a disc, a forked trunk or two rings, shaded, on a shaded ground."""
    big = np.zeros((100 * FINE, 150 * FINE), np.uint8)
    if kind == "disc":
        cv2.circle(big, (75 * FINE, 50 * FINE), 30 * FINE, 1, -1)
    elif kind == "rings":
        for radius in (18, 38):
            cv2.circle(big, (75 * FINE, 50 * FINE), radius * FINE, 1, 6 * FINE)
        cv2.line(big, (75 * FINE, 68 * FINE), (75 * FINE, 88 * FINE), 1, 5 * FINE)
    else:
        for start, end, width in (((75, 95), (75, 50), 9), ((75, 52), (45, 15), 6), ((75, 52), (110, 18), 6)):
            cv2.line(big, np.multiply(start, FINE).tolist(), np.multiply(end, FINE).tolist(), 1, width * FINE)
    alpha = np.asarray(cv2.resize(big.astype(np.float64), (150, 100), interpolation=cv2.INTER_AREA))
    y, x = np.mgrid[:100, :150] / np.array([100, 150]).reshape(2, 1, 1)
    shade = 0.15 * (np.stack([x, y, x / 2], axis=2) - 0.4)
    wood, sky = np.array([0.35, 0.25, 0.15]) + shade, np.array([0.65, 0.75, 0.9]) - shade
    picture = alpha[..., None] * wood + (1 - alpha[..., None]) * sky
    grain = np.random.default_rng(0).normal(0, noise, picture.shape)
    return np.clip(picture + grain, 0, 1), alpha.astype(np.float64)


def dabs(alpha: Picture, number: int) -> Picture:
    """A trimap (h, w): so many dabs a side at random where the truth is plain, one half elsewhere."""
    rng, trimap = np.random.default_rng(number), np.full(alpha.shape, UNKNOWN)
    block = np.ones((2 * DAB + 1, 2 * DAB + 1), np.uint8)
    for value, is_plain in ((BACKGROUND, alpha < PLAIN[0]), (TREE, alpha > PLAIN[1])):
        inner = cv2.erode(is_plain.astype(np.uint8), block)
        place = np.flatnonzero(inner if inner.any() else is_plain)
        chosen = np.zeros(alpha.size, np.uint8)
        chosen[rng.choice(place, min(number, len(place)), replace=False)] = 1
        trimap[(cv2.dilate(chosen.reshape(alpha.shape), block) > 0) & is_plain] = value
    return trimap


def truths(shared: Path, wanted: list[str], size: float) -> Iterator[tuple[str, Picture, Picture]]:
    """(name, rgb, alpha) of leaf and of wood in the front photo of each tree of known truth, at a share of its size."""
    for photo in sorted((shared / "ground_truth").glob("*/photo_az000.jpg")):
        if wanted and photo.parent.name not in wanted:
            continue
        pictures = load_photo(photo).rgb, load_photo(photo.with_name("photo_az000_mask.png")).rgb
        rgb, mask = (
            np.asarray(cv2.resize(p / 255.0, None, fx=size, fy=size, interpolation=cv2.INTER_AREA), np.float64)
            for p in pictures
        )
        for name, channel in (("leaf", 0), ("wood", 1)):
            alpha = np.ascontiguousarray(mask[..., channel])
            if (alpha > PLAIN[1]).sum() > 100:
                yield f"{photo.parent.name} {name}", rgb, alpha


def slope(alpha: Picture) -> Picture:
    """Length of the gradient (h, w) of alpha, seen with sigma 1.4."""
    smooth = cv2.GaussianBlur(alpha, (0, 0), 1.4)
    down, right = np.gradient(smooth)
    return np.asarray(np.hypot(down, right))


def errors(found: Picture, truth: Picture) -> tuple[float, float, float]:
    """SAD in thousands, MSE in thousandths, gradient error."""
    away = found - truth
    return (
        float(np.abs(away).sum() / 1e3),
        float((away**2).mean() * 1e3),
        float(((slope(found) - slope(truth)) ** 2).sum()),
    )


def closed_form(rgb: Picture, trimap: Picture, epsilon: float) -> Picture:
    """PyMatting's, as it comes; what it prints of its preconditioner goes to the error stream."""
    from pymatting import estimate_alpha_cf

    with redirect_stdout(sys.stderr):
        return np.asarray(estimate_alpha_cf(rgb, trimap, laplacian_kwargs={"epsilon": epsilon}))


def criterion(rgb: Picture, alpha: Picture, epsilon: float) -> float:
    """Eq. 3 of a matte (h, w)."""
    laplacian = matting_laplacian(rgb, 1, epsilon)
    pixels = np.flatnonzero(laplacian.pad(np.ones(alpha.shape, bool)))
    flat = laplacian.pad(alpha)
    return Criterion(laplacian, pixels, pixels[:0], flat).value(flat)


def row(name: str, rgb: Picture, truth: Picture, trimap: Picture, epsilon: float) -> list[float]:
    """Print one line of the table; what it says."""
    start = process_time()
    by_form = closed_form(rgb, trimap, epsilon)
    middle = process_time()
    by_ratio, minimum = normalized_alpha(rgb, trimap, epsilon=epsilon)
    seconds = (middle - start, process_time() - middle)
    of_truth = criterion(rgb, truth, epsilon)
    shares = [criterion(rgb, alpha, epsilon) / of_truth for alpha in (by_form, by_ratio)]
    values = [*errors(by_form, truth), *errors(by_ratio, truth), *shares, *seconds, seconds[1] / max(seconds[0], 1e-9)]
    told = "" if minimum.is_converged else f" (residual {minimum.residual:.0e})"
    print(f"| {name}{told} | " + " | ".join(f"{v:.3g}" for v in values) + " |", flush=True)
    return values


def strip(kind: str, noise: float, number: int) -> NDArray[np.uint8]:
    """The picture for the docs (100, 600, 3): toy image with its dabs, truth, closed form, normalized."""
    rgb, alpha = toy(kind, noise)
    trimap = dabs(alpha, number)
    drawn = np.where((trimap != UNKNOWN)[..., None], trimap[..., None], rgb)
    mattes = [alpha, closed_form(rgb, trimap, TOY_EPSILON), normalized_alpha(rgb, trimap, epsilon=TOY_EPSILON)[0]]
    grey = [np.repeat(matte[..., None], 3, axis=2) for matte in mattes]
    return np.round(np.concatenate([drawn, *grey], axis=1) * 255).astype(np.uint8)


def table(title: str, rows: Iterator[tuple[str, Picture, Picture, Picture, float]]) -> None:
    """One table in GitHub Markdown and its mean."""
    sides = [f"{of} {what}" for of in ("closed form", "normalized") for what in ("SAD", "MSE", "gradient")]
    columns = [*sides, *SHARES, "closed form s", "normalized s", "time ratio"]
    print(f"\n| {title} | " + " | ".join(columns) + " |\n| --- |" + " ---: |" * len(columns))
    values = [row(*one) for one in rows]
    if values:
        print("| **mean** | " + " | ".join(f"{v:.3g}" for v in np.mean(values, axis=0)) + " |")


def toys(number: int) -> Iterator[tuple[str, Picture, Picture, Picture, float]]:
    for kind in ("disc", "fork", "rings"):
        for noise in (0.0, 0.01):
            rgb, alpha = toy(kind, noise)
            yield f"{kind}, noise {noise}", rgb, alpha, dabs(alpha, number), TOY_EPSILON


def main() -> None:
    shared = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[2] / "shared"
    wanted = sys.argv[2:]
    if not (shared / "ground_truth").is_dir():
        print("skipped: no folder 'shared' with ground truth beside this checkout")
        return
    warm, alpha = toy("disc", 0.0)
    closed_form(warm, dabs(alpha, 3), EPSILON)
    normalized_alpha(warm, dabs(alpha, 3), epsilon=EPSILON)
    for number in (1, 20):
        table(f"toy image, {number} dabs a side", toys(number))
    for how, number in NUMBERS.items():
        cases = truths(shared, wanted, 0.5)
        table(f"half size, {how} dabs", ((n, rgb, a, dabs(a, number), EPSILON) for n, rgb, a in cases))
    for how, number in NUMBERS.items():
        first = list(truths(shared, wanted or ["oak_winter"], 1.0))[-1:]
        table(f"full size, {how} dabs", ((n, rgb, a, dabs(a, number), EPSILON) for n, rgb, a in first))


if __name__ == "__main__":
    main()
