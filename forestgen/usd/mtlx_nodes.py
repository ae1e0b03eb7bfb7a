"""MaterialX nodes made known to a USD that was built without MaterialX, so that validators can check the look."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from pxr import Sdf, Sdr, Usd, UsdShade

TABLE = Path(__file__).with_suffix(".usda")


@cache
def _table() -> Sdf.Layer:
    return Sdf.Layer.FindOrOpen(str(TABLE))


def type_of(shader: UsdShade.Shader, name: str) -> Sdf.ValueTypeName:
    """The type of an input or output (`inputs:file`, `outputs:out`) of a node, by the table.

    Raises:
        ValueError: the table has no such node, or that has no such input or output.
    """
    identifier = str(shader.GetIdAttr().Get())
    spec = _table().GetAttributeAtPath(f"/{identifier}.{name}")
    if spec is None:
        raise ValueError(f"{TABLE.name} has no {name} of a node {identifier!r}")
    return spec.typeName


def register_nodes() -> None:
    """Add the nodes of our table to USD's shader registry, which is one a process; those it knows stay.

    Without it, validators in usd-core tell of each node: MissingShaderIdInRegistry. With it they check the
    names and types of our inputs too.
    """
    registry = Sdr.Registry()
    stage = Usd.Stage.Open(_table())
    for prim in stage.GetPseudoRoot().GetChildren():
        if registry.GetShaderNodeByIdentifier(prim.GetName()) is None:
            for result in UsdShade.ShaderDefUtils.GetDiscoveryResults(UsdShade.Shader(prim), str(TABLE)):
                registry.AddDiscoveryResult(result)
