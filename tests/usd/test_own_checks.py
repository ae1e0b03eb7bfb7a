"""Each fault that we look for is planted in a written tree: it is told, with its place and its remedy, and alone."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, UsdUtils

from forestgen.errors import InputError
from forestgen.usd.finding import CHECKS, USD_REMEDIES
from forestgen.usd.layers import open_stage
from forestgen.usd.own_checks_geometry import degenerate
from forestgen.usd.own_checks_instancer import UNIT
from forestgen.usd.validate import usd_findings, validate_file
from tests.usd.planted import FAULTS, Tree


@pytest.fixture
def tree(oak: Path, tmp_path: Path) -> Tree:
    """A copy of the written tree."""
    folder = tmp_path / "trees" / "oak"
    shutil.copytree(oak.parent, folder)
    return Tree(folder / oak.name)


@pytest.mark.parametrize("fault", FAULTS)
def test_a_planted_fault_is_told_alone(fault: str, tree: Tree) -> None:
    plant, error, place, message, is_seen_by_usd = FAULTS[fault]
    plant(tree)
    tree.save()
    found = validate_file(tree.path)
    assert [each.error for each in found] == [error], "\n".join(each.line() for each in found)
    assert found[0].place.endswith(place)
    assert message in found[0].message
    assert (found[0].severity, found[0].remedy) == CHECKS.get(error, ("error", USD_REMEDIES["CompositionErrorTest"]))
    assert found[0].line().count("\n") == 0
    assert found[0].place in found[0].line()
    assert bool(usd_findings(open_stage(tree.path))) == is_seen_by_usd


def test_every_check_has_a_planted_fault() -> None:
    assert set(CHECKS) - {error for _, error, *_ in FAULTS.values()} == {"Unreadable"}  # see test_damage_is_told


def test_the_documentation_lists_every_check_with_its_remedy() -> None:
    text = (Path(__file__).parents[2] / "docs" / "validate.md").read_text()
    for check, (severity, remedy) in CHECKS.items():
        row = next(line for line in text.splitlines() if line.startswith(f"| `{check}` |"))
        assert row.split(" | ")[1] == severity
        assert row.endswith(f"| {remedy} |")


VARIANTS = """#usda 1.0
(
    defaultPrim = "oak"
    metersPerUnit = 1
    upAxis = "Y"
)
def Xform "oak" (
    variants = {
        string size = "small"
        string season = "summer"
    }
    prepend variantSets = ["size", "season"]
)
{
    def Mesh "wood" {
        point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
        normal3f[] normals = [(0, 0, 1), (0, 0, 1), (0, 0, 1)] (interpolation = "vertex")
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, %s]
        uniform token subdivisionScheme = "none"
    }
    variantSet "size" = {
        "small" {
            over "wood" {
                float3[] extent = [(0, 0, 0), (1, 1, 0)]
            }
        }
        "large" {
            over "wood" {
                float3[] extent = [(0, 0, 0), (2, 2, 0)]
            }
        }
    }
    variantSet "season" = {
        "summer" { }
        "winter" (payload = @./snow.usda@) { }
    }
}
"""


def test_every_variant_is_opened_and_told_alone(tmp_path: Path) -> None:
    path = tmp_path / "oak.usda"
    path.write_text(VARIANTS % 2)
    found = validate_file(path)
    assert [(each.error, each.place) for each in found] == [
        ("CompositionError", "/oak{season=winter}"),
        ("Extent", "/oak{size=large}wood.extent"),
    ]
    assert path.read_text() == VARIANTS % 2


def test_what_every_variant_shows_is_told_once(tmp_path: Path) -> None:
    path = tmp_path / "oak.usda"
    path.write_text(VARIANTS % 3)
    found = [each.place for each in validate_file(path) if each.error == "FaceIndexRange"]
    assert found == ["/oak/wood.faceVertexIndices"]


def test_a_fault_in_shared_instances_is_told_once(scene: Path, tmp_path: Path) -> None:
    shutil.copytree(scene.parent, tmp_path / "wood")
    tree = Tree(tmp_path / "wood" / "trees" / "oak" / "oak.usda")
    tree.change("leaves", "protoIndices", 7, 3)
    tree.prim("branches").GetAttribute("subdivisionScheme").Set("catmark")
    tree.save()
    found = validate_file(tmp_path / "wood" / scene.name)
    assert [(each.error, each.place) for each in found] == [
        ("ProtoIndexRange", "/wood/trees/oak/geo/LOD0/leaves.protoIndices"),  # oak_copy shares it
    ]


def test_a_package_is_checked_like_a_folder(oak: Path, tmp_path: Path) -> None:
    whole = tmp_path / "oak.usdz"
    assert UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(oak)), str(whole))
    assert [each.line() for each in validate_file(whole)] == []


def test_damage_is_told(oak: Path, tmp_path: Path) -> None:
    """Arrays that cannot be unpacked are findings, not a crash."""
    shutil.copytree(oak.parent, tmp_path / "oak")
    layer = tmp_path / "oak" / "geometry.usdc"
    data = bytearray(layer.read_bytes())
    data[88:1500] = b"\x77" * (1500 - 88)  # behind the head: the arrays
    layer.write_bytes(bytes(data))
    found = validate_file(tmp_path / "oak" / oak.name)
    assert found
    assert {each.error for each in found} & {"Unreadable", "NotFinite", "FaceIndexRange", "PrimvarLength"}
    assert all("\n" not in each.line() for each in found)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("none.usda", None, "there is no such file"),
        ("folder", "", "is a folder; expected a USD file"),
        ("empty.usdc", b"", "is empty; expected a USD file"),
        ("words.usda", b"a tree", "cannot be opened as USD"),
        ("words.txt", b"a tree", "cannot be opened as USD"),
        ("words.usdz", b"a tree", "cannot be opened as USD"),
        ("half.usdc", "half", "cannot be opened as USD: .*possibly truncated"),
    ],
)
def test_what_cannot_be_opened_is_one_line(
    name: str, content: bytes | str | None, message: str, oak: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    if content == "":
        path.mkdir()
    elif content is not None:
        whole = (oak.parent / "geometry.usdc").read_bytes()
        path.write_bytes(content if isinstance(content, bytes) else whole[: len(whole) // 2])
    with pytest.raises(InputError, match=message) as told:
        validate_file(path)
    assert "\n" not in str(told.value)
    assert str(path) in str(told.value)
    assert capfd.readouterr() == ("", "")  # USD's own warnings stay off the terminal


def test_faces_of_any_size_are_measured() -> None:
    """Polygons of 3 and 4 corners together give what each alone gives."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0]], np.float32)
    corners = np.array([0, 1, 2, 0, 1, 2, 3, 0, 1, 4, 0, 1, 1])  # triangle, square, line, twice the same corner
    repeated, flat = degenerate(np.array([3, 4, 3, 3]), corners, points)
    assert repeated.tolist() == [False, False, False, True]
    assert flat.tolist() == [False, False, True, True]
    for start, count, k in ((0, 3, 0), (3, 4, 1), (7, 3, 2), (10, 3, 3)):
        one = degenerate(np.array([count]), corners[start : start + count], points)
        assert [bool(each[0]) for each in one] == [bool(repeated[k]), bool(flat[k])]


