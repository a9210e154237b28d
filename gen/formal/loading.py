"""What asks for another tree: no request is lost, and the last one counts."""

from amaranth import Signal

from lightloom.gen.formal.bench import Bench
from lightloom.gen.formal.properties import Induction, Property
from lightloom.rtl.traversal.loader import Loader

ADDRESS_BITS = 8


def loads() -> Bench:
    component = Loader(ADDRESS_BITS)
    bench = Bench(component)
    m = bench.m
    wanted = Signal()
    base = Signal(ADDRESS_BITS)
    m.d.sync += wanted.eq(component.load | (wanted & ~component.go))
    with m.If(component.load):
        m.d.sync += base.eq(component.base)
    bench.require("remembered", bench.inner("asked") == wanted)
    bench.require("as_soon_as_it_can", component.go == (wanted & component.idle & ~component.busy))
    bench.require("the_last_base", ~wanted | (component.next_base == base))
    bench.require("no_ray_meanwhile", component.loading == (wanted | component.busy))
    bench.reach("load_with_go", component.go & component.load)
    bench.reach("two_loads_in_one", component.go & bench.past(component.load & wanted, "second"))
    return bench


def properties() -> list[Property]:
    return [
        Property(
            unit="loader",
            name="the-last-load-counts",
            says="a request to load begins as soon as it can, with the last base, also one in the cycle of another's",
            method=Induction(depth=1),
            build=loads,
            reach=5,
            quick=True,
        )
    ]
