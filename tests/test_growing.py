"""A written tree grows: what is in its folder afterwards, what readers see, and what is refused."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pxr import Usd, UsdGeom

from forestgen import cli
from forestgen.errors import InputError
from forestgen.growing import GrowthFilm, grow_tree
from forestgen.pipeline import write_tree
from forestgen.tree.growth import Growth
from forestgen.tree.mesh import GeneralisedCylinders
from forestgen.tree.model import Bark, Leaves, TreeModel
from forestgen.usd.read import read_drawables, read_film
from forestgen.usd.validate import validate
from tests.tree.skeletons import random_tree
from tests.usd.models import tree_model

FRAMES, FPS = 48, 12.0


def model(n_leaves: int) -> TreeModel:
    """A random tree with leaves on its twigs."""
    rng = np.random.default_rng(5)
    skeleton = random_tree(300, rng=rng)
    turn = rng.normal(size=(n_leaves, 4))
    node = rng.integers(60, 300, n_leaves)
    leaves = Leaves(
        position=skeleton.position[node] + rng.normal(0, 0.005, (n_leaves, 3)),
        orientation=turn / np.linalg.norm(turn, axis=1, keepdims=True),
        size=rng.uniform(0.05, 0.1, n_leaves),
        prototype=rng.integers(0, 3, n_leaves),
    )
    mesh = GeneralisedCylinders()(skeleton, Bark(np.zeros((1, 1, 3), np.uint8), 0.3, 0.6))
    return replace(tree_model(leaves=leaves, mesh=mesh), skeleton=skeleton)


@pytest.fixture(scope="module")
def stills(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of written trees; not to be changed."""
    trees = tmp_path_factory.mktemp("out ü") / "trees"
    write_tree(model(120), "oak", trees)
    write_tree(model(0), "bare", trees)
    return trees


@pytest.fixture(scope="module")
def grown(stills: Path, tmp_path_factory: pytest.TempPathFactory) -> GrowthFilm:
    """The oak, grown; not to be changed."""
    folder = tmp_path_factory.mktemp("grown") / "trees" / "oak"
    shutil.copytree(stills / "oak", folder)
    return grow_tree(folder, Growth(tropism_deg=-14), frames=FRAMES, fps=FPS)


def copy(stills: Path, tmp_path: Path, name: str = "oak") -> Path:
    shutil.copytree(stills / name, tmp_path / "trees" / name)
    return tmp_path / "trees" / name


