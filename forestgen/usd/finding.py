"""Finding: one fault of a stage, where it is and what mends it; and what our own checks may find."""

from __future__ import annotations

from dataclasses import dataclass

OWN = "forestgen"  # the validator of all checks below

# what is found: (severity, what mends it); docs/validate.md explains each
CHECKS = {
    "Unreadable": ("error", "the file is damaged: write or copy it again"),
    "NotFinite": ("error", "write the values again; NaN often comes from a vector of length 0 that was made unit"),
    "FaceCounts": ("error", "export the mesh again: counts of 3 or more that add up to the number of indices"),
    "FaceIndexRange": ("error", "export the mesh again, or add the missing points"),
    "DegenerateFace": ("warning", "delete the faces without area, for instance by a merge by distance"),
    "SubsetIndexRange": ("error", "assign the faces to the subset again; its mesh has changed since"),
    "CurveCounts": ("error", "export the curves again: counts of 2 or more that add up to the number of points"),
    "ProtoIndexRange": ("error", "point every instance at one of the prototypes, or add the missing prototypes"),
    "NoPrototype": ("error", "target an existing prim, in the same file and below the instancer"),
    "InstanceLengths": ("error", "give each array one value an instance, or leave it out"),
    "NotUnitQuaternion": ("error", "divide each quaternion by its length; check that the real part is stored last"),
    "ZeroScale": ("error", "give the scale a positive value; hide instances by invisibleIds instead"),
    "NegativeScale": ("warning", "mirror the points instead, and keep scales positive: readers turn faces inside out"),
    "InvisibleIds": ("error", "name only ids of instances that are there"),
    "Extent": ("warning", "compute the extent again from what is drawn, at every time sample"),
    "ExtentsHint": ("warning", "compute the hint again with all payloads loaded (UsdGeom.ModelAPI.ComputeExtentsHint)"),
    "PrimvarLength": ("error", "give the attribute as many values as its interpolation asks for, or change that"),
    "PrimvarIndexRange": ("error", "export the primvar again, or flatten it"),
    "SampleLengths": ("error", "give every time sample the same length, or sample the topology at the same times"),
    "AssetMissing": ("error", "put the file there, or mend the path"),
    "AssetAbsolute": ("error", "use a path relative to the layer, such as ./textures/leaf.png"),
    "AssetOutside": ("warning", "copy the file into the asset's own folder, so that the folder can be moved alone"),
    "BindingTarget": ("error", "bind an existing material of the same file, or remove the binding"),
    "ConnectionTarget": ("error", "connect to an output or input that exists, or remove the connection"),
}  # fmt: skip

# what mends the findings of USD's own validators, by the validator's or the finding's name
USD_REMEDIES = {
    "MissingDefaultPrim": "name the root prim as defaultPrim in the layer's metadata",
    "MissingMetersPerUnitMetadata": "author metersPerUnit, for instance 1 for metres, in the layer's metadata",
    "MissingUpAxisMetadata": "author upAxis, Y or Z, in the layer's metadata",
    "CompositionErrorTest": "put the layer or prim that is named there, or remove the reference or payload",
    "MissingReferenceValidator": "put the file there, or mend the path",
    "EncapsulationChecker": "move the inner prim beside the outer one; only transforms and scopes hold geometry",
    "MaterialBindingApiAppliedValidator": "apply MaterialBindingAPI to the prim that has the binding",
    "MaterialBindingRelationships": "make the binding a relationship",
    "AttributeTypeMismatch": "author the attribute with the type of its schema",
    "ShaderSdrCompliance": "author the input with the type that the shader's definition has",
    "NormalMapTextureValidator": "set scale (2, 2, 2, 1), bias (-1, -1, -1, 0), sourceColorSpace raw on the texture",
    "SubsetFamilies": "assign each face to at most one subset of the family",
    "PackageEncapsulationValidator": "put all files into the package and refer to them by relative paths",
    "RootPackageValidator": "pack again, for instance with usdzip: no compression, 64-byte alignment",
    "UsdzPackageValidator": "pack again, for instance with usdzip: no compression, 64-byte alignment",
    "FileExtensionValidator": "pack only usd, usda, usdc, exr, jpg, png and sound files",
}  # fmt: skip
ANY_REMEDY = "author it as the schema's documentation on openusd.org says"


@dataclass(frozen=True)
class Finding:
    """What one check found at one place."""

    validator: str
    error: str  # the validator's own name for it
    message: str
    place: str  # prim or property path, or the layer; a path as /oak{LOD=LOD2}geo/leaves is found in that variant only
    severity: str = "error"  # error | warning | info
    remedy: str = ANY_REMEDY

    def line(self) -> str:
        """The finding in one line: severity, place, what, remedy, the check's name."""
        place = f"{self.place}: " if self.place else ""
        what = self.message.rstrip(".")
        text = f"{self.severity}: {place}{what}; {self.remedy} [{self.validator}.{self.error}]"
        return " ".join(text.split())


def own_finding(error: str, place: object, message: str) -> Finding:
    """A finding of one of our own CHECKS."""
    severity, remedy = CHECKS[error]
    return Finding(OWN, error, message, str(place), severity, remedy)
