"""The model of every unit whose result depends on its operands alone, by its name."""

from collections.abc import Callable
from typing import Any

import numpy as np

from lightloom.golden_model.contract import formats
from lightloom.golden_model.contract.interfaces import OPERATORS, UNITS, Unit
from lightloom.golden_model.numerics import floats
from lightloom.golden_model.tracing.ray_setup import ray_setup
from lightloom.golden_model.tracing.ray_triangle import ray_triangle
from lightloom.golden_model.tracing.wide_bvh.box_setup import box_setup
from lightloom.golden_model.tracing.wide_bvh.node_test import node_test
from lightloom.golden_model.tracing.wide_bvh.ray_time import ray_time

Model = Callable[[np.ndarray], np.ndarray]
"""Operands (N,) of the unit's input dtype to results (N,) of its output dtype."""


def _operator(unit: Unit, function: Callable[..., Any]) -> Model:
    """Of a number unit: its fields, in order, are the function's arguments and results."""

    def model(operands: np.ndarray) -> np.ndarray:
        out = np.zeros(len(operands), dtype=unit.output)
        values = function(*(operands[field] for field in unit.input.names or ()))
        given = values if isinstance(values, tuple) else (values,)
        for field, value in zip(unit.output.names or (), given, strict=True):
            out[field] = value
        return out

    return model


MODELS: dict[str, Model] = {
    **{name: _operator(unit, getattr(floats, name)) for name, unit in OPERATORS.items()},
    "ray_setup": ray_setup,
    "ray_triangle": ray_triangle,
    "ray_triangle_half": ray_triangle,
    "ray_time": ray_time,
    "box_setup": box_setup,
    "node_test": node_test,
}
"""Of every unit of UNITS."""


def model_results(unit: str, operands: np.ndarray, width: int) -> np.ndarray:
    """What the unit's model says of hardware with testers for `width` boxes: children in slots beyond do not count."""
    if UNITS[unit].input == formats.NODE_TEST:
        operands = operands.copy()
        operands["count"] = np.minimum(operands["count"], width)
    return MODELS[unit](operands)
