"""Materials taken over: what the surface reads and nothing else, with their pictures."""

from __future__ import annotations

from pathlib import Path

import pytest
from pxr import Sdf

from forestgen.errors import InputError
from forestgen.usd.take_materials import keep_surface, move_pictures

MATERIAL = """#usda 1.0
def Material "leaf"
{{
    asset inputs:picture = @{picture}@
    asset inputs:openpbr_picture = @{picture}@
    float inputs:delit = 1
    token outputs:surface.connect = </leaf/nodes/surface.outputs:surface>
    token outputs:mtlx:surface.connect = </leaf/openpbr.outputs:out>
    def NodeGraph "nodes"
    {{
        def Shader "surface"
        {{
            color3f inputs:diffuseColor.connect = </leaf/texture.outputs:rgb>
            token inputs:opacityMode = "presence"
            token outputs:surface
        }}
    }}
    def Shader "texture"
    {{
        asset inputs:file.connect = </leaf.inputs:picture>
        float2 inputs:st.connect = </leaf/reader.outputs:result>
        float3 outputs:rgb
    }}
    def Shader "reader"
    {{
        float2 outputs:result
    }}
    def Shader "texture_delit"
    {{
        asset inputs:file = @{picture}@
    }}
    def Shader "openpbr"
    {{
        token outputs:out
    }}
}}
"""


@pytest.fixture
def layer(tmp_path: Path) -> Sdf.Layer:
    """A material with two terminals, nodes read by one, the other or none, and a picture beside it."""
    (tmp_path / "a.png").write_bytes(b"a")
    found = Sdf.Layer.CreateAnonymous(".usda")
    found.ImportFromString(MATERIAL.format(picture=tmp_path / "a.png"))
    return found


def names(view: object) -> set[str]:
    return set(view.keys())  # type: ignore[attr-defined]


def test_only_what_the_surface_reads_stays(layer: Sdf.Layer) -> None:
    material = layer.GetPrimAtPath("/leaf")
    keep_surface(material)
    assert names(material.properties) == {"inputs:picture", "outputs:surface"}
    assert names(material.nameChildren) == {"nodes", "texture", "reader"}
    assert "inputs:opacityMode" in layer.GetPrimAtPath("/leaf/nodes/surface").properties
    keep_surface(material, is_strict=True)
    assert "inputs:opacityMode" not in layer.GetPrimAtPath("/leaf/nodes/surface").properties


def test_a_material_without_surface_is_told(layer: Sdf.Layer) -> None:
    material = layer.GetPrimAtPath("/leaf")
    material.RemoveProperty(material.properties["outputs:surface"])
    with pytest.raises(InputError, match=r"/leaf: has no outputs:surface"):
        keep_surface(material)


def test_pictures_move_together_under_names_of_their_own(layer: Sdf.Layer, tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "a.png").write_bytes(b"b")
    delit = layer.GetAttributeAtPath("/leaf/texture_delit.inputs:file")
    delit.default = Sdf.AssetPath(str(tmp_path / "other" / "a.png"))
    pictures = move_pictures(layer, Sdf.Path("/leaf"), "textures")
    assert set(pictures) == {"textures/a.png", "textures/a_2.png"}
    assert {file.read_bytes() for file in pictures.values()} == {b"a", b"b"}
    said = {layer.GetAttributeAtPath(f"/leaf.inputs:{name}").default.path for name in ("picture", "openpbr_picture")}
    assert len(said) == 1
    assert said != {delit.default.path}


def test_a_missing_picture_is_told(layer: Sdf.Layer, tmp_path: Path) -> None:
    (tmp_path / "a.png").unlink()
    with pytest.raises(InputError, match=r"/leaf.*inputs:.*: leads to .*a\.png, which is not there"):
        move_pictures(layer, Sdf.Path("/leaf"), "textures")
