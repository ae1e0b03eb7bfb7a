"""The OpenPBR look keeps to MaterialX, and no validator finds anything in any combination of variants."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdShade

from forestgen.usd.layers import save
from forestgen.usd.looks import LookMaterial, look_layer
from forestgen.usd.mtlx_nodes import TABLE, register_nodes
from forestgen.usd.validate import validate, validate_file
from tests.usd.dressed_tree import chosen, write_dressed

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


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The root layer of a tree with three levels and all sets."""
    return write_dressed(tmp_path_factory.mktemp("trees"))


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
