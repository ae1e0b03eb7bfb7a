"""Variants of look, season and light on a written tree: what each changes, together and alone."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pxr import Sdf, Usd, UsdGeom, UsdShade

from forestgen.tree.level import full_level
from forestgen.tree.mips import build_mips
from forestgen.usd.layers import open_stage, save
from forestgen.usd.lights import define_delit_texture, define_light_variants
from forestgen.usd.looks import LookMaterial, define_look_variants, look_layer
from forestgen.usd.materials import set_mip_thresholds
from forestgen.usd.mtlx_nodes import TABLE, register_nodes
from forestgen.usd.read import read_drawables
from forestgen.usd.seasons import Dress, SeasonLook, define_seasons
from forestgen.usd.tree_asset import write_png, write_tree_asset
from forestgen.usd.validate import validate, validate_file
from tests.usd.models import tree_model
from tests.usd.test_levels import extras

FALLEN = {"LOD0": np.array([1, 2, 30]), "LOD1": np.array([0, 16])}
BROWN, PALE = (120, 70, 30), (150, 150, 140)

MODEL = tree_model()
LEVELS = {f"LOD{k}": level for k, level in enumerate((full_level(MODEL), *extras(MODEL).levels))}
DRESS = Dress(LEVELS, ("leaf", "leaf_cards"), ("leaf",), has_openpbr=True)

# names and types of the nodes in MaterialX 1.39.5: libraries/stdlib/stdlib_defs.mtlx, bxdf/open_pbr_surface.mtlx
STANDARD = {
    "ND_open_pbr_surface_surfaceshader": {
        "base_color": "color3f",
        "specular_roughness": "float",
        "subsurface_weight": "float",
        "subsurface_color": "color3f",
        "geometry_opacity": "float",
        "geometry_thin_walled": "bool",
        "out": "token",
    },
    "ND_image_color4": {
        "file": "asset",
        "texcoord": "float2",
        "uaddressmode": "string",
        "vaddressmode": "string",
        "out": "color4f",
    },
    "ND_image_color3": {
        "file": "asset",
        "texcoord": "float2",
        "uaddressmode": "string",
        "vaddressmode": "string",
        "out": "color3f",
    },
    "ND_geompropvalue_vector2": {"geomprop": "string", "out": "float2"},
    "ND_convert_color4_color3": {"in": "color4f", "out": "color3f"},
    "ND_mix_color3": {"fg": "color3f", "bg": "color3f", "mix": "float", "out": "color3f"},
    "ND_extract_color4": {"in": "color4f", "index": "int", "out": "float"},
    "ND_ifgreatereq_float": {"value1": "float", "value2": "float", "in1": "float", "in2": "float", "out": "float"},
}


def looks() -> dict[str, SeasonLook]:
    def path(name: str) -> str:
        return f"./textures/{name}.png"

    autumn = {"leaf": path("leaf_autumn"), "leaf_cards": path("leaf_cards_autumn")}
    return {
        "photo": SeasonLook(),
        "autumn": SeasonLook(autumn, {"leaf": path("leaf_autumn_delit")}, FALLEN),
        "winter": SeasonLook(pictures={"leaf_cards": path("leaf_cards_winter")}, is_bare=True),
    }


def dressed(path: Path, dress: Dress) -> None:
    """All three sets on a written tree with a leaf of two textures."""
    folder, name = path.parent, path.stem
    materials = Usd.Stage.Open(str(folder / "materials.usdc"))
    define_delit_texture(materials, Sdf.Path(f"/{name}/mtl/leaf"), "./textures/leaf_delit.png")
    materials.Save()
    look = look_layer(
        name,
        [
            LookMaterial("bark", "./textures/bark.png"),
            LookMaterial("leaf", "./textures/leaf.png", is_leaf=True, delit="./textures/leaf_delit.png"),
            LookMaterial("leaf_cards", "./textures/leaf_cards.png", is_leaf=True),
        ],
    )
    save(look, folder / "openpbr.usdc")
    stage = Usd.Stage.Open(str(path), Usd.Stage.LoadNone)
    root = stage.GetDefaultPrim()
    define_look_variants(root)
    define_light_variants(root, ["leaf"])
    layers = define_seasons(root, looks(), dress)  # type: ignore[arg-type]
    assert list(layers) == ["autumn.usdc"]
    for name_of, layer in layers.items():
        save(layer, folder / name_of)
    stage.Save()
    for texture, colour in {
        "leaf_autumn": BROWN,
        "leaf_delit": PALE,
        "leaf_autumn_delit": PALE,
        "leaf_cards_autumn": BROWN,
        "leaf_cards_winter": BROWN,
    }.items():
        rgba = np.full((32, 48, 4), 255, np.uint8)
        rgba[..., :3] = colour
        write_png(rgba, folder / "textures" / f"{texture}.png")


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The root layer of a tree with three levels and all sets."""
    folder = tmp_path_factory.mktemp("trees") / "oak"
    path = write_tree_asset(tree_model(), folder, extras(tree_model()))
    dressed(path, DRESS)
    return path


