"""Density volume: what the prior buys on views that were held out, and what a solve costs.

    python benchmarks/density.py SHARED_FOLDER [TREE ...]

Per tree and setting, from the true masks of the photos at 0 and 90 degrees: root mean square of the coverage that
the volume leaves unexplained; envelope IoU of its filled voxels with each photo's own mask; and with the true
orthographic outline at 45 and 135 degrees, beside a stack of ellipses that fits both photos (score_tree.py's null).
Then seconds and megabytes by resolution, against a dense solver of the same system at 25^3 in the same run.
"""

from __future__ import annotations

import importlib.util
import json
import sys
import tracemalloc
from collections.abc import Callable
from functools import partial
from pathlib import Path
from time import process_time
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[1]))

from forestgen.camera import Camera
from forestgen.check.metrics import envelope, iou
from forestgen.tree.density import DensityVolume
from forestgen.tree.density_rays import optical_depth, rasterise, ray_matrix
from forestgen.tree.density_views import density_residual, estimate_density, view_density
from forestgen.tree.view import View
from tests.tree.solids import drawn, true_views

SETTINGS: dict[str, dict[str, Any]] = {
    "as printed, 25": {"resolution": 25, "prior": False},
    "as printed, 128": {"resolution": 128, "prior": False},
    "prior, 25": {"resolution": 25},
    "prior, 64": {"resolution": 64},
    "prior, 128": {"resolution": 128},
}
GRIDS = (25, 64, 96, 128)


def scorer(shared: Path) -> Any:
    """The independent scorer, for its null model."""
    spec = importlib.util.spec_from_file_location("score_tree", shared / "tools" / "score_tree.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def shape_scores(volume: DensityVolume, views: list[View], folder: Path, scorer: Any) -> list[float]:
    """Own outlines' IoU (mean), held-out IoU and the null's (means over 45 and 135 degrees)."""
    own = []
    for view in views:
        tall = height_px(volume, view.camera)
        own.append(iou(envelope(view.mattes.is_tree, tall), envelope(drawn(volume, view.camera), tall)))
    truth = json.loads((folder / "truth.json").read_text())
    frame = truth["ortho"]
    photos = [scorer.cover_of(scorer.photo_truth(str(folder), truth, azimuth)) for azimuth in (0, 90)]
    held, null = [], []
    for azimuth in (45, 135):
        true = scorer.cover_of(cv2.imread(str(folder / f"ortho_az{azimuth:03d}_mask.png")))
        size = (true.shape[1], true.shape[0])
        camera = Camera(size, tuple(frame["root_px"]), frame["px_per_metre"], np.deg2rad(azimuth))
        tall = truth["height_m"] * frame["px_per_metre"]
        outline = envelope(true, tall)
        held.append(iou(outline, envelope(drawn(volume, camera), tall)))
        front, side = (envelope(photo, tall) for photo in photos)
        null.append(iou(outline, scorer.ellipse(front, side, azimuth, frame["root_px"][0])))
    return [float(np.mean(values)) for values in (own, held, null)]


def height_px(volume: DensityVolume, camera: Camera) -> float:
    return float(volume.edge * volume.alpha.shape[1] * camera.px_per_metre)


def cost(work: Callable[[], object]) -> tuple[float, float]:
    """Processor seconds of the better of two runs, and megabytes at the peak of a third."""
    seconds = []
    for _ in range(2):
        begin = process_time()
        work()
        seconds.append(process_time() - begin)
    tracemalloc.start()
    work()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return min(seconds), peak / 1e6


def dense_solve(views: list[View]) -> NDArray[np.float64]:
    """The peer: the first guess and the same rays at 25^3, solved by numpy's dense least squares."""
    first = estimate_density(views, resolution=25, refine=False, prior=False)
    points = first.centres(first.is_filled)
    rasters = [rasterise(view_density(view), view.camera, first) for view in views]
    rays = np.vstack([ray_matrix(raster, points).toarray() for raster in rasters])
    seen = np.concatenate([optical_depth(raster.value.ravel()) for raster in rasters])
    start = optical_depth(first.alpha[first.is_filled])
    return np.asarray(np.maximum(start + np.linalg.lstsq(rays, seen - rays @ start, rcond=None)[0], 0.0))


def main() -> None:
    shared = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[2] / "shared"
    wanted = sys.argv[2:]
    if not (shared / "ground_truth").is_dir():
        print("skipped: no folder 'shared' with ground truth beside this checkout")
        return
    judge = scorer(shared)
    folders = sorted(f.parent for f in (shared / "ground_truth").glob("*/photo_az090_mask.png"))
    folders = [f for f in folders if not wanted or f.name in wanted]
    cases = {folder: true_views(folder) for folder in folders}
    print(f"{'tree':14} {'setting':16} residual  own outline  held out  ellipses")
    for name, setting in SETTINGS.items():
        rows = []
        for folder, views in cases.items():
            volume = estimate_density(views, **setting)
            row = [density_residual(volume, views).mean(), *shape_scores(volume, views, folder, judge)]
            rows.append(row)
            print(f"{folder.name:14} {name:16} {row[0]:8.3f} {row[1]:12.3f} {row[2]:9.3f} {row[3]:9.3f}")
        mean = np.mean(rows, axis=0)
        print(f"{'mean':14} {name:16} {mean[0]:8.3f} {mean[1]:12.3f} {mean[2]:9.3f} {mean[3]:9.3f}")
    views = next(iter(cases.values()))
    peer, peer_mb = cost(lambda: dense_solve(views))
    print(f"dense least squares at 25^3: {peer:.2f} s, {peer_mb:.0f} MB")
    for resolution in GRIDS:
        for prior in (False, True):
            seconds, mb = cost(partial(estimate_density, views, resolution=resolution, prior=prior))
            kind = "prior" if prior else "as printed"
            print(f"{kind:10} {resolution:4}^3: {seconds:5.2f} s ({seconds / peer:5.2f} of the dense), {mb:4.0f} MB")


if __name__ == "__main__":
    main()
