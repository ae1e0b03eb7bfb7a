"""Variants of season and light on a written tree: what each changes, together and alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pxr import Sdf, Usd, UsdGeom, UsdShade

from forestgen.tree.mips import build_mips
from forestgen.usd.layers import open_stage
from forestgen.usd.lights import define_delit_texture, define_light_variants
from forestgen.usd.looks import LookMaterial
from forestgen.usd.materials import set_mip_thresholds
from forestgen.usd.read import read_drawables
from forestgen.usd.seasons import SeasonLook, define_seasons
from tests.usd.dressed_tree import BROWN, DRESS, FALLEN, MODEL, chosen, write_dressed


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The root layer of a tree with three levels and all sets."""
    return write_dressed(tmp_path_factory.mktemp("trees"))


@pytest.fixture
def stage() -> Usd.Stage:
    """A stage with nothing but /oak."""
    stage = Usd.Stage.CreateInMemory()
    stage.DefinePrim("/oak", "Xform")
    return stage


def pictures(stage: Usd.Stage, material: str, context: str = "") -> set[str]:
    """File names of the textures that a material's surface really reads in a render context."""
    share = stage.GetPrimAtPath(f"/oak/mtl/{material}").GetAttribute("inputs:delit")
    is_delit = bool(share and share.Get())
    surface = UsdShade.Material(stage.GetPrimAtPath(f"/oak/mtl/{material}")).ComputeSurfaceSource(context)[0]
    found, todo = set(), [surface]
    while todo:
        node = todo.pop()
        if node.GetInput("file"):
            found.add(Path(node.GetInput("file").GetValueProducingAttributes()[0].Get().path).name)
        is_mix = node.GetIdAttr().Get() == "ND_mix_color3"
        for entry in node.GetInputs():
            if is_mix and entry.GetBaseName() == ("bg" if is_delit else "fg"):
                continue  # by the material's input all of the one colour and nothing of the other
            for source in entry.GetConnectedSources()[0]:
                if UsdShade.Shader(source.source.GetPrim()):
                    todo.append(UsdShade.Shader(source.source.GetPrim()))
    return found


def test_by_default_nothing_is_changed(tree: Path) -> None:
    stage = open_stage(tree)
    root = stage.GetDefaultPrim()
    selections = {name: root.GetVariantSet(name).GetVariantSelection() for name in root.GetVariantSets().GetNames()}
    assert selections == {"season": "photo", "light": "baked", "look": "preview", "LOD": "LOD0"}
    assert pictures(stage, "leaf") == {"leaf.png"}
    assert not stage.GetPrimAtPath("/oak/mtl/leaf/openpbr")
    assert sum(d.n_triangles for d in read_drawables(tree)) == 12 + 50


@pytest.mark.parametrize(
    ("season", "light", "leaf", "cards"),
    [
        ("photo", "baked", "leaf.png", "leaf_cards.png"),
        ("photo", "delit", "leaf_delit.png", "leaf_cards.png"),
        ("autumn", "baked", "leaf_autumn.png", "leaf_cards_autumn.png"),
        ("autumn", "delit", "leaf_autumn_delit.png", "leaf_cards_autumn.png"),
        ("winter", "baked", "leaf.png", "leaf_cards_winter.png"),
    ],
)
@pytest.mark.parametrize("look", ["preview", "openpbr"])
def test_season_and_light_choose_one_picture_in_both_looks(
    tree: Path, season: str, light: str, leaf: str, cards: str, look: str
) -> None:
    stage = chosen(tree, season=season, light=light, look=look)
    outline = {} if light == "baked" or look == "preview" else {leaf.replace("_delit", "")}  # the same alpha
    assert pictures(stage, "leaf") == {leaf}
    assert pictures(stage, "leaf", "mtlx") == {leaf, *outline}
    for context in ("", "mtlx"):  # without a terminal of its own a context gets the universal one
        assert pictures(stage, "leaf_cards", context) == {cards}
    surface = UsdShade.Material(stage.GetPrimAtPath("/oak/mtl/leaf")).ComputeSurfaceSource("mtlx")[0]
    assert surface.GetPrim().GetName() == ("openpbr" if look == "openpbr" else "surface")


def test_autumn_hides_the_fallen_leaves_of_each_level(tree: Path) -> None:
    for level, gone in FALLEN.items():
        stage = chosen(tree, season="autumn", LOD=level)
        instancer = UsdGeom.PointInstancer(stage.GetPrimAtPath(f"/oak/geo/{level}/leaves"))
        assert_array_equal(instancer.GetInvisibleIdsAttr().Get(), gone)
        mask = np.array(instancer.ComputeMaskAtTime(Usd.TimeCode.Default()))
        assert_array_equal(np.flatnonzero(~mask), gone)
    assert not chosen(tree).GetPrimAtPath("/oak/geo/LOD0/leaves").GetAttribute("invisibleIds").HasAuthoredValue()


