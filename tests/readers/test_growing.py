"""A growing tree before readers: it plays, and at each age it is the picture that we draw."""

from __future__ import annotations

from pathlib import Path

import pytest

from forestgen.growing import grow_tree
from forestgen.pipeline import write_tree
from forestgen.tree.growth import Growth
from forestgen.usd.profiles import write_profile
from forestgen.usd.read import read_film
from tests.readers.strangers import ask, iou, our_mask, run, their_mask
from tests.usd.subjects import CAMERA, leafy_model

EXPECTED_IOU = 0.97
FRAMES = 24


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A grown tree's film layer; not to be changed."""
    trees = tmp_path_factory.mktemp("growing") / "trees"
    write_tree(leafy_model(), "oak", trees)
    return grow_tree(trees / "oak", Growth(), frames=FRAMES, fps=12.0, every_frame=True).film


@pytest.mark.gl
@pytest.mark.parametrize("profile", ["usd", "blender"])
def test_blender_shows_two_ages_as_we_do(film: Path, profile: str, tmp_path: Path) -> None:
    chosen = {"growth": "animated"} if profile == "blender" else None
    path = write_profile(film.parent, tmp_path / "made", profile, variants=chosen)
    path = path if profile == "blender" else path.with_name(film.name)
    masks = []
    for frame in (FRAMES // 2, FRAMES):
        asked = ("--cameras", path.with_name("cameras.usda"), "--mask", tmp_path / f"{frame}.png", "--frame", frame)
        answer = ask("bpy", "blender_reads.py", path, *asked, "--size", *CAMERA.size)
        assert answer["frames"] == [1, FRAMES]
        masks.append(their_mask(tmp_path / f"{frame}.png"))
        (drawables,) = read_film(film, [frame])
        assert iou(masks[-1], our_mask(drawables, CAMERA)) >= EXPECTED_IOU
    assert 0.05 < masks[0].sum() / masks[1].sum() < 0.9, "the tree does not grow"


def test_blender_plays_it(film: Path) -> None:
    assert "heights" in run("bpy", "blender_plays.py", film)


def test_lightusd_plays_it(film: Path) -> None:
    assert f"{FRAMES} samples" in run("lightusd", "lightusd_plays.py", film)