def bytes_of(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def prims(stage: Usd.Stage) -> tuple[UsdGeom.Mesh, UsdGeom.PointInstancer]:
    """The wood and the leaves of a stage, which must be kept: prims do not outlive it."""
    root = stage.GetDefaultPrim().GetPath()
    return (
        UsdGeom.Mesh(stage.GetPrimAtPath(root.AppendPath("geo/LOD0/branches"))),
        UsdGeom.PointInstancer(stage.GetPrimAtPath(root.AppendPath("geo/LOD0/leaves"))),
    )


def test_the_still_asset_stays_still_and_light(grown: GrowthFilm, stills: Path) -> None:
    folder = grown.asset.parent
    entries = [p.name for p in (stills / "oak").iterdir()]
    assert sorted(p.name for p in folder.iterdir()) == sorted([*entries, "growth.usdc", "growing.usda"])
    before, after = bytes_of(stills / "oak"), bytes_of(folder)
    assert all(after[name] == content for name, content in before.items() if name != "oak.usda")
    stage = Usd.Stage.Open(str(grown.asset))
    choice = stage.GetDefaultPrim().GetVariantSet("growth")
    assert sorted(choice.GetVariantNames()) == ["animated", "static"]
    assert choice.GetVariantSelection() == "static"
    assert not any(layer.identifier.endswith("growth.usdc") for layer in stage.GetUsedLayers())
    mesh, leaves = prims(stage)
    assert not mesh.GetPointsAttr().GetTimeSamples()
    assert not leaves.GetScalesAttr().GetTimeSamples()
    untouched = Usd.Stage.Open(str(stills / "oak" / "oak.usda"))
    hints = [UsdGeom.ModelAPI(one.GetDefaultPrim()).GetExtentsHint() for one in (stage, untouched)]
    assert_array_equal(np.array(hints[0]), np.array(hints[1]))


def test_the_stage_says_how_long_and_how_fast(grown: GrowthFilm) -> None:
    for path in (grown.asset, grown.film):
        stage = Usd.Stage.Open(str(path))
        assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (1, FRAMES)
        assert stage.GetTimeCodesPerSecond() == stage.GetFramesPerSecond() == FPS
    samples = prims(stage)[0].GetPointsAttr().GetTimeSamples()
    assert (samples[0], samples[-1], len(samples)) == (1, FRAMES, grown.samples)


def test_topology_is_constant_and_the_last_frame_is_the_still_tree(grown: GrowthFilm, stills: Path) -> None:
    stages = [Usd.Stage.Open(str(path)) for path in (grown.film, stills / "oak" / "oak.usda")]
    moving, still = (prims(stage) for stage in stages)
    assert not moving[0].GetFaceVertexIndicesAttr().GetTimeSamples()
    assert not moving[1].GetProtoIndicesAttr().GetTimeSamples()
    for part, names in ((0, ("points", "normals", "extent")), (1, ("positions", "scales", "orientations", "extent"))):
        for name in names:
            end = moving[part].GetPrim().GetAttribute(name).Get(FRAMES)
            then = still[part].GetPrim().GetAttribute(name).Get()
            if name == "extent":
                assert_allclose(np.array(end), np.array(then), atol=1e-5)
            else:
                assert np.array(end).tobytes() == np.array(then).tobytes(), name


def test_what_is_drawn_at_the_end_is_what_is_drawn_of_the_still_tree(grown: GrowthFilm, stills: Path) -> None:
    for end, still in zip(read_drawables(grown.film), read_drawables(stills / "oak" / "oak.usda"), strict=True):
        assert_array_equal(end.points, still.points)
        assert_array_equal(end.transforms, still.transforms)
    early, late = read_film(grown.film, [FRAMES / 4, FRAMES])
    assert np.ptp(early[0].points[:, 1]) < 0.8 * np.ptp(late[0].points[:, 1])


def test_extents_hold_what_is_there_in_every_frame(grown: GrowthFilm) -> None:
    stage = Usd.Stage.Open(str(grown.film))
    mesh, leaves = prims(stage)
    hint = stage.GetDefaultPrim().GetAttribute("extentsHint")
    last = 0.0
    for frame in range(1, FRAMES + 1):
        low, high = np.array(mesh.GetExtentAttr().Get(frame))
        points = np.array(mesh.GetPointsAttr().Get(frame))
        assert np.all(points >= low - 1e-5)
        assert np.all(points <= high + 1e-5)
        whole = np.array(hint.Get(frame))
        assert np.all(whole[0] <= low + 1e-6)
        assert np.all(whole[1] >= high - 1e-6)
        assert high[1] >= last - 1e-6
        last = high[1]
    for frame in mesh.GetPointsAttr().GetTimeSamples():
        told = np.array(UsdGeom.Boundable.ComputeExtentFromPlugins(leaves, Usd.TimeCode(frame)))
        assert_allclose(np.array(leaves.GetExtentAttr().Get(frame)), told, atol=2e-4)


def test_every_frame_has_a_sample_where_it_is_wanted(stills: Path, tmp_path: Path, grown: GrowthFilm) -> None:
    made = grow_tree(copy(stills, tmp_path), Growth(tropism_deg=-14), frames=FRAMES, fps=FPS, every_frame=True)
    assert (made.samples, made.error) == (FRAMES, 0)
    stages = [Usd.Stage.Open(str(path)) for path in (made.film, grown.film)]
    exact, keyed = (prims(stage)[1] for stage in stages)
    assert exact.GetScalesAttr().GetTimeSamples() == list(range(1, FRAMES + 1))
    for frame in range(1, FRAMES + 1):  # the stated bound holds for what a reader makes of the keys
        off = np.array(exact.GetScalesAttr().Get(frame)) - np.array(keyed.GetScalesAttr().Get(frame))
        assert np.abs(off).max() <= grown.error + 1e-6


@pytest.mark.parametrize("which", ["asset", "film"])
def test_no_validator_finds_anything(grown: GrowthFilm, which: str) -> None:
    path = getattr(grown, which)
    assert validate(path) == []
    nvidia = pytest.importorskip("usd_validation_nvidia")
    assert list(nvidia.ValidationEngine().validate(str(path)).issues()) == []


def test_growing_again_replaces_and_gives_the_same_bytes(stills: Path, tmp_path: Path) -> None:
    folder = copy(stills, tmp_path)
    grow_tree(folder, Growth(), frames=20)
    first = bytes_of(folder)
    grow_tree(folder, Growth(mode="none", tropism_deg=20), frames=7, fps=30)
    assert bytes_of(folder) != first
    assert Usd.Stage.Open(str(folder / "oak.usda")).GetEndTimeCode() == 7
    grow_tree(folder, Growth(), frames=20)
    assert bytes_of(folder) == first
    assert [p.name for p in folder.parent.iterdir()] == ["oak"]


def test_other_variants_of_the_asset_stay(stills: Path, tmp_path: Path) -> None:
    folder = copy(stills, tmp_path)
    stage = Usd.Stage.Open(str(folder / "oak.usda"))
    stage.GetDefaultPrim().GetVariantSets().AddVariantSet("look").AddVariant("summer")
    stage.GetRootLayer().Save()
    grow_tree(folder, Growth(), frames=5)
    again = Usd.Stage.Open(str(folder / "oak.usda"))
    again.Reload()
    assert sorted(again.GetDefaultPrim().GetVariantSets().GetNames()) == ["LOD", "growth", "look", "season"]


def test_a_bare_tree_grows(stills: Path, tmp_path: Path) -> None:
    made = grow_tree(copy(stills, tmp_path, "bare"), Growth(), frames=12)
    assert validate(made.film) == []
    assert len(read_drawables(made.film)) == 1


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ({"frames": 0}, "--frames: expected 2 to 10000, came 0"),
        ({"frames": 1}, "--frames: expected 2 to 10000, came 1"),
        ({"fps": 0.0}, "--fps: expected .* came 0"),
        ({"fps": float("nan")}, "--fps: expected .* came nan"),
        ({"tolerance": 0.0}, "--tolerance: expected a share"),
        ({"growth": Growth(tropism_deg=91)}, "tropism: expected degrees between -60 and 60, came 91"),
    ],
)
def test_senseless_settings_are_refused(stills: Path, tmp_path: Path, setting: dict[str, object], words: str) -> None:
    folder = copy(stills, tmp_path)
    before = bytes_of(folder)
    with pytest.raises(InputError, match=words):
        grow_tree(folder, **{"growth": Growth(), **setting})  # type: ignore[arg-type]
    assert bytes_of(folder) == before


