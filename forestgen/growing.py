"""The `grow` command's work: a written tree gets the animation of its growth, and the report its film."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forestgen.build_record import BUILD
from forestgen.errors import InputError
from forestgen.pipeline import check_output
from forestgen.reference import read_provenance
from forestgen.staging import install, staging
from forestgen.tree.growth import Anchors, GrowingTree, Growth, Pose
from forestgen.tree.growth_binding import bind_mesh
from forestgen.tree.growth_keys import gap, key_frames
from forestgen.tree.growth_leaves import GrowingLeaves, bound_leaves, slerp
from forestgen.usd.growth import FILM, LAYER, GrowthLayer, StillTree, read_still, write_variants
from forestgen.workers import OnProgress

MOST_BYTES = 38e6  # of samples in growth.usdc, unless all frames are asked for
MOST_FRAMES = 10_000
TURNED_EVERY = 3  # keys between two samples of normals and of leaves' orientations, which change slowly

OnFrame = Callable[[int, int], None]  # called with (done, total)


@dataclass(frozen=True)
class GrowthFilm:
    """What was written."""

    asset: Path  # <name>.usda, now with the variant set
    film: Path  # growing.usda
    frames: int
    samples: int
    error: float  # m, how far wood strays between samples from its place in that frame
    error_share: float  # of the tree's height
    megabytes: float

    def summary(self) -> dict[str, object]:
        """For scripts; paths relative to the tree's folder."""
        return {
            "asset": self.asset.name,
            "film": self.film.name,
            "frames": self.frames,
            "samples": self.samples,
            "error_m": round(self.error, 6),
            "error_share": round(self.error_share, 6),
            "megabytes": round(self.megabytes, 3),
        }

    def words(self) -> str:
        """For people, in one line."""
        strays = f"at most {100 * self.error:.1f} cm ({100 * self.error_share:.2g} % of the height) astray between them"
        exact = self.samples == self.frames
        return (
            f"{self.film}: {self.frames} frames, {self.samples} samples, {'every frame' if exact else strays},"
            f" {self.megabytes:.1f} MB; {self.asset.name} has the variants growth = static, animated"
        )


def grow_and_show(
    folder: Path,
    growth: Growth,
    *,
    frames: int = 180,
    fps: float = 24.0,
    tolerance: float = 0.005,
    every_frame: bool = False,
    film: bool = True,
    on_progress: OnProgress | None = None,
) -> GrowthFilm:
    """Let a written tree grow (`grow_tree`), draw its film and, where it is part of a build, write the report anew.

    Raises:
        InputError, OSError: as `grow_tree`.
        RenderError: the animation is written, but there is no OpenGL to draw it with.
    """

    def told(stage: str) -> OnFrame:
        return lambda done, total: on_progress(0, stage, done, total) if on_progress else None

    made = grow_tree(
        folder,
        growth,
        frames=frames,
        fps=fps,
        tolerance=tolerance,
        every_frame=every_frame,
        on_frame=told("grow"),
    )
    if film:
        show_film(made, told("film"))
        out = made.asset.parents[2]
        if (out / BUILD).is_file():
            told("check")(0, 0)
            check_output(out)
    if on_progress:
        on_progress(0, "", 0, 0)
    return made


def grow_tree(
    folder: Path,
    growth: Growth,
    *,
    frames: int = 180,
    fps: float = 24.0,
    tolerance: float = 0.005,
    every_frame: bool = False,
    on_frame: OnFrame | None = None,
) -> GrowthFilm:
    """Add the growth of a written tree to its asset: OUT/trees/NAME of any method.

    Time runs from 1 / frames to 1 in frames 1 .. `frames`; the last frame is the still tree to the bit.
    Samples are written for as few frames as keep the wood within `tolerance` times the tree's height
    of where it is in each frame (readers interpolate), and for no more than fit MOST_BYTES. An earlier
    animation is replaced. All is made beside and moved into place.

    Raises:
        InputError: a setting makes no sense, or the folder is no tree.
        OSError: it could not be written; the tree is as it was.
    """
    growth.check()
    check_frames(frames, fps, tolerance)
    folder = Path(folder).resolve()
    asset = folder / f"{folder.name}.usda"
    if not asset.is_file():
        raise InputError(f"{folder}: holds no {asset.name}; expected the folder of a built tree, OUT/trees/NAME")
    still, skeleton = read_still(asset), read_provenance(folder / "reference").skeleton
    tree = growth(skeleton)
    height = float(np.ptp(still.points[:, 1])) or 1.0
    most = frames if every_frame else max(2, int(MOST_BYTES / bytes_per_key(still, growth.tropism_deg != 0)))
    if every_frame:
        keys, error = np.arange(1, frames + 1), 0.0
    else:
        leaf = float(still.leaf_scale.max(initial=0))
        keys, error = key_frames(tree, leaf, frames, tolerance * height, most)
    layer = GrowthLayer(still, fps, frames)
    add_samples(layer, tree, still, keys, frames, on_frame)
    notes = {
        "mode": growth.mode,
        "tropism_deg": float(growth.tropism_deg),
        "samples": len(keys),
        "error_m": round(error, 6),
    }
    with staging(folder.parent) as work:
        layer.save(work)
        write_variants(asset, work, layer.boxes, fps, frames, notes)
        install(work, folder, [LAYER, FILM, asset.name])
    size = (folder / LAYER).stat().st_size / 1e6
    return GrowthFilm(asset, folder / FILM, frames, len(keys), error, error / height, size)