def test_a_level_may_lose_every_leaf(stage: Usd.Stage) -> None:
    gone = {"LOD0": np.arange(50), "LOD1": np.zeros(0, np.int64)}
    looks = {"photo": SeasonLook(), "autumn": SeasonLook(fallen=gone)}
    layer = define_seasons(stage.GetPrimAtPath("/oak"), looks, DRESS)["autumn.usdc"]  # type: ignore[arg-type]
    assert layer.GetPrimAtPath("/oak/geo/LOD0/leaves").active is False
    assert not layer.GetPrimAtPath("/oak/geo/LOD1/leaves").properties


@pytest.mark.parametrize("level", ["LOD0", "LOD1", "all"])
def test_winter_has_wood_only(tree: Path, level: str) -> None:
    stage = chosen(tree, season="winter", LOD=level)
    kinds = {prim.GetTypeName() for prim in stage.Traverse()}
    assert "PointInstancer" not in kinds
    assert stage.GetPrimAtPath(f"/oak/geo/{'LOD0' if level == 'all' else level}/branches")


def test_what_is_drawn_is_what_the_season_says(tree: Path) -> None:
    path = tree.with_name("in_autumn.usda")
    stage = chosen(tree, season="autumn")
    stage.SetDefaultPrim(stage.GetPrimAtPath("/oak"))
    stage.GetRootLayer().Export(str(path))
    drawn = read_drawables(path)
    path.unlink()
    assert sum(d.n_triangles for d in drawn) == 12 + 50 - len(FALLEN["LOD0"])
    leaf = next(d for d in drawn if d.is_leaf)
    assert leaf.texture is not None
    assert_array_equal(np.unique(leaf.texture[..., :3].reshape(-1, 3), axis=0), [BROWN])


@pytest.mark.parametrize(
    ("look", "message"),
    [
        ({"spring": SeasonLook()}, "'spring' is none; expected one of photo, summer"),
        ({"autumn": SeasonLook(pictures={"petal": "./a.png"})}, "material 'petal'; there is"),
        ({"autumn": SeasonLook(delit={"leaf_cards": "./a.png"})}, "has no second texture"),
        ({"autumn": SeasonLook(fallen={"LOD7": np.array([0])})}, "of 'LOD7' fall, which has none; levels are"),
        ({"autumn": SeasonLook(fallen={"LOD2": np.array([0])})}, "of 'LOD2' fall, which has none"),
        ({"autumn": SeasonLook(fallen={"LOD0": np.array([0, 50])})}, "leaf 50 of LOD0 fall, which has 50"),
    ],
)
def test_what_is_not_there_is_refused(stage: Usd.Stage, look: dict[str, SeasonLook], message: str) -> None:
    prim = stage.GetPrimAtPath("/oak")
    with pytest.raises(ValueError, match=message):
        define_seasons(prim, {"photo": SeasonLook(), **look}, DRESS)  # type: ignore[dict-item]
    assert not prim.GetVariantSets().GetNames(), "nothing half-authored"


def test_more_that_is_refused(stage: Usd.Stage) -> None:
    prim = stage.GetPrimAtPath("/oak")
    with pytest.raises(ValueError, match="seasons need 'photo' among them"):
        define_seasons(prim, {"winter": SeasonLook(is_bare=True)}, DRESS)
    with pytest.raises(ValueError, match="variants of light need a material"):
        define_light_variants(prim, [])
    with pytest.raises(ValueError, match="has no node 'texture'"):
        define_delit_texture(stage, Sdf.Path("/oak/mtl/leaf"), "./a.png")
    with pytest.raises(ValueError, match="neither a picture nor a colour"):
        LookMaterial("bark")
    with pytest.raises(ValueError, match="needs a picture: its alpha"):
        LookMaterial("leaf", colour=np.zeros(3), is_leaf=True)


def test_the_bytes_depend_on_the_input_alone(tree: Path, tmp_path: Path) -> None:
    path = write_dressed(tmp_path)
    for name in ("oak.usda", "openpbr.usdc", "materials.usdc", "autumn.usdc"):
        assert (tree.parent / name).read_bytes() == path.with_name(name).read_bytes(), name


def test_thresholds_of_mip_levels_stand_on_the_material(tree: Path) -> None:
    stage = Usd.Stage.Open(str(tree.with_name("materials.usdc")))
    thresholds = build_mips(MODEL.atlas.rgba).thresholds
    set_mip_thresholds(stage, Sdf.Path("/oak/mtl/leaf"), thresholds.tolist())
    kept = stage.GetPrimAtPath("/oak/mtl/leaf").GetCustomData()["forestgen"]["mipThresholds"]
    assert_array_equal(np.array(kept), thresholds)
    assert kept[0] == 0.5
