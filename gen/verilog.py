"""Verilog-2001 of a unit."""

import os
import re
from collections.abc import Iterator
from typing import Any

from amaranth.hdl import ClockDomain, ClockSignal, Fragment, Instance, ResetSignal, Signal, Value
from amaranth.lib import data, wiring
from amaranth.lib.wiring import In

from lightloom.gen.wrappers import described
from lightloom.rtl.buses import component, module_name
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.memory import Wrapped
from lightloom.rtl.fabric.pipeline import Core, StreamUnit
from lightloom.rtl.fabric.unit import UnitComponent

# The Yosys wheel, never a Yosys of the host: the text must not depend on the machine.
os.environ["AMARANTH_USE_YOSYS"] = "builtin"

from amaranth._toolchain.yosys import find_yosys
from amaranth.back import rtlil

# Instead of Amaranth's own script: registers come out as `if (rst) … else if (en) q <= d`, no dead wires are left, and
# nothing is asked of a Verilog-2001 reader that only some have (functions with don't-cares, initial values).
SCRIPT = """
read_rtlil <<rtlil
{rtlil}
rtlil
# No initial values: ASIC flows drop them, so nothing may depend on them. In Icarus all registers then start as X, and
# the benches show that reset is enough. The same holds for the contents of memories.
attrmap -remove init -remove amaranth.decoding
delete t:$meminit t:$meminit_v2
attrmap -modattr -remove generator -remove top -remove amaranth.hierarchy
# `proc` without proc_rmdead, which would put X where it finds a default out of reach, and without proc_rom.
proc_clean
proc_prune
proc_init
proc_arst
proc_mux
proc_dlatch
proc_dff
proc_memwr
proc_clean
memory_collect
# No wider than what is used: otherwise every sum carries, and every shift keeps, bits that nobody reads.
wreduce
opt_expr
opt_merge
opt_clean
# The synchronous reset and enable of what rst reaches; enables only of all other registers.
opt_dff w:rst %co4:+$mux[S,Y]:+$dff[D] t:$dff %i
opt_dff -nosdff -simple-dffe
# What a register takes while it is not enabled has become a don't-care: the other side of its multiplexer stays.
opt_expr -mux_undef
# The top of a unit keeps the names of its payloads' fields, for those who look at waves.
opt_clean -purge {purged}
opt_clean {top}
attrmap -remove unused_bits
write_verilog -noparallelcase
"""

Shared = Core | UnitComponent | Wrapped

AXI, BUS = "m_axi", "s_axi"
"""The members of a component's signature that are its AXI4 interface, and that of its registers."""


def verilog_of(unit: str, config: Config, prefix: str = "", bus: str = "") -> str:
    """The Verilog of one unit of the catalogue (KeyError for an unknown one), behind `bus` where one is named.

    Its module is `unit` (of a bus: `rtl.buses.module_name`) with `prefix` before it; the names of the modules
    inside begin with that.
    Ports: clk, rst (synchronous, active high), i__valid, i__ready, i__payload, o__valid, o__ready, o__payload.
    """
    return convert(component(unit, config, bus), prefix + module_name(unit, bus))


def convert(component: wiring.Component, name: str) -> str:
    """The Verilog of a component, as module `name`; the modules that it is made of are named `name`_…"""
    # Amaranth ignores Yosys's warnings too: they are about processes, which are gone before anything is written.
    yosys = find_yosys(lambda version: version >= (0, 40))
    return described(yosys.run(["-q", "-"], script_of(component, name), ignore_warnings=True))


def script_of(component: wiring.Component, name: str) -> str:
    """What Yosys is given, on which alone the Verilog of a component depends."""
    fragment = Fragment.get(component, None)
    shared: dict[str, tuple[Shared, Fragment]] = {}
    _share(fragment, name, f"{name}_unit", shared)
    texts = [_component_rtlil(fragment, name, component)]
    for module, (one, part) in shared.items():
        texts.append((_core_rtlil if isinstance(one, Core) else _component_rtlil)(part, module, one))
    purged = f"* {name} %d" if isinstance(component, StreamUnit) else "*"
    return SCRIPT.format(rtlil="\n".join(texts), top=name, purged=purged)


def ports_of(component: wiring.Component) -> Iterator[tuple[str, wiring.Member, Value]]:
    """Name, member and value of every port.

    Names of paths are joined by __, as Amaranth does it. Those of an AXI interface are a prefix and AXI's own names, as
    everybody does it, whether it is a port to read, one to write, or both.
    """
    for path, member, value in component.signature.flatten(component):
        name = f"{path[0]}_{path[-1]}" if path[0] in (AXI, BUS) else "__".join(map(str, path))
        yield name, member, Value.cast(value)