def test_a_folder_that_is_no_tree_is_refused(stills: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"holds no .*\.usda; expected the folder of a built tree"):
        grow_tree(tmp_path, Growth())
    folder = copy(stills, tmp_path)
    shutil.rmtree(folder / "reference")
    with pytest.raises(InputError, match=r"provenance\.json: not found: build the tree again"):
        grow_tree(folder, Growth())
    (folder / "oak.usda").write_text("no stage")
    with pytest.raises(InputError, match="cannot be opened as USD"):
        grow_tree(folder, Growth())


def test_an_interruption_leaves_the_tree_as_it_was(stills: Path, tmp_path: Path) -> None:
    folder = copy(stills, tmp_path)
    before = bytes_of(folder)

    def stop(done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        grow_tree(folder, Growth(), frames=10, on_frame=stop)
    assert bytes_of(folder) == before
    assert [p.name for p in folder.parent.iterdir()] == ["oak"]


def test_the_command_says_what_it_made(
    stills: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = copy(stills, tmp_path)

    def run(*words: object) -> tuple[int, str, str]:
        monkeypatch.setattr("sys.argv", ["forestgen", "grow", *map(str, words), "--no-film"])
        code = cli._run()
        return code, *capsys.readouterr()

    code, out, err = run(folder, "--frames", 9, "--quiet", "--json")
    assert (code, err) == (0, "")
    told = json.loads(out)
    assert (told["asset"], told["film"], told["frames"]) == ("oak.usda", "growing.usda", 9)
    assert told["megabytes"] == pytest.approx((folder / "growth.usdc").stat().st_size / 1e6, abs=1e-3)
    code, out, _ = run(folder, "--frames", 9, "--every-frame")
    assert code == 0
    assert "9 frames, 9 samples, every frame" in out
    for words, complaint in (
        ((folder, "--frames", 1), "--frames: expected 2 to 10000, came 1"),
        ((folder, "--fps", 0), "--fps: expected frames a second above 0"),
        ((folder, "--tropism", 1000), "tropism: expected degrees between -60 and 60, came 1000"),
        ((folder, "--mode", "x"), "mode: expected one of none, all, scale, came 'x'"),
        ((tmp_path,), "expected the folder of a built tree"),
    ):
        code, out, err = run(*words)
        assert (code, out) == (2, "")
        assert complaint in err
