"""The records of the memory image that the engine works on, each defined once as a NumPy dtype of whole bytes.

As in `golden_model.contract.formats`; what is there already is not here. Little endian, fields one after the other
without padding; `reserved` is zero. docs/memory_image.md lists the sections.
"""

import numpy as np

from lightloom.golden_model.contract.formats import F4, I4, U4

U1 = np.dtype(np.uint8)

# --- what rays meet -----------------------------------------------------------------------------------------------
# What the shading of a hit reads of a triangle, a block: coordinates of its corners in its object's lightmap and in the
# texture, in texels of the finest level (0 without a lightmap, without a texture); its material, its object, and the
# light that it is, -1 for none.
SURFACE = np.dtype(
    [
        ("lightmap_uv", F4, (3, 2)),
        ("texture_uv", F4, (3, 2)),
        ("material", U4),
        ("object", U4),
        ("light", I4),
        ("reserved", U4),
    ]
)

# What the shading of mirrors, of glass and of shadow rays from hits reads of it besides, two blocks: corners, unit
# normals there, and what the distance at which rays start goes with (`tables.ray_offset`).
SHAPE = np.dtype([("corner", F4, (3, 3)), ("normal", F4, (3, 3)), ("span", F4), ("reserved", U4, (13,))])

DIFFUSE, MIRROR, GLASS = 0, 1, 2
"""Kinds of surface: diffuse ones have lightmaps; mirrors reflect, glass reflects and refracts, both without blur."""

# A material, a block: albedo or tint, radiance that its front emits, index of refraction; textures that multiply the
# first and the second, -1 for none; what kind of surface, whether it reflects on both sides.
MATERIAL = np.dtype(
    [
        ("albedo", F4, (3,)),
        ("emission", F4, (3,)),
        ("ior", F4),
        ("texture", I4),
        ("emission_texture", I4),
        ("surface", U1),
        ("two_sided", U1),
        ("reserved", U1, (26,)),
    ]
)