def _share(fragment: Fragment, top: str, unit: str, shared: dict[str, tuple[Shared, Fragment]]) -> None:
    """Replaces what is there several times below `fragment` by instances of one module.

    These are the cores of one function, latency and interval, the units that a unit is made of, and its memories, whose
    modules are the wrappers. Otherwise Amaranth writes a module for each of the 40 operators in a ray-triangle unit,
    which takes most of the time and makes the text five times as long. Units are called `unit`, those inside of them
    `unit`_unit. Fills `shared`: module name to a component and its logic.
    """
    for index, (part, instance_name, location) in enumerate(fragment.subfragments):
        one = part.origins[0] if part.origins else None
        if isinstance(one, Core):
            module = f"{top}_core" if one.unit.name == top else f"{top}_{_named(one)}"
            ports = {f"i_{name}": value for name, value in _controls(one)}
            ports |= {f"i_i_{name}": value for name, value in _fields(one.i)}
            ports |= {f"o_o_{name}": value for name, value in _fields(one.o)}
        elif isinstance(one, UnitComponent):
            module = unit
            ports = {"i_rst": ResetSignal()} | _instance_ports(one)
        elif isinstance(one, Wrapped):
            module, ports = f"{top}_{one.wrapper.name}", _instance_ports(one)
            for name, _, value in ports_of(one):
                value.name = f"{instance_name}_{name}"  # else all memories of a module have the same names
        else:
            _share(part, top, unit, shared)
            continue
        if module not in shared:
            _share(part, top, f"{unit}_unit" if module == unit else unit, shared)
            shared[module] = (one, part)
        assert type(shared[module][0]) is type(one), f"{module} would stand for two different components"
        fragment.subfragments[index] = (Instance(module, i_clk=ClockSignal(), **ports), instance_name, location)


def _instance_ports(component: wiring.Component) -> dict[str, Value]:
    """What the ports of an instance are connected to, by the names that `Instance` takes."""
    return {f"{'i' if member.flow == In else 'o'}_{name}": value for name, member, value in ports_of(component)}


def _named(core: Core) -> str:
    """What a core does, and how many cycles it takes."""
    interval = core.initiation_interval
    return f"{core.unit.name}_depth{core.latency}" + (f"_interval{interval}" if interval > 1 else "")


def _component_rtlil(fragment: Fragment, name: str, component: wiring.Component) -> str:
    """A component as a module with its ports, its clock and, where it is no memory, its reset."""
    clock = ClockDomain("sync", reset_less=isinstance(component, Wrapped))
    return _rtlil(fragment, name, clock, {port: value for port, _, value in ports_of(component)})


def _core_rtlil(fragment: Fragment, name: str, core: Core) -> str:
    """A core as a module with a port for every field of its operands and results."""
    ports: dict[str, Value] = dict(_controls(core))
    for field, value in _fields(core.i):
        ports[f"i_{field}"] = port = Signal(len(value), name=f"i_{field}")
        fragment.add_statements("comb", value.eq(port))
    for field, value in _fields(core.o):
        ports[f"o_{field}"] = port = Signal(len(value), name=f"o_{field}")
        fragment.add_statements("comb", port.eq(value))
    return _rtlil(fragment, name, ClockDomain("sync", reset_less=True), ports)  # a core's data has no reset


def _controls(core: Core) -> Iterator[tuple[str, Value]]:
    yield "en", core.en
    if core.initiation_interval > 1:
        yield "phase", core.phase


def _fields(view: data.View) -> Iterator[tuple[str, Value]]:
    for name, _ in view.shape():
        yield name, Value.cast(view[name])


def _rtlil(fragment: Fragment, name: str, clock: ClockDomain, ports: dict[str, Value]) -> str:
    fragment.add_domains(clock)
    clocks = {"clk": clock.clk} | ({} if clock.rst is None else {"rst": clock.rst})
    directed: dict[str, Any] = {port: (value, None) for port, value in (clocks | ports).items()}
    text, _ = rtlil.convert_fragment(fragment, directed, name, emit_src=False)
    # Amaranth gives every choice a default; told that it is out of reach, Yosys would put X there.
    return re.sub(r"^ *attribute \\full_case 1\n", "", text, flags=re.MULTILINE)
