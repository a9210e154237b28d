"""The wrappers of memories in emitted Verilog: modules that others, with macros inside, may stand in for."""

import re
import textwrap
from collections import Counter
from typing import Any

from lightloom.rtl.fabric.memory import KINDS, READ_DURING_WRITE, Wrapper

MODULE = re.compile(r"^(?:// [^\n]*\n)*module (\w+)\(.*?^endmodule\n", re.MULTILINE | re.DOTALL)
"""A module whose name needs no escape, with the comment before it."""


def described(verilog: str) -> str:
    """The text with a comment before each wrapper: what it is, and what a read sees during a write."""

    def with_comment(module: re.Match[str]) -> str:
        wrapper = Wrapper.of(module[1])
        return module[0] if wrapper is None else _comment(wrapper) + module[0]

    return MODULE.sub(with_comment, verilog)


def _comment(wrapper: Wrapper) -> str:
    text = (
        f"{wrapper.depth} words of {wrapper.width} bits; w_data is written at a rising edge of clk where w_en is high; "
        f"{KINDS[wrapper.kind]}; {READ_DURING_WRITE[wrapper.read_during_write]}."
    )
    return "".join(f"// {line}\n" for line in textwrap.wrap(text, 112))


def split(verilog: str) -> tuple[str, str]:
    """The text without the wrappers, and the wrappers, which are "" where there are none."""
    wrappers = [module[0] for module in MODULE.finditer(verilog) if is_wrapper(module[1])]
    for text in wrappers:
        verilog = verilog.replace("\n" + text, "", 1)
    return verilog, "\n".join(wrappers)


def is_wrapper(module: str) -> bool:
    """Whether a module of this name is a wrapper."""
    return Wrapper.of(module) is not None


def memories_file(module: str) -> str:
    """The name of the file with the wrappers of a unit."""
    return f"{module}_memories.v"


def memories(verilog: str, wrappers: str) -> list[dict[str, Any]]:
    """Of each of the `wrappers`, ready for JSON: what it is, and how many instances of it are in the text `verilog`."""
    instances = Counter(re.findall(r"^  (\w+) \S+ +?\($", verilog, re.MULTILINE))
    return [
        {
            "module": module,
            "kind": wrapper.kind,
            "reads": wrapper.reads,
            "depth": wrapper.depth,
            "width": wrapper.width,
            "read_during_write": wrapper.read_during_write,
            "instances": instances[module],
        }
        for module in MODULE.findall(wrappers)
        if (wrapper := Wrapper.of(module)) is not None
    ]
