"""The intake of a traversal unit: everything that is computed once a ray, before it takes a context."""

import numpy as np
from amaranth import Cat, Const, Module, Signal, Value
from amaranth.lib import data, stream, wiring
from amaranth.lib.wiring import In, Out

from lightloom.golden_model.contract.formats import BVH_HEADER, LEAF_RAY, RAY_QUERY
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.dataflow import Dataflow
from lightloom.rtl.fabric.layouts import layout_of, packet_of
from lightloom.rtl.fabric.queues import Queue
from lightloom.rtl.intersection.box_setup import BoxSetup
from lightloom.rtl.intersection.float_flow import is_finite
from lightloom.rtl.intersection.ray_setup import RaySetup
from lightloom.rtl.operators.float_compare import FloatCompare
from lightloom.rtl.traversal.records import NODE_RAY

PREPARED = 16
"""Rays inside. A context is taken only when a ray is prepared, so that contexts wait for memory and not for this."""

LATTICE = np.dtype([(name, BVH_HEADER[name]) for name in ("lattice_origin", "lattice_exponent")])


def ray_status(config: Config) -> data.StructLayout:
    """What the result needs to know of a ray beside its hit."""
    return data.StructLayout({"tag": config.streams.tag_width, "any_hit": 1, "invalid": 1, "no_tree": 1})


class Intake(wiring.Component):
    """ray_setup and box_setup, and what can be said about a ray without traversing it.

    Ports:

    - `i`: stream of RAY_QUERY with a tag.
    - `o`: stream of prepared rays, in the same order. `skip`: the ray has nothing to traverse, because it is invalid,
      its range of t is empty, or there was no tree (`no_tree`) when it came.
    - `tree`: there is a tree. `lattice`: its lattice; it must not change while a ray is inside.
    - `idle`: no ray is inside.
    """

    def __init__(self, config: Config):
        self._config = config
        prepared = data.StructLayout(
            {"leaf": layout_of(LEAF_RAY), "node": layout_of(NODE_RAY), "status": ray_status(config), "skip": 1}
        )
        super().__init__(
            {
                "i": In(stream.Signature(packet_of(RAY_QUERY, config.streams.tag_width))),
                "o": Out(stream.Signature(prepared)),
                "tree": In(1),
                "lattice": In(layout_of(LATTICE)),
                "idle": Out(1),
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        config = self._config
        m.submodules.prepared = prepared = Queue(self.o.payload.shape(), PREPARED)
        wiring.connect(m, prepared.o, wiring.flipped(self.o))

        inside = Signal(range(PREPARED + 1))
        enter, leave = self.i.valid & self.i.ready, self.o.valid & self.o.ready
        m.d.comb += [self.i.ready.eq(inside != PREPARED), self.idle.eq(inside == 0)]
        m.d.sync += inside.eq(inside + enter - leave)

        # The pipeline never stops: whatever enters has a place in the queue.
        flow = Dataflow(m, Const(1))
        query = {name: flow.source(self.i.payload.data[name], name) for name in RAY_QUERY.names or ()}
        tag = flow.source(self.i.payload.tag, "tag")
        no_tree = flow.source(~self.tree, "no_tree")
        setup = flow.apply(
            "ray_setup", RaySetup(config), **{name: query[name] for name in ("origin", "direction", "t_min", "t_max")}
        )
        box = flow.apply(
            "box_setup",
            BoxSetup(config),
            direction=query["direction"],
            **{name: setup[name] for name in ("origin", "inverse", "axis", "t_min")},
            **{name: self.lattice[name] for name in LATTICE.names or ()},  # as constant as the tree
        )
        order = flow.apply("order", FloatCompare(config.operators.compare_depth), a=setup["t_min"], b=setup["t_max"])
        invalid = flow.logic("invalid", is_invalid, setup["origin"], setup["shear"], order["unordered"])
        skip = flow.logic("skip", lambda a, b, less: a | b | ~less, invalid, no_tree, order["less"])

        time = max(node.time for node in (*box.values(), skip))
        of_ray = {name: query[name] for name in ("any_hit", "cull", "mask")}
        of_leaf = {**setup, **of_ray, "rate": box["rate"], "scale": box["scale"]}
        item: data.View = prepared.i.payload
        m.d.comb += [item.leaf[name].eq(flow.at(of_leaf[name], time)) for name in LEAF_RAY.names or ()]
        m.d.comb += [item.node[name].eq(flow.at(box[name], time)) for name in NODE_RAY.names or ()]
        status = {"tag": tag, "any_hit": query["any_hit"], "invalid": invalid, "no_tree": no_tree}
        m.d.comb += [item.status[name].eq(flow.at(node, time)) for name, node in status.items()]
        valid: Value = enter
        for stage in range(time):
            later = Signal(name=f"valid{stage}")
            m.d.sync += later.eq(valid)
            valid = later
        m.d.comb += [item.skip.eq(flow.at(skip, time)), prepared.i.valid.eq(valid)]
        return m


def is_invalid(origin: Value, shear: Value, unordered: Value) -> Value:
    """Of a ray after ray_setup: whether origin, direction or range keep it from hitting anything at all."""
    numbers = [Value.cast(vector).word_select(k, 32) for vector in (origin, shear) for k in range(3)]
    return ~Cat(is_finite(z) for z in numbers).all() | unordered
