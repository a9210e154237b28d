"""The model of every unit, by its name: what its hardware computes, in all bits."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from lightloom.golden_model.contract.interfaces import OPERATORS, Unit
from lightloom.golden_model.engine.sampling.texel_blend import texel_blend
from lightloom.golden_model.engine.selection.texel_match import texel_match
from lightloom.golden_model.engine.selection.texel_project import texel_project
from lightloom.golden_model.numerics import floats
from lightloom.golden_model.tracing.ray_setup import ray_setup
from lightloom.golden_model.tracing.ray_triangle import ray_triangle
from lightloom.golden_model.tracing.wide_bvh.box_setup import box_setup
from lightloom.golden_model.tracing.wide_bvh.node_test import node_test
from lightloom.golden_model.tracing.wide_bvh.ray_time import ray_time
from lightloom.golden_model.tracing.wide_bvh.traversal import trace_tree

Function = Callable[[np.ndarray], np.ndarray]
"""Operands (N,) of a unit's input dtype to results (N,) of its output dtype."""
Model = Callable[[np.ndarray, Any, np.ndarray | None, Mapping[str, int]], np.ndarray]
"""Of operands (N,), what the unit remembers, the memory that it reads, and the hardware's parameters by their flat
names (`rtl.config.Config.flat`): the results (N,) in the order of the operands. A unit that remembers nothing, or has
no memory, is given None."""


def _pure(function: Function) -> Model:
    """Of a unit whose results depend on its operands alone, whatever its parameters."""
    return lambda operands, state, memory, config: function(operands)


def _operator(unit: Unit, function: Callable[..., Any]) -> Function:
    """Of a number unit: its fields, in order, are the function's arguments and results."""

    def model(operands: np.ndarray) -> np.ndarray:
        out = np.zeros(len(operands), dtype=unit.output)
        values = function(*(operands[field] for field in unit.input.names or ()))
        given = values if isinstance(values, tuple) else (values,)
        for field, value in zip(unit.output.names or (), given, strict=True):
            out[field] = value
        return out

    return model


def _node_test(operands: np.ndarray, state: Any, memory: np.ndarray | None, config: Mapping[str, int]) -> np.ndarray:
    """With testers for `width` boxes: children in slots beyond do not count."""
    operands = operands.copy()
    operands["count"] = np.minimum(operands["count"], config["width"])
    return node_test(operands)


def _traversal(operands: np.ndarray, state: Any, memory: np.ndarray | None, config: Mapping[str, int]) -> np.ndarray:
    """Through the tree whose blocks are the memory, uint32 (B, 16)."""
    assert memory is not None
    results, _ = trace_tree(memory, operands, width=config["width"], stack=config["stack"])
    return results


MODELS: dict[str, Model] = {
    **{name: _pure(_operator(unit, getattr(floats, name))) for name, unit in OPERATORS.items()},
    "ray_setup": _pure(ray_setup),
    "ray_triangle": _pure(ray_triangle),
    "ray_triangle_half": _pure(ray_triangle),
    "ray_time": _pure(ray_time),
    "box_setup": _pure(box_setup),
    "node_test": _node_test,
    "texel_project": _pure(texel_project),
    "texel_match": _pure(texel_match),
    "texel_blend": _pure(texel_blend),
    "traversal": _traversal,
}
"""Of every unit."""


def model_results(
    unit: str,
    operands: np.ndarray,
    config: Mapping[str, int] = MappingProxyType({}),
    *,
    state: Any = None,
    memory: np.ndarray | None = None,
) -> np.ndarray:
    """What hardware of this configuration answers, in the order of the operands.

    Raises KeyError where the unit's results depend on a parameter that `config` does not have.
    """
    return MODELS[unit](operands, state, memory, config)
