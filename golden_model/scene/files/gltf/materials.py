"""Materials of glTF files: what of them a diffuse surface can show."""

from typing import Any

import numpy as np

from lightloom.golden_model.scene.files.gltf.accessors import Accessors
from lightloom.golden_model.scene.files.remarks import Remarks
from lightloom.golden_model.scene.parts import DEFAULT_ALBEDO

STRENGTH = "KHR_materials_emissive_strength"


def material_colours(read: Accessors, document: Any, remarks: Remarks, number: Any) -> tuple[list[float], list[float]]:
    """Albedo and emission of a material; None: of a primitive that has none."""
    if number is None:
        return list(DEFAULT_ALBEDO), [0.0, 0.0, 0.0]
    material = read.item(document.materials, number, "material")
    surface, extensions = material.pbrMetallicRoughness, material.extensions or {}
    base = read.floats(surface and surface.baseColorFactor, 4, f"baseColorFactor of material {number}", (1, 1, 1, 1))
    glow = read.floats(material.emissiveFactor, 3, f"emissiveFactor of material {number}", (0, 0, 0))
    strength = (extensions.get(STRENGTH) or {}).get("emissiveStrength", 1.0)
    with np.errstate(over="ignore", invalid="ignore"):  # refused below
        glow = glow * read.floats([strength], 1, f"emissiveStrength of material {number}")
    _leave_out(remarks, material, surface, glow)
    return (
        remarks.clamped(base[:3], 1, f"baseColorFactor of material {number}"),
        remarks.clamped(glow, None, f"emissiveFactor of material {number}"),
    )


def _leave_out(remarks: Remarks, material: Any, surface: Any, glow: np.ndarray) -> None:
    """What would make a material look different."""
    for owner, name in (
        (surface, "baseColorTexture"),
        (surface, "metallicRoughnessTexture"),
        (material, "emissiveTexture"),
        (material, "normalTexture"),
        (material, "occlusionTexture"),
    ):
        if owner is not None and getattr(owner, name) is not None:
            remarks.leave_out(name)
    if surface is not None and surface.metallicFactor:
        remarks.leave_out("metallicFactor")
    if material.alphaMode not in (None, "OPAQUE"):
        remarks.leave_out(f"alphaMode {material.alphaMode}")
    if material.doubleSided:
        remarks.leave_out("doubleSided of what shines" if glow.any() else "doubleSided")
    for extension in material.extensions or {}:
        if extension != STRENGTH:
            remarks.leave_out(extension)
