"""Faults in the tests of rays against boxes."""

from lightloom.gen.formal.mutations import Mutation

BOX_AXIS = "rtl/intersection/box_axis.py"

FAULTS = (
    Mutation(
        name="slope-interval",
        file=BOX_AXIS,
        old="Mux(~way[-1] if far else way[-1], slope + 1, slope)",
        new="Mux(way[-1] if far else ~way[-1], slope + 1, slope)",
        what="the slope is rounded inwards",
        checks=("node_test/no-false-reject-near",),
    ),
    Mutation(
        name="short-slope-down",
        file=BOX_AXIS,
        old="return short + 1 if far else short",
        new="return short",
        what="the far planes' short slope is rounded down",
        checks=("node_test/no-false-reject-near",),
    ),
    Mutation(
        name="saturates-inwards",
        file=BOX_AXIS,
        old="Mux(saturates, (~sign).replicate(size), shifted)",
        new="Mux(saturates, sign.replicate(size), shifted)",
        what="saturated distances are at the wrong end",
        checks=("node_test/no-false-reject-near",),
    ),
    Mutation(
        name="planes-exchanged",
        file=BOX_AXIS,
        old="list(zip(upper, lower, strict=True))",
        new="list(zip(lower, upper, strict=True))",
        what="the far plane is the near one",
        checks=("node_test/no-false-reject-near",),
    ),
    Mutation(
        name="rounding-lost",
        file=BOX_AXIS,
        old="rows.append(Const(2 << (slope - 1), width))",
        new="rows.append(Const(1 << (slope - 1), width))",
        what="the far distance is rounded up once instead of twice",
        checks=("node_test/as-the-model",),
    ),
    Mutation(
        name="pad-inwards",
        file=BOX_AXIS,
        old="wide_pad if far else ~wide_pad]",
        new="wide_pad]",
        what="the near planes are moved inwards",
        checks=("node_test/no-false-reject-near",),
    ),
    Mutation(
        name="corner-of-forward-rays",
        file=BOX_AXIS,
        old="last = Mux(backwards, (1 << widths.arithmetic.plane) - 1, 0)",
        new="last = 0",
        what="rays that go backwards count planes from the wrong corner",
        checks=("node_test/no-false-reject-near",),
    ),
)
