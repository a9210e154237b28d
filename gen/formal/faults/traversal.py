"""Faults in the traversal unit and arrays of it, but for its control."""

from lightloom.gen.formal.mutations import Mutation

UNIT, VISITED, LOADER, ARRAY, NODE_STAGE = (
    f"rtl/traversal/{name}.py" for name in ("unit", "visited_blocks", "loader", "array", "node_stage")
)
BACKLOG = ("tests/rtl/test_visited_blocks.py",)

FAULTS = (
    Mutation(
        name="load-beside-prefetch",
        file=UNIT,
        old="loader.idle.eq(parts.idle & ~prefetching)",
        new="loader.idle.eq(parts.idle)",
        what="a tree is loaded while a block of the last one is prefetched",
        checks=("tests/rtl/test_traversal_unit.py::test_a_load_waits_for_a_prefetch",),
    ),
    Mutation(
        name="nodes-do-not-wait",
        file=UNIT,
        old="parts.node_blocks.backlog | parts.triangle_blocks.backlog",
        new="parts.triangle_blocks.backlog",
        what="rays run ahead though visits of nodes wait",
        checks=("tests/sim/test_traversal.py::test_hardly_a_visit_is_needless_where_a_test_is_busy",),
    ),
    Mutation(
        name="triangles-do-not-wait",
        file=UNIT,
        old="parts.node_blocks.backlog | parts.triangle_blocks.backlog",
        new="parts.node_blocks.backlog",
        what="rays run ahead though visits of triangles wait",
        checks=("tests/sim/test_traversal.py::test_hardly_a_visit_is_needless_where_a_test_is_busy",),
    ),
    Mutation(
        name="timer-stops-with-the-rest",
        file=UNIT,
        old="m.submodules.read_timer = timer = ReadTimer()",
        new="m.submodules.read_timer = ResetInserter(self._arbiter.aborting)(timer := ReadTimer())",
        what="an abort resets the timer that it waits for",
        checks=("tests/verif/test_traversal.py::test_aborts_of_an_array",),
    ),
    Mutation(
        name="backlog-one-more",
        file=VISITED,
        old="queue.level >= BACKLOG",
        new="queue.level > BACKLOG",
        what="a visit more waits in front of a cache before rays no longer run ahead",
        checks=BACKLOG,
    ),
    Mutation(
        name="crowd-untold",
        file=VISITED,
        old="(queue.level >= BACKLOG) | cache.crowded",
        new="queue.level >= BACKLOG",
        what="rays run ahead though many reads wait for the memory",
        checks=BACKLOG,
    ),
    Mutation(
        name="load-lost",
        file=LOADER,
        old="""        with m.If(self.load):
            m.d.sync += [asked.eq(1), base.eq(self.base)]
        with m.Elif(self.go):
            m.d.sync += asked.eq(0)""",
        new="""        with m.If(self.load):
            m.d.sync += base.eq(self.base)
        with m.If(self.go):
            m.d.sync += asked.eq(0)
        with m.Elif(self.load):
            m.d.sync += asked.eq(1)""",
        what="a load in the cycle in which another begins is lost",
        checks=("loader/the-last-load-counts", "tests/rtl/test_traversal_unit.py::test_the_loader_waits_for_rays"),
    ),
    Mutation(
        name="array-forgets-its-addresses",
        file=ARRAY,
        old="self.abort | (self.aborting & self.m_axi.arvalid)",
        new="self.abort",
        what="an abort ends while an address waits at the array's port",
        checks=("tests/verif/test_traversal.py::test_aborts_of_an_array",),
    ),
    Mutation(
        name="array-loads-during-an-abort",
        file=ARRAY,
        old="unit.load.eq(self.load & ~self.aborting)",
        new="unit.load.eq(self.load)",
        what="units whose abort is over load a tree, and others do not",
        checks=("tests/verif/test_traversal.py::test_aborts_of_an_array",),
    ),
    Mutation(
        name="array-takes-rays-during-an-abort",
        file=ARRAY,
        old="self.i.ready.eq(chosen.any() & ~self.aborting)",
        new="self.i.ready.eq(chosen.any())",
        what="units whose abort is over take rays",
        checks=("tests/verif/test_traversal.py::test_aborts_of_an_array",),
    ),
    Mutation(
        name="array-keeps-a-result",
        file=ARRAY,
        old="ResetInserter(self.aborting)(results)",
        new="results",
        what="a result that waits in the array is given during an abort",
        checks=("tests/verif/test_traversal.py::test_aborts_of_an_array",),
    ),
    Mutation(
        name="array-counts-during-an-abort",
        file=ARRAY,
        old="Mux(self.aborting, 0, total)",
        new="total",
        what="for a cycle counters are what they were before the abort",
        checks=("tests/verif/test_traversal.py::test_aborts_of_an_array",),
    ),
    Mutation(
        name="order-of-no-children",
        file=NODE_STAGE,
        old="(block.count != 0) & (block.base <= visit.address)",
        new="block.base <= visit.address",
        what="a node without children fails for where they would be",
        checks=("tests/rtl/test_traversal_unit.py::test_a_node_without_children_is_no_error",),
    ),
    Mutation(
        name="time-of-next-visit",
        file=NODE_STAGE,
        old="Mux(advance, self.i.payload.tag.context, visit.context)",
        new="self.i.payload.tag.context",
        what="a visit that waits takes the distance of the ray that comes after it",
        checks=("tests/sim/test_traversal.py::test_visits_that_wait_keep_to_their_own_rays",),
    ),
    Mutation(
        name="time-not-held",
        file=NODE_STAGE,
        old="            m.d.sync += test.t_max.eq(self.time_read.time)",
        new="        m.d.sync += test.t_max.eq(self.time_read.time)",
        what="the distance of a visit changes while it waits",
        checks=("tests/sim/test_traversal.py::test_visits_that_wait_keep_to_their_own_rays",),
    ),
)
