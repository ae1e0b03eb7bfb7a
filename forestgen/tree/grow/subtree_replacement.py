"""SubtreeReplacement: branches are replaced by library subtrees, guided by attractors (Tan et al. 2008, sec. 3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from forestgen.tree.grow.attractors import Field, empty_field, image_attractors, picture_plane
from forestgen.tree.grow.axes import stem_end
from forestgen.tree.grow.crown_volume import CrownVolume, crown_volume
from forestgen.tree.grow.growing_tree import GrowingTree
from forestgen.tree.grow.limbs import LimbRules, add_turned_joints, grow_limbs
from forestgen.tree.grow.scores import PlacementRules, Scores
from forestgen.tree.grow.subtree_library import PREDEFINED, Subtree, choose_diverse, load_subtrees, subtrees_of
from forestgen.tree.grow.twigs import smooth
from forestgen.tree.grow.whole_crown import Spacing, crown_tree, with_twigs
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.strategy import OnStep, Strategy, folder_setting
from forestgen.tree.view import View

ROUNDING = 3  # times that each new node is drawn between its neighbours, so that joints do not kink


@dataclass(frozen=True, kw_only=True)
class SubtreeReplacement(Strategy):
    """Growth by replacing branches with subtrees of a small library; `paper()` is the printed setting."""

    iterations: int = 300  # paper: "about 100" (sec. 3.1); goes on here until nothing is gained, see `patience`
    patience: int = (
        8  # paper: none; iterations in a row that add nothing, after which growth ends (0: never ends early)
    )
    n_rotations: int = 12  # "12 quantized levels of 360 degrees" (sec. 3.1)
    n_subtrees: int = 8  # "at most 8 subtrees" (sec. 3.1)
    n_candidates: int = 6  # "a small set of existing branches" (sec. 3.1): its size is not given
    visible_subtrees: bool = True  # "taking all its subtrees" of the visible branches (sec. 3.1)
    predefined_subtrees: bool = True  # "if there is too few subtrees we add predefined subtrees" (sec. 3.1)
    library: str = folder_setting()  # the user's own subtrees (*.json), beside the others (sec. 3.1: "can be enriched")
    interval: float = 0.025  # of the height; image attractors at "a fixed interval" (sec. 3.2), not given
    near: float = 0.02  # of the height; "too close to some existing branches" (sec. 3.1), not given
    shortest: float = 0.04  # of the height; paper: 0; what is shorter than this is left to the twigs
    min_gain: float = 0.003  # of the first cost; paper: 0; least fall of the cost that is worth an iteration
    whole_branches: bool = False  # paper: a branch that leaves the foliage is removed; here it is cut back
    round_crown: bool = True  # paper: no; the crown is as deep as wide, and points in it attract as the joints do
    leaf_masses: bool = True  # paper: no; the crown is made of lobes as large and uneven as the outline's
    volume_interval: float = 0.05  # of the height, between the points in the crown
    leader: bool = True  # paper: no; the single stem of a conifer is carried on to the crown's top
    twigs: bool = True  # paper: no; last generations wherever the crown has no wood near
    twig_interval: float = 0.028  # of the height, between the points that each want a twig
    least_twigs: int = 3000  # points at least: in a small crown they lie closer
    most_twigs: int = 12000  # and at most: in a wide one farther apart (about 2.5 nodes a point)

    @classmethod
    def paper(cls) -> SubtreeReplacement:
        """Exactly the paper's hundred iterations, and nothing that it does not have."""
        return cls(
            iterations=100,
            patience=0,
            shortest=0.0,
            min_gain=0.0,
            whole_branches=True,
            round_crown=False,
            leaf_masses=False,
            leader=False,
            twigs=False,
        )

    def __call__(
        self, skeleton: Skeleton, views: Sequence[View], *, rng: np.random.Generator, on_step: OnStep | None = None
    ) -> Skeleton:
        """Grow the visible skeleton into the whole tree's.

        Raises:
            StageError: a view shows no crown to grow into.
            InputError: the user's library cannot be read.
        """
        volume = crown_volume(views, is_round=self.round_crown)
        tree, volume, form = crown_tree(
            skeleton, views[0], volume, has_leader=self.leader, has_masses=self.leaf_masses, rng=rng
        )
        library = self._library(skeleton, stem_end(skeleton, views[0]), form)
        image, space = self._attractors(tree, views, volume, rng=rng)
        h = volume.height
        share = 1.0 if self.whole_branches else 0.4
        placement = PlacementRules(library, self.n_rotations, volume, share, self.shortest * h)
        rules = LimbRules(self.iterations, self.n_candidates, self.near * h, self.min_gain, self.patience)
        grow_limbs(tree, Scores(placement, image, space), rules, rng=rng, on_step=on_step)
        position = smooth(tree.position, tree.parent, tree.n_visible, ROUNDING)
        position = np.where(volume.allows(position)[0][:, None], position, tree.position)
        grown = Skeleton(position, tree.parent, tree.skeleton.radius)
        if not self.twigs:
            return grown
        spacing = Spacing(interval=self.twig_interval, least=self.least_twigs, most=self.most_twigs)
        return with_twigs(grown, tree, volume, form, spacing, rng=rng)

    def _library(self, skeleton: Skeleton, stem: int, form: str) -> tuple[Subtree, ...]:
        """At most `n_subtrees`: the user's, those of the visible branches, and predefined ones of the tree's form."""
        own = load_subtrees(Path(self.library)) if self.library else ()
        visible = subtrees_of(skeleton, form, stem) if self.visible_subtrees else []
        predefined = [s for s in load_subtrees(PREDEFINED) if s.form == form] if self.predefined_subtrees else []
        chosen = choose_diverse(visible, self.n_subtrees // 2)
        rest = choose_diverse(predefined, self.n_subtrees - len(chosen) - len(own))
        return (*own, *chosen, *rest)[: self.n_subtrees]

    def _attractors(
        self, tree: GrowingTree, views: Sequence[View], volume: CrownVolume, *, rng: np.random.Generator
    ) -> tuple[list[Field], Field]:
        """Attractors of each image, and those in space: turned joints, and points in the crown."""
        image = []
        for view, region in zip(views, volume.leafy, strict=True):
            one = empty_field()
            ends = [picture_plane(view.camera, end) for end in tree.segments()]
            one.add(image_attractors(region, view.camera, self.interval * volume.height), *ends)
            image.append(one)
        space = empty_field()
        add_turned_joints(tree, space, 0)
        if self.round_crown:
            space.add(volume.sample(self.volume_interval * volume.height, rng), *tree.segments())
        return image, space
