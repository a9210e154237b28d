"""Ray setup; `golden_model.tracing.ray_setup` explains it."""

from collections.abc import Mapping
from typing import Any

from amaranth import Cat, Const, Mux, Value

from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.dataflow import Dataflow, DataflowCore, Node
from lightloom.rtl.fabric.float_format import CANONICAL_NAN
from lightloom.rtl.intersection.float_flow import FloatFlow, exponent, is_finite, is_zero
from lightloom.rtl.intersection.ray_triangle import next_axis, previous_axis, select


class RaySetup(DataflowCore):
    """One ray a cycle: 3 reciprocals, 2 multipliers."""

    declared = PURE["ray_setup"]

    def compute(
        self, flow: Dataflow, config: Config, *, origin: list[Node], direction: list[Node], t_min: Node, t_max: Node
    ) -> Mapping[str, Any]:
        f = FloatFlow(flow, config.operators)
        # Registers where choices meet long logic; those before the reciprocals are done cost no latency.
        axis = flow.logic("axis", dominant_axis, *direction, stage=True)
        flip = flow.logic("flip", lambda axis, x, y, z: select(axis, x, y, z)[31], axis, *direction)
        kx = flow.logic("kx", lambda axis, flip: Mux(flip, previous_axis(axis), next_axis(axis)), axis, flip)
        ky = flow.logic("ky", lambda axis, flip: Mux(flip, next_axis(axis), previous_axis(axis)), axis, flip)
        finite = flow.logic("finite", lambda x, y, z: is_finite(x) & is_finite(y) & is_finite(z), *direction)

        inverse = [f.reciprocal(f"inverse{k}", direction[k]) for k in range(3)]
        sz = flow.logic("sz", select, axis, *inverse, stage=True)
        sx = f.multiply("sx", flow.logic("direction_kx", select, kx, *direction), sz)
        sy = f.multiply("sy", flow.logic("direction_ky", select, ky, *direction), sz)
        valid = flow.logic("valid", lambda finite, sz: finite & is_finite(sz) & ~is_zero(sz), finite, sz)

        return {
            "origin": [canonical(flow, f"origin_out{k}", origin[k]) for k in range(3)],
            "shear": [
                flow.logic(f"shear{k}", lambda valid, s: Mux(valid, s, CANONICAL_NAN), valid, s)
                for k, s in enumerate((sx, sy, sz))
            ],
            "t_min": canonical(flow, "t_min_out", t_min),
            "t_max": canonical(flow, "t_max_out", t_max),
            "axis": axis,
            "flip": flip,
            "inverse": inverse,
        }


def dominant_axis(x: Value, y: Value, z: Value) -> Value:
    """The axis of the greatest magnitude, the lowest of equal ones; bits without the sign order like numbers."""
    return Mux((x[:31] >= y[:31]) & (x[:31] >= z[:31]), 0, Mux(y[:31] >= z[:31], 1, 2))


def canonical(flow: Dataflow, name: str, operand: Node) -> Node:
    """Flushes subnormals and replaces NaN by the canonical one."""

    def bits(z: Value) -> Value:
        nan = ~is_finite(z) & z[:23].any()
        return Mux(nan, CANONICAL_NAN, Mux(exponent(z) == 0, Cat(Const(0, 31), z[31]), z))

    return flow.logic(name, bits, operand)
