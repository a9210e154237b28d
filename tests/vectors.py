"""Results of the number units compared, and a report of where they differ."""

import numpy as np

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import field_width
from lightloom.verif.vectors.number_vectors import corner_vectors, random_vectors

__all__ = ["corner_vectors", "describe", "differences", "random_vectors"]


def describe(record: np.void) -> str:
    """One operand or result record as `field=0x…`, all bits shown."""
    assert record.dtype.names is not None
    parts = []
    for field in record.dtype.names:
        value = np.asarray(record[field])
        raw = int(value) if value.dtype == np.bool_ else int(value.view(f"<u{value.itemsize}"))
        parts.append(f"{field}=0x{raw:0{-(-field_width(record.dtype[field]) // 4)}x}")
    return " ".join(parts)


def differences(operands: np.ndarray, source: str, results: dict[str, np.ndarray]) -> str:
    """Where the results differ from the first of them: how often, and the first such vector in hex; else "".

    `source` says how to make the operands again, `results` names each array (N,).
    """
    (reference, expected), *others = results.items()
    for name, found in others:
        wrong = np.flatnonzero(~bitpack.equal(found, expected))
        if wrong.size:
            k = wrong[0]
            values = f"{reference} {describe(expected[k])}, {name} {describe(found[k])}"
            first = f"first, vector {k} of {source}: {describe(operands[k])}: {values}"
            return f"{wrong.size} of {len(operands)} differ; {first}"
    return ""
