"""Watertight ray-triangle intersection; `golden_model.tracing.ray_triangle` explains it."""

from collections.abc import Mapping
from functools import partial
from typing import Any

from amaranth import Array, Mux, Value

from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.dataflow import Dataflow, DataflowCore, Node
from lightloom.rtl.intersection.determinant import determinant_of, is_usable, reciprocal
from lightloom.rtl.intersection.float_flow import FloatFlow, is_finite, is_negative, is_positive


class RayTriangle(DataflowCore):
    """One ray-triangle test a cycle: 13 multipliers, 3 exact edge functions, 1 reciprocal."""

    declared = PURE["ray_triangle"]

    def compute(
        self,
        flow: Dataflow,
        config: Config,
        *,
        origin: list[Node],
        shear: list[Node],
        axis: Node,
        flip: Node,
        v0: list[Node],
        v1: list[Node],
        v2: list[Node],
        cull: Node,
        t_min: Node,
        t_max: Node,
    ) -> Mapping[str, Any]:
        f = FloatFlow(flow, config.operators)
        kx = flow.logic("kx", lambda axis, flip: Mux(flip, previous_axis(axis), next_axis(axis)), axis, flip)
        ky = flow.logic("ky", lambda axis, flip: Mux(flip, next_axis(axis), previous_axis(axis)), axis, flip)

        sheared = partial(_sheared, flow, f, origin, shear, (kx, ky, axis))
        ax, ay, az = sheared("a", v0)
        bx, by, bz = sheared("b", v1)
        cx, cy, cz = sheared("c", v2)

        edge_a = f.difference_of_products("edge_a", cx, by, cy, bx)
        edge_b = f.difference_of_products("edge_b", ax, cy, ay, cx)
        edge_c = f.difference_of_products("edge_c", bx, ay, by, ax)
        edges = (edge_a, edge_b, edge_c)
        negative = flow.logic("negative", lambda a, b, c: is_negative(a) | is_negative(b) | is_negative(c), *edges)
        positive = flow.logic("positive", lambda a, b, c: is_positive(a) | is_positive(b) | is_positive(c), *edges)
        inside = flow.logic("inside", lambda n, p, cull: ~(n & p) & ~(cull & n), negative, positive, cull)

        determinant = determinant_of(flow, config, *edges)
        sign = flow.logic("sign", lambda positive: ~positive, positive)
        inverse = reciprocal(flow, config, "reciprocal", determinant, sign)
        depth_ab = f.add("depth_ab", f.multiply("depth_a", edge_a, az), f.multiply("depth_b", edge_b, bz))
        depth = f.add("depth", depth_ab, f.multiply("depth_c", edge_c, cz))
        t = f.multiply("t", f.multiply("distance", depth, shear[2]), inverse)
        u = f.multiply("u", edge_b, inverse)
        v = f.multiply("v", edge_c, inverse)

        usable = flow.logic("usable", lambda r, inside: is_usable(r) & inside, inverse, inside)
        after = f.compare("after_t_min", t_min, t)["less"]
        order = f.compare("before_t_max", t, t_max)
        hit = flow.logic(
            "hit",
            lambda usable, t, after, less, equal: usable & is_finite(t) & after & (less | equal),
            *(usable, t, after, order["less"], order["equal"]),
        )
        return {
            "t": flow.logic("t_out", lambda hit, t: Mux(hit, t, 0), hit, t),
            "u": flow.logic("u_out", lambda hit, u: Mux(hit, u[:31], 0), hit, u),
            "v": flow.logic("v_out", lambda hit, v: Mux(hit, v[:31], 0), hit, v),
            "hit": hit,
            "front": flow.logic("front", lambda hit, positive: hit & positive, hit, positive),
        }


def _sheared(
    flow: Dataflow,
    f: FloatFlow,
    origin: list[Node],
    shear: list[Node],
    axes: tuple[Node, Node, Node],
    name: str,
    vertex: list[Node],
) -> tuple[Node, Node, Node]:
    """A vertex in the space in which the ray goes along z; its z is not scaled.

    The axes are permuted after the vertex is moved to the origin: the origin then needs no multiplexers.
    """
    sx, sy, _ = shear
    moved = [f.subtract(f"{name}_moved{k}", vertex[k], origin[k]) for k in range(3)]
    x, y, z = (flow.logic(f"{name}_{k.name}", select, k, *moved) for k in axes)
    return (
        f.subtract(f"{name}x", x, f.multiply(f"{name}_sx_z", sx, z)),
        f.subtract(f"{name}y", y, f.multiply(f"{name}_sy_z", sy, z)),
        z,
    )


class RayTriangleHalf(RayTriangle):
    """One ray-triangle test every other cycle: 6 multipliers, 2 exact edge functions, 1 reciprocal."""

    declared = PURE["ray_triangle_half"]

    def __init__(self, config: Config):
        super().__init__(config, interval=2)


def next_axis(axis: Value) -> Value:
    """(axis + 1) mod 3; an axis of 3 stands for 0."""
    return Array([1, 2, 0, 1])[axis]


def previous_axis(axis: Value) -> Value:
    """(axis + 2) mod 3; an axis of 3 stands for 0."""
    return Array([2, 0, 1, 2])[axis]


def select(axis: Value, x: Value, y: Value, z: Value) -> Value:
    """The component that `axis` names; an axis of 3 stands for 0."""
    return Mux(axis == 1, y, Mux(axis == 2, z, x))
