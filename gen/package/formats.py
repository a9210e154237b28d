"""The formats of memory and streams as a C header, derived from the dtypes of `golden_model.contract.formats`."""

from typing import Any

import numpy as np

from lightloom.golden_model.contract import bitpack, formats
from lightloom.golden_model.contract.formats import field_width
from lightloom.golden_model.contract.names import OF_FIELDS, check_name

FORMATS: dict[str, str] = {
    "IMAGE_HEADER": "The first block of a memory image",
    "SECTION": "An entry of its table of sections",
    "BVH_HEADER": "Block 0 of a tree",
    "NODE_BLOCK": "An inner node of a tree",
    "TRIANGLE_BLOCK": "A leaf of a tree: one or two triangles",
    "RAY_QUERY": "A ray and how it is to be traced: operand of the traversal unit, below its tag",
    "RAY_RESULT": "What comes back of a ray: result of the traversal unit, below its tag",
}
"""The formats that software meets, by their names in `golden_model.contract.formats`."""

CONSTANTS = ("BLOCK_BYTES", "WIDTH", "LATTICE_BITS", "NODE_KIND", "TRIANGLES_KIND")
ENUMS = {
    "section_kind": ("Kinds of sections.", formats.SECTION_KINDS),
    "trace_error": ("RAY_RESULT.error: why a ray has failed.", formats.TRACE_ERRORS),
    "load_error": ("Why the unit refuses a tree.", formats.LOAD_ERRORS),
}


def context() -> dict[str, Any]:
    """What the template of the header needs."""
    constants = {name: str(getattr(formats, name)) for name in CONSTANTS}
    constants |= {
        "BVH_MAGIC": f"{formats.BVH_MAGIC:#010x}u",
        "BVH_VERSION": str(formats.BVH_VERSION),
        "IMAGE_MAGIC_LOW": f"{formats.IMAGE_MAGIC[0]:#010x}u",
        "IMAGE_MAGIC_HIGH": f"{formats.IMAGE_MAGIC[1]:#010x}u",
        "IMAGE_VERSION": str(formats.IMAGE_VERSION),
    }
    enums = {name: {"meaning": meaning, "members": members} for name, (meaning, members) in ENUMS.items()}
    layouts = [_layout(name, meaning, getattr(formats, name)) for name, meaning in FORMATS.items()]
    return {"constants": constants, "enums": enums, "formats": layouts}


def _layout(name: str, meaning: str, dtype: np.dtype) -> dict[str, Any]:
    fields: dict[str, dict[str, Any]] = {}
    for field, _, base, bit, width in bitpack.fields(dtype):
        check_name(f"format {name}: field", field, OF_FIELDS)
        one = fields.setdefault(field, {"name": field, "bit": bit, "width": width, "count": 0, "type": _type(base)})
        one["count"] += 1
    return {
        "name": name,
        "meaning": meaning,
        "width": bitpack.width(dtype),
        "words": bitpack.words(dtype),
        "fields": list(fields.values()),
        # Where every field is as wide as its C type and lies on a multiple of its size, no compiler pads.
        "struct": all(one["type"] and one["bit"] % one["width"] == 0 for one in fields.values()),
    }


def _type(base: np.dtype) -> str | None:
    """The C type of a scalar, None where C has none of its width."""
    if base == np.bool_ or field_width(base) != 8 * base.itemsize:
        return None
    if base.kind == "f":
        return "float" if base.itemsize == 4 else None
    return f"{'u' if base.kind == 'u' else ''}int{8 * base.itemsize}_t"