def chosen(path: Path, **variants: str) -> Usd.Stage:
    """The tree with these variants selected by a layer that references it."""
    stage = Usd.Stage.CreateInMemory()
    root = stage.DefinePrim("/oak", "Xform")
    root.GetReferences().AddReference(str(path))
    for name, variant in variants.items():
        root.GetVariantSet(name).SetVariantSelection(variant)
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


def test_the_network_keeps_to_materialx(tree: Path) -> None:
    stage = chosen(tree, look="openpbr", light="delit")
    seen = set()
    for prim in stage.Traverse():
        shader = UsdShade.Shader(prim)
        if not shader or not shader.GetIdAttr().Get().startswith("ND_"):
            continue
        name = shader.GetIdAttr().Get()
        seen.add(name)
        for entry in (*shader.GetInputs(), *shader.GetOutputs()):
            assert str(entry.GetTypeName()) == STANDARD[name][entry.GetBaseName()], prim.GetPath()
            if UsdShade.Input.IsInput(entry.GetAttr()):
                for source in entry.GetConnectedSources()[0]:
                    from_node = source.source.GetOutput(source.sourceName)
                    from_input = source.source.GetInput(source.sourceName)
                    assert (from_node or from_input).GetTypeName() == entry.GetTypeName()
                assert not entry.GetConnectedSources()[1], f"{entry.GetAttr().GetPath()} leads nowhere"
    assert seen == set(STANDARD)


def test_our_table_of_nodes_is_the_standard_s() -> None:
    stage = Usd.Stage.Open(str(TABLE))
    table = {prim.GetName(): UsdShade.Shader(prim) for prim in stage.GetPseudoRoot().GetChildren()}
    assert set(table) == set(STANDARD)
    for name, entries in STANDARD.items():
        node = table[name]
        types = {e.GetBaseName(): str(e.GetTypeName()) for e in (*node.GetInputs(), *node.GetOutputs())}
        assert types.items() >= entries.items()


def test_a_leaf_is_thin_and_lets_light_through_and_bark_is_not(tree: Path) -> None:
    stage = chosen(tree, look="openpbr")
    leaf, bark = (UsdShade.Shader(stage.GetPrimAtPath(f"/oak/mtl/{name}/openpbr")) for name in ("leaf", "bark"))
    assert leaf.GetInput("geometry_thin_walled").Get() is True
    assert 0 < leaf.GetInput("subsurface_weight").Get() < 1
    sources = {i.GetBaseName(): i.GetConnectedSources()[0][0].source.GetPrim().GetName() for i in leaf.GetInputs()
               if i.HasConnectedSource()}  # fmt: skip
    assert sources == {
        "base_color": "openpbr_light",
        "subsurface_color": "openpbr_light",
        "geometry_opacity": "openpbr_cut",
    }
    assert not bark.GetInput("geometry_thin_walled")
    image = UsdShade.Shader(stage.GetPrimAtPath("/oak/mtl/bark/openpbr_picture"))
    assert image.GetInput("uaddressmode").Get() == "periodic"
    assert image.GetInput("file").GetValueProducingAttributes()[0].GetColorSpace() == "srgb_texture"
    cut = UsdShade.Shader(stage.GetPrimAtPath("/oak/mtl/leaf/openpbr_cut"))
    assert [cut.GetInput(name).Get() for name in ("value2", "in1", "in2")] == [0.5, 1.0, 0.0]


