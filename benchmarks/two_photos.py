"""What does a second photo buy: trees of known truth from two photos and from one, seen from sides that neither shows?

    python benchmarks/two_photos.py [--method neubert2007] [--only NAME] [--jobs N] [--keep DIR] [--pictures DIR]

Reads the folder `shared` beside the checkout and prints a GitHub-Markdown table. Each tree that was photographed from
the front (0 degrees) and from the right (90 degrees) is built by the given methods from both photos, and by tan2008
from the first alone; the independent scorer `tools/score_tree.py` compares all with the true shape. Null models: the
stack of ellipses that fits both outlines, and the first outline turned about the trunk.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import pi
from pathlib import Path
from typing import Any

from fidelity import SEED, SHARED, column_means, markdown, score_all, workplace, write_strips

from forestgen.pipeline import build_scene
from forestgen.scene.manifest import Scene, TreeSpec, ViewSpec
from forestgen.tree.methods import METHODS

ONE_PHOTO = "tan2008"
COLUMNS = ("photo 0", "photo 90", "mean of 45 and 135", "null (ellipses)", "above null", "skill 0", "skill 90")


def two_photo_scene(shared: Path, method: str, n_photos: int, only: Sequence[str] = ()) -> Scene:
    """The trees with photos from 0 and 90 degrees, each from the first `n_photos` of them."""
    folder = shared / "ground_truth"
    trees: list[TreeSpec] = []
    for truth in sorted(folder.glob("*/truth.json")):
        name = truth.parent.name
        if not (truth.parent / "photo_az090.jpg").is_file() or (only and name not in only):
            continue
        views = tuple(
            ViewSpec(truth.parent / f"photo_az{at:03d}.jpg", truth.parent / f"strokes_az{at:03d}.json", at * pi / 180)
            for at in (0, 90)
        )
        height = float(json.loads(truth.read_text())["height_m"])
        seed = SEED + len(trees)
        trees.append(TreeSpec(name, name, height, METHODS[method], method, seed, views[:n_photos]))
    return Scene("two_photos", SEED, folder / "two_photos.toml", folder.resolve(), tuple(trees))


def figures(row: Mapping[str, Any]) -> list[float | None]:
    """The columns of one tree from what the scorer says of it."""
    views, oblique, null = row["views"], row["oblique_envelope_iou"], row["oblique_ellipse_iou"]
    seen = [views[name] for name in ("photo_0", "photo_90")]
    return [*(v["envelope_iou"] for v in seen), oblique, null, oblique - null, *(v["skill"] for v in seen)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--method", action="append", choices=sorted(METHODS), help="default: neubert2007")
    parser.add_argument("--only", action="append", default=[], metavar="NAME", help="a tree; may be repeated")
    parser.add_argument("--jobs", type=int, default=2, help="worker processes")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="leave the built scenes here")
    parser.add_argument("--pictures", type=Path, metavar="DIR", help="write a strip of pictures a tree")
    parser.add_argument("--without-one", action="store_true", help=f"leave out {ONE_PHOTO} from one photo")
    options = parser.parse_args()
    if not (SHARED / "ground_truth").is_dir():
        print(f"skipped: there is no folder '{SHARED.name}' with ground truth beside this checkout")
        return
    runs = [(method, 2) for method in options.method or ["neubert2007"]]
    if not options.without_one:
        runs.append((ONE_PHOTO, 1))
    rows: list[list[Any]] = []
    with workplace(options.keep) as folder:
        for method, n_photos in runs:
            scene = two_photo_scene(SHARED, method, n_photos, options.only)
            out = folder / f"{method}_{n_photos}"
            build_scene(replace(scene, name=method), out, jobs=options.jobs)
            scored = score_all(SHARED, out, scene, options.jobs)
            own = [
                [f"{name}, {method}, {n_photos} photo{'s' * (n_photos > 1)}", *figures(scored[name])] for name in scored
            ]
            rows += [*own, [f"**mean, {method}**", *column_means(own)]]
            if options.pictures:
                write_strips(out, scene, options.pictures, f"{method}_{n_photos}")
    rows.append(["target, 2 photos", 0.93, 0.93, None, None, -0.02, None, None])
    print(markdown(["tree", *COLUMNS], rows))


if __name__ == "__main__":
    main()
