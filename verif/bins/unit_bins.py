"""Functional bins of every unit with a stream in and a stream out: its own, or those that follow from its formats."""

import numpy as np

from lightloom.verif.bins import number_bins, ray_bins, texel_bins
from lightloom.verif.bins.coverage import Groups, cases
from lightloom.verif.bins.number_bins import signed

BINS = number_bins.BINS | ray_bins.BINS | texel_bins.BINS
"""Functions of operands and results (N,), by unit."""


def unit_bins(unit: str, operands: np.ndarray, results: np.ndarray) -> Groups:
    """The groups of a unit for its operands and the model's results, both (N,)."""
    return BINS.get(unit, any_bins)(operands, results)


def any_bins(operands: np.ndarray, results: np.ndarray) -> Groups:
    """Classes of every operand; and whether every field of the results has had more than one value."""
    groups = {f"operand {name}": _classes(operands[name]) for name in operands.dtype.names or ()}
    varied = {name: len(np.unique(results[name], axis=0)) - 1 for name in results.dtype.names or ()}
    return groups | {"results that vary": varied}


def _classes(field: np.ndarray) -> dict[str, int]:
    """Of a field of a kind of number, whatever its shape."""
    values = field.ravel()
    if values.dtype.kind == "f":
        return signed(values)
    if values.dtype.kind == "b":
        return cases(false=~values, true=values)
    least, greatest = values.min(), values.max()
    return cases(least=values == least, greatest=values == greatest, between=(values > least) & (values < greatest))