ALL = [
    {"season": season, "light": light, "look": look, "LOD": level}
    for season, light, look, level in (
        ("photo", "baked", "preview", "LOD0"),
        ("autumn", "baked", "preview", "LOD1"),
        ("autumn", "delit", "preview", "LOD0"),
        ("winter", "baked", "preview", "LOD2"),
        ("winter", "delit", "openpbr", "all"),
        ("autumn", "delit", "openpbr", "all"),
        ("photo", "baked", "openpbr", "LOD0"),
    )
]


@pytest.mark.parametrize("variants", ALL, ids=lambda v: "-".join(v.values()))
def test_validators_find_nothing_in_any_combination(tree: Path, variants: dict[str, str]) -> None:
    text = tree.read_text()
    for name, variant in variants.items():
        default = {"season": "photo", "light": "baked", "look": "preview", "LOD": "LOD0"}[name]
        assert f'string {name} = "{default}"' in text
        text = text.replace(f'string {name} = "{default}"', f'string {name} = "{variant}"')
    path = tree.with_name("choice.usda")
    path.write_text(text.replace("oak.usda", path.name))
    assert validate(path) == []
    if variants["light"] == "delit":
        nvidia = pytest.importorskip("usd_validation_nvidia")
        assert list(nvidia.ValidationEngine().validate(str(path)).issues()) == []
    path.unlink()


def test_validators_tell_a_wrong_type_in_the_network(tmp_path: Path) -> None:
    register_nodes()
    register_nodes()  # twice does no harm
    layer = look_layer("oak", [LookMaterial("bark", colour=np.array([0.4, 0.3, 0.2]))])
    stage = Usd.Stage.Open(layer)
    node = UsdShade.Shader(stage.GetPrimAtPath("/oak/mtl/bark/openpbr"))
    assert node.GetInput("base_color").Get() == pytest.approx((0.1329, 0.0732, 0.0331), abs=1e-3)
    node.CreateInput("specular_ior", Sdf.ValueTypeNames.Color3f).Set((1, 1, 1))
    stage.GetPrimAtPath("/oak").SetSpecifier(Sdf.SpecifierDef)
    stage.GetPrimAtPath("/oak/mtl").SetSpecifier(Sdf.SpecifierDef)
    stage.GetPrimAtPath("/oak/mtl/bark").SetTypeName("Material")
    stage.GetPrimAtPath("/oak/mtl/bark").SetSpecifier(Sdf.SpecifierDef)
    save(layer, tmp_path / "bark.usda")
    assert "MismatchedPropertyType" in {finding.error for finding in validate(tmp_path / "bark.usda")}


@pytest.fixture
def stage() -> Usd.Stage:
    """A stage with nothing but /oak."""
    stage = Usd.Stage.CreateInMemory()
    stage.DefinePrim("/oak", "Xform")
    return stage


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


def test_every_variant_of_the_file_passes_our_own_validation(tree: Path) -> None:
    assert validate_file(tree) == []


def test_without_our_table_a_usd_without_materialx_finds_nothing_by_default(tree: Path) -> None:
    code = (
        "import sys; from pxr import Usd, UsdValidation;"
        "found = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())"
        ".Validate(Usd.Stage.Open(sys.argv[1])); print([error.GetName() for error in found])"
    )
    run = subprocess.run([sys.executable, "-c", code, str(tree)], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


def test_the_bytes_depend_on_the_input_alone(tree: Path, tmp_path: Path) -> None:
    path = write_tree_asset(MODEL, tmp_path / "oak", extras(MODEL))
    dressed(path, DRESS)
    for name in ("oak.usda", "openpbr.usdc", "materials.usdc", "autumn.usdc"):
        assert (tree.parent / name).read_bytes() == path.with_name(name).read_bytes(), name


def test_thresholds_of_mip_levels_stand_on_the_material(tree: Path) -> None:
    stage = Usd.Stage.Open(str(tree.with_name("materials.usdc")))
    thresholds = build_mips(MODEL.atlas.rgba).thresholds
    set_mip_thresholds(stage, Sdf.Path("/oak/mtl/leaf"), thresholds.tolist())
    kept = stage.GetPrimAtPath("/oak/mtl/leaf").GetCustomData()["forestgen"]["mipThresholds"]
    assert_array_equal(np.array(kept), thresholds)
    assert kept[0] == 0.5
