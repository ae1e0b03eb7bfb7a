"""What levels of detail cost and keep: seconds, triangles and scores of a tree with 200,000 leaves, or of built ones.

    python -m benchmarks.lods                      # a random tree of 200,000 leaves
    python -m benchmarks.lods out/street/trees/*   # trees that were built, from their folders

Ratios are to the full tree in the same run; seconds are of the processor. All levels together are to take 15 s.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

from forestgen.check.lods import DrawnLevel, score_levels
from forestgen.render.cards import bake_cards, plan_cards
from forestgen.render.model_drawables import level_drawables
from forestgen.tree.level import Level, full_level
from forestgen.tree.lod import LOD_STEPS, coarser_level, fit_level
from forestgen.tree.model import TreeModel
from forestgen.usd.read_model import read_model
from tests.tree.lod_trees import bushy_tree

LEAVES, NODES = 200_000, 40_000
MOST_SECONDS = 15.0


def report(model: TreeModel) -> None:
    """Print one line a level of a tree, and one for a budget."""
    full = full_level(model)
    print(f"{model.name}: {full.n_triangles:,} triangles, {full.n_instances:,} leaves")
    print("level    px  seconds  triangles     ratio   leaves  envelope IoU (worst)  dE")
    levels: list[Level] = []
    seconds = []
    for step in LOD_STEPS:
        begin = time.process_time()
        levels.append(coarser_level(model, step))
        seconds.append(time.process_time() - begin)
    begin = time.process_time()
    plan = plan_cards(model)
    cards = bake_cards(plan, model, model.atlas.rgba)
    levels.append(plan.level(model))
    seconds.append(time.process_time() - begin)
    drawn = [
        DrawnLevel(f"LOD{k}", level.switch_px, level_drawables(level, model.bark, model.atlas.rgba, cards))
        for k, level in enumerate((full, *levels))
    ]
    for score, spent in zip(score_levels(drawn), seconds, strict=True):
        ratio = full.n_triangles / score.triangles
        cost = f"{score.switch_px:5.0f} {spent:8.2f} {score.triangles:10,d} {ratio:8.1f}x {score.instances:8,d}"
        kept = f"{score.envelope_iou:.4f} ({score.envelope_iou_worst:.4f})  {score.colour_delta_e:.2f}"
        print(f"{score.level:5s} {cost}        {kept}")
    print(f"all levels: {sum(seconds):.1f} s of {MOST_SECONDS:.0f}")
    begin = time.process_time()
    fitted = fit_level(model, max_triangles=full.n_triangles // 10)
    spent = time.process_time() - begin
    print(f"a tenth of the triangles: {fitted.n_triangles:,}, for {fitted.switch_px:.0f} px, {spent:.1f} s\n")


def main() -> None:
    """Report the trees named on the command line, or the random one."""
    folders = [Path(name) for name in sys.argv[1:]]
    for model in map(read_model, folders) if folders else [bushy_tree(LEAVES, NODES)]:
        report(model)


if __name__ == "__main__":
    main()