def test_rounded_quaternions_are_unit_enough() -> None:
    """The tolerances hold for every quaternion that was unit before it was stored."""
    turn = np.random.default_rng(1).normal(size=(20_000, 4))
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    for name, kind in (("orientations", np.float16), ("orientationsf", np.float32)):
        off = np.abs(np.linalg.norm(turn.astype(kind).astype(float), axis=1) - 1).max()
        assert np.finfo(kind).eps / 10 < off < UNIT[name] / 2


SHAPES = """#usda 1.0
(
    defaultPrim = "w"
    metersPerUnit = 1
    upAxis = "Y"
)
def Xform "w"
{
    def Points "dust" {
        point3f[] points.timeSamples = { 1: [(0, 0, 0)], 2: [(0, 0, 0), (1, 1, 1)] }
        float[] widths.timeSamples = { 1: [0.1], 2: [0.1, 0.1] }
    }
    def BasisCurves "vine" {
        uniform token type = "cubic"
        uniform token basis = "bezier"
        int[] curveVertexCounts = [4, 7]
        point3f[] points = [
            (0, 0, 0), (0, 1, 0), (0, 2, 0), (0, 3, 0),
            (1, 0, 0), (1, 1, 0), (1, 2, 0), (1, 3, 0), (1, 4, 0), (1, 5, 0), (1, 6, 0),
        ]
        float[] widths = [0.1, 0.2, 0.1, 0.2, 0.3] (interpolation = "varying")
        float3[] extent = [(-0.15, -0.15, -0.15), (1.15, 6.15, 0.15)]
    }
    def Mesh "square" {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        float3[] extent = [(0, 0, 0), (1, 1, 0)]
        texCoord2f[] primvars:st = [(0, 0), (1, 1)] (interpolation = "faceVarying")
        int[] primvars:st:indices = [0, 1, 0, 1]
        string[] primvars:names = ["a", "b"] (interpolation = "constant")
        float[] primvars:pair = [1, 2, 3, 4, 5, 6, 7, 8] (
            elementSize = 2
            interpolation = "vertex"
        )
    }
    def Mesh "nothing" {
        int[] faceVertexCounts = []
        int[] faceVertexIndices = []
        point3f[] points = []
    }
    def PointInstancer "turning" {
        rel prototypes = </w/turning/P>
        int[] protoIndices = [0]
        point3f[] positions.timeSamples = { 1: [(0, 0, 0)], 2: [(1, 0, 0)], 3: [(2, 0, 0)] }
        quath[] orientations.timeSamples = { 1: [(1, 0, 0, 0)], 3: [(0, 0, 1, 0)] }
        color3f[] primvars:displayColor = [(1, 0, 0)] (interpolation = "vertex")
        int64[] ids = [10]
        int64[] invisibleIds = [10]
        def Sphere "P" {}
    }
    def Material "m" {
        def Shader "s" {
            uniform token info:implementationSource = "sourceAsset"
            uniform asset info:glslfx:sourceAsset = @looked/up/elsewhere.glslfx@
        }
    }
}
"""


def test_what_is_unusual_but_right_is_no_finding(tmp_path: Path) -> None:
    (tmp_path / "w.usda").write_text(SHAPES)
    own = [each.line() for each in validate_file(tmp_path / "w.usda") if each.validator == "forestgen"]
    assert own == []
