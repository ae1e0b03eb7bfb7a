"""Drawn photos with known mattes: a trunk, a crown of leaf discs with gaps, sky, hill and grass, in any colours."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.photo import Photo
from forestgen.tree.strokes import Strokes

W, H = 360, 420
CENTRE, CROWN_RADIUS = (180, 160), 110
GROUND = 330  # row of the horizon
ROOT = (180.0, 395.0)
TRUNK_WIDTH = 22


@dataclass(frozen=True, eq=False)
class Scene:
    photo: Photo
    strokes: Strokes
    is_leaf: NDArray[np.bool_]  # (H, W) the truth
    is_wood: NDArray[np.bool_]  # (H, W)

    @property
    def is_tree(self) -> NDArray[np.bool_]:
        return self.is_leaf | self.is_wood


def outline(radius: float = CROWN_RADIUS + 6) -> NDArray[np.float64]:
    """A crown stroke (32, 2) px a little outside the leaves."""
    angle = np.linspace(0, 2 * np.pi, 32, endpoint=False)
    return np.array(CENTRE) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def trunk_stroke() -> NDArray[np.float64]:
    """A stroke up the trunk that wobbles inside it."""
    row = np.linspace(ROOT[1], 180, 12)
    return np.stack([ROOT[0] + 5 * np.sin(row / 17), row], axis=1)


def strokes(**changes: object) -> Strokes:
    drawn: dict[str, object] = {"crown": outline(), "branches": (trunk_stroke(),), "size": (W, H)}
    return Strokes(**(drawn | changes))  # type: ignore[arg-type]


def backdrop(sky: tuple[int, ...], grass: tuple[int, ...]) -> NDArray[np.float64]:
    """Sky that brightens downwards, and ground, (H, W, 3)."""
    picture = np.empty((H, W, 3))
    picture[:] = np.array(sky) + np.linspace(-20, 20, H)[:, None, None]
    picture[GROUND:] = grass
    return picture


def leafy(
    leaf: tuple[int, ...] = (60, 120, 40),
    bark: tuple[int, ...] = (95, 75, 60),
    sky: tuple[int, ...] = (150, 180, 220),
    grass: tuple[int, ...] = (120, 130, 60),
    seed: int = 0,
) -> Scene:
    """A tree whose crown is leaf discs with gaps, the trunk hidden by them here and there."""
    rng = np.random.default_rng(seed)
    wood = np.zeros((H, W), np.uint8)
    half = TRUNK_WIDTH // 2
    cv2.rectangle(wood, (180 - half, 150), (180 + half - 1, 394), 1, -1)
    leaves = np.zeros((H, W), np.uint8)
    while leaves[40:280, 60:300].mean() < 0.45:
        angle, distance = rng.uniform(0, 2 * np.pi), CROWN_RADIUS * rng.uniform() ** 0.5
        x, y = CENTRE + (distance - 8) * np.array([np.cos(angle), np.sin(angle)])
        cv2.circle(leaves, (int(x), int(y)), int(rng.integers(4, 9)), 1, -1)
    is_leaf = leaves > 0
    return _photographed(is_leaf, (wood > 0) & ~is_leaf, backdrop(sky, grass), leaf, bark, rng, strokes())


def bare(bark: tuple[int, ...] = (70, 60, 55), sky: tuple[int, ...] = (180, 190, 205)) -> Scene:
    """A tree of straight twigs alone."""
    rng = np.random.default_rng(1)
    wood = np.zeros((H, W), np.uint8)
    half = TRUNK_WIDTH // 2
    cv2.rectangle(wood, (180 - half, 150), (180 + half - 1, 394), 1, -1)
    for _ in range(26):
        angle = rng.uniform(-2.9, -0.25)
        start = np.array([180, rng.uniform(150, 240)])
        for step in range(3):
            end = start + 38 * np.array([np.cos(angle), np.sin(angle)])
            if np.linalg.norm(end - CENTRE) > CROWN_RADIUS:
                break
            cv2.line(wood, start.astype(int).tolist(), end.astype(int).tolist(), 1, 4 - step)
            start, angle = end, angle + rng.uniform(-0.5, 0.5)
    is_wood = wood > 0
    return _photographed(np.zeros_like(is_wood), is_wood, backdrop(sky, (120, 120, 110)), bark, bark, rng, strokes())


def _photographed(
    is_leaf: NDArray[np.bool_],
    is_wood: NDArray[np.bool_],
    picture: NDArray[np.float64],
    leaf: tuple[int, ...],
    bark: tuple[int, ...],
    rng: np.random.Generator,
    drawn: Strokes,
) -> Scene:
    shade = rng.normal(0, 12, (H // 6, W // 6)).astype(np.float32)
    shade = cv2.resize(shade, (W, H), interpolation=cv2.INTER_LINEAR)[..., None]
    picture[is_leaf] = (np.array(leaf) + shade)[is_leaf]
    picture[is_wood] = (np.array(bark) + 0.5 * shade)[is_wood]
    picture = cv2.GaussianBlur(picture, (0, 0), 0.6) + rng.normal(0, 2, picture.shape)
    photo = Photo(np.clip(np.round(picture), 0, 255).astype(np.uint8), "drawn.png")
    return Scene(photo, drawn, is_leaf, is_wood)


def overlap(a: NDArray[np.bool_], b: NDArray[np.bool_]) -> float:
    """Intersection over union."""
    return float((a & b).sum() / max(1, (a | b).sum()))
