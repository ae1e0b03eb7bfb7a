"""Build one tree: the stages of a method in their order, each with its own generator and stopwatch."""

from __future__ import annotations

import logging
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter
from typing import TypeVar

import numpy as np

from forestgen.arrays import stage_rng
from forestgen.tree.leaf_sort import sorted_leaves
from forestgen.tree.methods import STAGES, Method
from forestgen.tree.model import TreeModel
from forestgen.tree.painted import paint
from forestgen.tree.photo import Photo
from forestgen.tree.scale import photo_camera
from forestgen.tree.strokes import Strokes
from forestgen.tree.view import View

log = logging.getLogger(__name__)
T = TypeVar("T")

OnStage = Callable[[str, int, int], None]
"""Called as (stage, done, total) while a tree is built; total is 0 where it is not known."""


@dataclass(frozen=True, eq=False)
class Source:
    """One photo of the tree with its strokes, and how its camera stood. Angles in radians."""

    photo: Photo
    strokes: Strokes
    azimuth: float = 0.0
    elevation: float = 0.0
    scale: float = 1.0
    root: tuple[float, float] | None = None
    focal_px: float | None = None


class _Stopwatch:
    """Seconds per stage; a stage that runs twice adds up."""

    def __init__(self, on_stage: OnStage | None) -> None:
        self.seconds: dict[str, float] = dict.fromkeys(STAGES, 0.0)
        self.on_stage = on_stage

    @contextmanager
    def time(self, stage: str) -> Iterator[None]:
        self._tell(stage)
        with self._clock(stage):
            yield

    def aside(self, pool: ThreadPoolExecutor, stage: str, work: Callable[[], T]) -> Callable[[], T]:
        """Begin a stage beside others; call what is returned for its result: only that is reported."""

        def clocked() -> T:
            with self._clock(stage):
                return work()

        begun = pool.submit(clocked)

        def result() -> T:
            self._tell(stage)
            return begun.result()

        return result

    def _tell(self, stage: str) -> None:
        if self.on_stage is not None:
            self.on_stage(stage, 0, 0)

    @contextmanager
    def _clock(self, stage: str) -> Iterator[None]:
        start = perf_counter()
        yield
        spent = perf_counter() - start
        self.seconds[stage] += spent
        log.info("%s: %.2f s", stage, spent)


def build_tree(
    sources: Sequence[Source],
    method: Method,
    *,
    name: str = "tree",
    method_name: str = "tan2008",
    height: float = 10.0,
    seed: int = 0,
    on_stage: OnStage | None = None,
) -> TreeModel:
    """Build a tree `height` metres tall from one or more photos.

    Raises:
        StageError: a photo defeats a stage; the message says which and what to do.
    """
    watch = _Stopwatch(on_stage)
    views = [_look(source, index, method, height, seed, watch) for index, source in enumerate(sources)]
    return _grow(views, method, watch, name=name, method_name=method_name, height=height, seed=seed)


def grow_views(
    views: Sequence[View],
    method: Method,
    *,
    name: str,
    method_name: str,
    height: float,
    seed: int,
    on_stage: OnStage | None = None,
) -> TreeModel:
    """Build a tree from views that are known: mattes, traces and cameras stay as they are.

    Raises:
        StageError: the views defeat a stage.
    """
    return _grow(views, method, _Stopwatch(on_stage), name=name, method_name=method_name, height=height, seed=seed)


def _look(source: Source, index: int, method: Method, height: float, seed: int, watch: _Stopwatch) -> View:
    """What is found in one photo, and the camera that took it."""
    with watch.time("segment"):
        mattes = method.segment(source.photo, source.strokes, rng=stage_rng(seed, "segment", index))
    with watch.time("trace"):
        branches = method.trace(source.photo, source.strokes, mattes, rng=stage_rng(seed, "trace", index))
    # after the trace: painted foliage hides no branch from it
    mattes = paint(mattes, source.strokes.density, rng=stage_rng(seed, "paint", index))
    camera = photo_camera(
        mattes,
        source.strokes,
        height,
        azimuth=source.azimuth,
        elevation=source.elevation,
        scale=source.scale,
        root=source.root,
        focal_px=source.focal_px,
    )
    return View(source.photo, source.strokes, mattes, branches, camera)


def _grow(
    views: Sequence[View],
    method: Method,
    watch: _Stopwatch,
    *,
    name: str,
    method_name: str,
    height: float,
    seed: int,
) -> TreeModel:
    """The stages that follow the views."""
    costs: dict[str, list[float]] = defaultdict(list)

    def on_step(done: int, total: int, values: Mapping[str, float]) -> None:
        for cost, value in values.items():
            costs[cost].append(value)
        if watch.on_stage is not None:
            watch.on_stage("grow", done, total)

    with ThreadPoolExecutor(1) as pool:  # textures need the views alone, and half of their work no lock of Python's
        cut_bark = watch.aside(pool, "bark", lambda: method.bark(views, rng=stage_rng(seed, "bark")))
        cut_atlas = watch.aside(pool, "atlas", lambda: method.atlas(views, rng=stage_rng(seed, "atlas")))
        with watch.time("lift"):
            skeleton = method.lift(views, rng=stage_rng(seed, "lift"))
        with watch.time("radius"):
            skeleton = method.radius(skeleton, views)
        with watch.time("grow"):
            skeleton = method.grow(skeleton, views, rng=stage_rng(seed, "grow"), on_step=on_step)
        with watch.time("radius"):
            skeleton = method.radius(skeleton, views)
        bark = cut_bark()
        with watch.time("mesh"):
            mesh = method.mesh(skeleton, bark)
        atlas = cut_atlas()
    with watch.time("leaves"):
        leaves = sorted_leaves(method.leaves(skeleton, views, atlas, rng=stage_rng(seed, "leaves")), skeleton)
    bare = all(view.mattes.is_bare for view in views)
    return TreeModel(
        name=name,
        method=method_name,
        seed=seed,
        height=height,
        views=tuple(views),
        skeleton=skeleton,
        mesh=mesh,
        bark=bark,
        atlas=atlas,
        leaves=leaves,
        costs={cost: np.array(values) for cost, values in costs.items()},
        seconds=watch.seconds,
        notes=("bare tree: the crown shows branches and no leaf",) if bare else (),
    )
