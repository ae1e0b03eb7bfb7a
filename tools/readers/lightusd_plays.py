"""lightusd as a stranger reads a growing tree: `python lightusd_plays.py growing.usda`."""

import sys
from pathlib import Path

import lightusd
import numpy as np


def main(path: Path) -> None:
    """Read points and leaf sizes at some frames, also between two keys."""
    geometry = f"/{path.parent.name}/geo/LOD0"
    stage = lightusd.load(str(path))
    points = stage.prim_at(f"{geometry}/branches").attribute("points")
    scales = stage.prim_at(f"{geometry}/leaves").attribute("scales")
    times = np.array(points.timesamples.times)
    frames = [times[0], times[len(times) // 2], (times[-2] + times[-1]) / 2, times[-1]]
    heights = [float(np.asarray(lightusd.asarray(points.eval(t))).reshape(-1, 3)[:, 1].max()) for t in frames]
    sizes = [float(np.asarray(lightusd.asarray(scales.eval(t))).mean()) for t in frames]
    print(f"lightusd {lightusd.__version__}: {len(times)} samples, heights {np.round(heights, 2)} m, sizes {sizes}")
    assert all(np.diff(heights) > 0), "the wood does not grow, or is not interpolated"
    assert all(np.diff(sizes) > 0), "the leaves do not grow, or are not interpolated"


if __name__ == "__main__":
    main(Path(sys.argv[1]))