def show_film(made: GrowthFilm, on_frame: OnFrame | None = None) -> Path:
    """Draw a strip and a moving preview of a grown tree into OUT/report/<tree>; returns that folder.

    The report shows them from its next check on.

    Raises:
        RenderError: no OpenGL to render with.
        OSError: a picture could not be written; earlier ones are as they were.
    """
    from forestgen.check.film import PREVIEW, STRIP, draw_film

    name, out = made.asset.parent.name, made.asset.parents[2]
    with staging(out) as work:
        draw_film(made.film, made.frames, work, on_frame)
        install(work, out / "report" / name, [STRIP, PREVIEW])
    return out / "report" / name


def check_frames(frames: int, fps: float, tolerance: float) -> None:
    """Refuse lengths and speeds that make no film.

    Raises:
        InputError: names the setting.
    """
    if not 2 <= frames <= MOST_FRAMES:
        raise InputError(f"--frames: expected 2 to {MOST_FRAMES}, came {frames}: a film has a first and a last frame")
    if not (isfinite(fps) and 0 < fps <= 1000):
        raise InputError(f"--fps: expected frames a second above 0 and at most 1000, came {fps:g}")
    if not 0 < tolerance < 1:
        raise InputError(f"--tolerance: expected a share of the tree's height between 0 and 1, came {tolerance:g}")


def bytes_per_key(still: StillTree, is_bent: bool) -> float:
    """How much one sample of all attributes takes, with what is sampled at every TURNED_EVERY-th key only."""
    n_leaves = len(still.leaf_position)
    return 12 * len(still.kept) * (1 + is_bent / TURNED_EVERY) + n_leaves * (24 + 8 / TURNED_EVERY)


def add_samples(
    layer: GrowthLayer,
    tree: GrowingTree,
    still: StillTree,
    keys: NDArray[np.int64],
    frames: int,
    on_frame: OnFrame | None = None,
) -> None:
    """Pose the tree at each key frame (K,) and add its samples; the last is what is stored."""
    wood = bind_mesh(still.points.astype(float), still.faces, tree.skeleton)
    under = tree.wood(wood)
    leaves, ahead = growing_leaves(tree, still), gap(keys, frames)
    turned = np.unique([*keys[::TURNED_EVERY].tolist(), keys[-1]])
    turns = {} if leaves is None else leaf_turns(tree, leaves, still, turned, frames)
    for k, frame in enumerate(keys):
        is_last, is_turned = frame == keys[-1], frame in turned
        at = tree.pose(int(frame) / frames, ahead)
        normals = None
        if is_turned and tree.bend.any():
            normals = still.normals if is_last else turned_normals(still, wood, at)
        points = still.points if is_last else tree.carried(wood, at, tree.thickness(under, at.time))
        layer.add_branches(int(frame), points, normals)
        if leaves is not None:
            position = still.leaf_position if is_last else leaves.position_at(tree, at)
            scale = still.leaf_scale if is_last else leaves.scale_at(tree, at.time)
            layer.add_leaves(int(frame), position, scale, turn_between(turns, int(frame)), is_turned)
        if on_frame:
            on_frame(k + 1, len(keys))


def growing_leaves(tree: GrowingTree, still: StillTree) -> GrowingLeaves | None:
    """The leaves of a tree bound to it; None on a bare tree."""
    if not len(still.leaf_position):
        return None
    turn = still.leaf_turn.astype(float)[:, [3, 0, 1, 2]]
    return bound_leaves(tree, still.leaf_position.astype(float), turn, still.leaf_scale.astype(float))


def leaf_turns(
    tree: GrowingTree, leaves: GrowingLeaves, still: StillTree, turned: NDArray[np.int64], frames: int
) -> dict[int, NDArray[np.float16]]:
    """The leaves' stored quaternions (L, 4) i j k real in the frames (T,) that have samples of them."""
    turns = {int(f): stored_turn(leaves.orientation_at(tree, tree.pose(int(f) / frames)), still) for f in turned[:-1]}
    return {**turns, int(turned[-1]): still.leaf_turn}


def turn_between(turns: dict[int, NDArray[np.float16]], frame: int) -> NDArray[np.float16]:
    """What a reader makes of samples of quaternions (L, 4) in a frame."""
    if frame in turns:
        return turns[frame]
    low, high = max(f for f in turns if f < frame), min(f for f in turns if f > frame)
    share = np.full(len(turns[low]), (frame - low) / (high - low))
    return slerp(turns[low].astype(float), turns[high].astype(float), share).astype(np.float16)


def turned_normals(still: StillTree, wood: Anchors, at: Pose) -> NDArray[np.float32]:
    """The mesh's normals (P, 3) in a pose; none where the mesh has none."""
    if not len(still.normals):
        return still.normals
    return np.asarray(np.einsum("pij,pj->pi", at.turn[wood.node], still.normals), np.float32)


def stored_turn(orientation: NDArray[np.float64], still: StillTree) -> NDArray[np.float16]:
    """Quaternions (L, 4) w x y z as stored, i j k real.

    Of the two that mean the same turn it is the one nearer to the finished leaf's: no reader spins the leaf.
    """
    turn = orientation[:, [1, 2, 3, 0]]
    same = np.sum(turn * still.leaf_turn.astype(float), axis=1, keepdims=True) >= 0
    return np.where(same, turn, -turn).astype(np.float16)
