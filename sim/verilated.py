"""Verilog, a plain Verilog top and a C++ harness around it become one binary: Verilated, compiled and kept.

Each simulator is built once per text and option (`sim.toolchain.cache_folder`); parallel workers share it.
"""

import hashlib
import re
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from lightloom.gen.wrappers import is_wrapper
from lightloom.golden_model.host.outputs import whole_file
from lightloom.sim import toolchain

HEADER = Path(__file__).with_name("harness.h")
"""What the harnesses have in common."""

# Measured on ray_triangle. Verilator merges statements under one condition into branches that are mispredicted half of
# the time, and its last optimisation of the whole design gives each copy of a module code of its own (see `_sharing`).
VERILATE = ["-O3", "--x-assign", "fast", "--x-initial", "fast"]
VERILATE += ["--no-timing", "-Wno-fatal", "-fno-merge-cond", "-fno-dfg-scoped"]
# -Wno-fatal: what a warning means for the Verilog is judged once, by the lint of gen/lint.vlt, not by every build.
# Conditional moves instead of branches, for the same reason. No -march=native: a cached binary may be run on another
# machine.
COMPILE = ["-std=c++17", "-fno-thread-jumps", "-fno-split-paths"]
COMPILE += [f"--param=max-rtl-if-conversion-{kind}-cost=200" for kind in ("predictable", "unpredictable")]


def build(
    name: str,
    verilog: str,
    *,
    top: Path,
    others: Sequence[Path] = (),
    harness: Path,
    headers: Sequence[Path] = (),
    defines: Sequence[str],
    level: int = 2,
    objects: Sequence[Path] = (),
) -> Path:
    """The simulator's binary, from the cache where it holds one.

    `name` is part of the file's name; `verilog` the text under test, `top` the file of the module around it, which has
    the file's name and may use the modules in `others`. `harness` is C++ that includes "V<top>.h" and may include
    `headers`. `defines`, such as "TAG_BITS=8", hold for the Verilog and the C++. `level` is the compiler's -O: each
    takes about half of the next one's time; 0, for thousands of cycles, makes code that is six times slower than 2's,
    and 1, for hundreds of thousands, a third. `objects` are compiled files that are linked with it, such as one with
    `main`, where the harness has none.
    """
    verilator, compiler = toolchain.verilator(), toolchain.compiler()
    options = ["--cc", "--prefix", f"V{top.stem}", "--top-module", top.stem, *VERILATE]
    macros = [f"-D{define}" for define in defines]
    compile_ = [*COMPILE, f"-O{level}"]
    sharing = _sharing(verilog)
    texts = [path.read_text() for path in (top, *others, harness, *headers, HEADER)]
    recipe = [verilog, sharing, *texts, *options, *compile_, *macros]
    recipe += [verilator.version, toolchain.compiler_version()]
    recipe += [hashlib.sha256(path.read_bytes()).hexdigest() for path in objects]
    key = hashlib.sha256("\0".join(recipe).encode()).hexdigest()[:16]
    binary = toolchain.cache_folder() / top.stem / f"{name}-{key}"
    with toolchain.locked(binary):
        if binary.exists():
            return binary
        with whole_file(binary) as part, tempfile.TemporaryDirectory(prefix="lightloom-") as scratch:
            source = Path(scratch) / f"{name}.v"
            source.write_text(verilog)
            control = Path(scratch) / "sharing.vlt"
            control.write_text(sharing)
            files = [str(path) for path in (control, top, *others, source)]
            toolchain.run([verilator.binary, *options, *macros, "--Mdir", scratch, *files], env=verilator.env)
            # One translation unit: reading headers takes much of the compiler's time.
            sources = [*sorted(Path(scratch).glob("*.cpp")), harness]
            together = Path(scratch) / "together.cc"
            together.write_text("".join(f'#include "{path}"\n' for path in sources))
            command = [compiler, *toolchain.verilated_headers(compile_), *macros, "-I", scratch, str(together)]
            linked = [*map(str, objects), *toolchain.verilated_runtime()]
            toolchain.run([*command, *linked, "-o", str(part)])
    return binary


def _sharing(verilog: str) -> str:
    """Verilator control file: one C++ function for all instances of a module, where there are several.

    Otherwise the 40 operators of ray_triangle give twice as much code as fits into a processor's instruction cache.
    Verilator merges their functions only if nothing in them names the place of an instance; public inputs stay in it.
    """
    instances = Counter(re.findall(r"^  (\w+) \w+ \($", verilog, re.MULTILINE))
    lines = ["`verilator_config"]
    for module, count in sorted(instances.items()):
        if count > 1 and not is_wrapper(module):
            lines += [f'no_inline -module "{module}"', f'public_flat_rd -module "{module}" -var "i_*"']
    return "\n".join(lines) + "\n"
