# amaranth: UnusedElaboratable=no
# (a bench is also made only to ask what it has to reach)
"""A formal bench: a component, inputs that may be anything, and what has to hold about it.

It is a top of its own, never part of what is emitted. All that a proof needs of a solver is written in three words:
`require` (assert), `assume` and `reach` (cover).
"""

from collections.abc import Container
from typing import Any

from amaranth.back import rtlil
from amaranth.hdl import Assert, Assume, ClockDomain, Const, Cover, Fragment, MemoryInstance, Module, Signal, Value
from amaranth.lib import wiring
from amaranth.lib.wiring import In

FIRST = "bench_first_cycle"
"""The one register whose initial value counts (`gen.formal.solve` strips all others)."""
NARROW = "bench_narrow"
"""The constant that says whether only the runs are looked at that `Bench.narrow` leaves."""


class Bench:
    """Wraps one component; `rst` is high in the first cycle and anything afterwards.

    Attributes: `m`, the module that the proof adds to, whose `sync` registers are reset with the component;
    `settled`, this cycle is neither the first nor one of reset: only then does `require` bind; `covers`, the labels of
    what has to be reached, in order. Runs that reach it have no reset but the first.
    """

    def __init__(self, component: wiring.Component | None = None, *, driven: Container[str] = ()):
        """`driven`: inputs (paths joined by __) that the proof drives itself; all others may be anything."""
        self.m = Module()
        self._domain = ClockDomain("sync")
        self._inputs: dict[str, Signal] = {}
        self._labels: set[str] = set()
        self.covers: list[str] = []
        first = Signal(init=1, reset_less=True, name=FIRST)
        self.m.d.sync += first.eq(0)
        self.settled = Signal()
        self.m.d.comb += [Assume(self._domain.rst | ~first), self.settled.eq(~first & ~self._domain.rst)]
        self._narrow = self.constant(NARROW)
        self.narrow(first | ~self._domain.rst)
        self._named: dict[int, tuple[Fragment, dict[str, list[Signal]]]] = {}
        self._fragment = None
        if component is not None:
            self._fragment = self.add("dut", component)
            for path, member, value in component.signature.flatten(component):
                name = "__".join(map(str, path))
                if member.flow == In and name not in driven:
                    self.m.d.comb += Value.cast(value).eq(self.any(name, len(Value.cast(value))))

    def add(self, name: str, component: Any) -> Fragment:
        """Puts a further component beside the one under test; its inputs are for the proof to drive."""
        fragment = Fragment.get(component, "formal")  # FIFOs and memories state for this platform what they rely on
        self.m.submodules[name] = fragment
        return fragment

    # --- values that the solver chooses -------------------------------------------------------------------------------

    def any(self, name: str, shape: Any = 1) -> Signal:
        """A value that may change in every cycle: an input of the top."""
        assert name not in self._inputs
        self._inputs[name] = Signal(shape, name=name)
        return self._inputs[name]

    def constant(self, name: str, shape: Any = 1) -> Signal:
        """A value that may be anything and never changes: a register without reset or initial value."""
        value = Signal(shape, name=name, reset_less=True)
        self.m.d.sync += value.eq(value)
        return value

    # --- what holds ---------------------------------------------------------------------------------------------------

    def require(self, label: str, condition: Any) -> None:
        """`condition` holds in every settled cycle."""
        assert label not in self._labels, f"two properties are named {label}"
        self._labels.add(label)
        holds = Signal(name=f"require_{label}")
        statement = Assert(holds)
        statement.src_loc = (label, 0)  # what solvers name a property by
        self.m.d.comb += [holds.eq(~self.settled | Value.cast(condition).any()), statement]

    def assume(self, condition: Any) -> None:
        """The surroundings see to it that `condition` holds in every cycle."""
        self.m.d.comb += Assume(Value.cast(condition).any())

    def reach(self, label: str, condition: Any) -> None:
        """There is a run in which `condition` comes to hold: the assumptions leave room for it. `label` is one word."""
        assert label not in self.covers, f"two covers are named {label}"
        self.covers.append(label)
        statement = Cover(self.settled & self._narrow & Value.cast(condition).any())
        statement.src_loc = (label, 0)
        self.m.d.comb += statement

    def narrow(self, condition: Any) -> None:
        """What is to be reached is looked for among runs in which `condition` holds in every cycle: it is found sooner.

        It binds no proof: there the solver may choose any run.
        """
        self.assume(~self._narrow | Value.cast(condition).any())

    def past(self, value: Any, name: str) -> Signal:
        """`value` one cycle before; 0 in the first cycle after a reset."""
        value = Value.cast(value)
        before = Signal(value.shape(), name=f"past_{name}")
        self.m.d.sync += before.eq(value)
        return before

    # --- inside of the component --------------------------------------------------------------------------------------

    def inner(self, path: str, beside: Fragment | None = None) -> Signal:
        """A signal inside the component, or inside one that was put `beside` it, such as "fifo/level": names of
        submodules, then the signal's."""
        *modules, name = path.split("/")
        found = self._signals(self._inside(modules, beside)).get(name, [])
        assert len(found) == 1, f"{path}: {len(found)} signals of this name"
        return found[0]

    def depth(self, path: str) -> int:
        """Words of a memory inside the component."""
        return self._memory(path)._data.depth

    def peek(self, path: str, address: Any, name: str) -> Signal:
        """What a memory inside the component holds at `address`, without touching it."""
        memory = self._memory(path)
        at = Signal(range(memory._data.depth), name=f"{name}_address")
        data = Signal(len(Value.cast(Signal(memory._data.shape))), name=name)
        self.m.d.comb += at.eq(address)
        memory.read_port(domain="comb", addr=at, data=data, en=Const(1), transparent_for=())
        return data

    def _memory(self, path: str) -> MemoryInstance:
        memory = self._inside([*path.split("/"), "words"])
        assert isinstance(memory, MemoryInstance), f"{path} is no memory"
        return memory

    def _inside(self, modules: list[str], beside: Fragment | None = None) -> Fragment:
        fragment = beside or self._fragment
        assert fragment is not None
        for module in modules:
            fragment = fragment.find_subfragment(module)
        return fragment

    def _signals(self, fragment: Fragment) -> dict[str, list[Signal]]:
        """The signals in the statements of a fragment, by name. Properties ask for hundreds of them."""
        if id(fragment) not in self._named:
            signals = {
                id(signal): signal
                for statements in fragment.statements.values()
                for statement in statements
                for signal in [*statement._lhs_signals(), *statement._rhs_signals()]
            }
            named: dict[str, list[Signal]] = {}
            for signal in signals.values():
                named.setdefault(signal.name, []).append(signal)
            self._named[id(fragment)] = fragment, named  # kept, so that no other gets its number
        return self._named[id(fragment)][1]

    # --- out ----------------------------------------------------------------------------------------------------------

    def rtlil(self) -> str:
        """The bench as RTLIL, module `top`."""
        self.m.domains += self._domain
        fragment = Fragment.get(self.m, None)
        ports = {"clk": self._domain.clk, "rst": self._domain.rst, **self._inputs}
        return rtlil.convert_fragment(fragment, {name: (port, None) for name, port in ports.items()}, "top")[0]
