"""The `lightloom` command: what every subcommand shares is here, each of them is a module of `lightloom.commands`.

Exit codes: 0 done; 1 a comparison found a difference; 2 bad input, said in one line on stderr; 70 a fault of
Lightloom's own, with its traceback; 130 interrupted. Whatever the code, outputs are whole or not there. What is left
out of the input is said in a line on stderr too, and changes no code.
"""

import os
import signal
import sys
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Annotated, TextIO

import typer
from typer.main import get_command

from lightloom.commands import (
    bench,
    compare,
    coverage,
    demo,
    emit,
    fpga,
    irradiance,
    layout,
    pack,
    package,
    policies,
    prove,
    render,
    sim,
    synth,
    trace,
)
from lightloom.golden_model.host.errors import InputError, InputWarning

DIFFERENT, BAD_INPUT, OWN_FAULT, INTERRUPTED, TERMINATED = 1, 2, 70, 130, 143

app = typer.Typer(
    help="Lightloom: hardware that keeps lightmaps alive. Verilog, the golden model, and the proof that they agree.",
    epilog="Exit codes: 0 done, 1 a difference was found, 2 bad input, 130 interrupted. Outputs are written whole or "
    "not at all. SCENE is a mesh (.obj, .ply, .glb, .gltf), a scene file (.toml), or `cornell-box`, which is built in.",
    rich_markup_mode=None,  # plain help: the same text in a terminal, in a pipe and in the documentation
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
for _command in (
    demo.demo,
    render.render,
    policies.policies,
    emit.emit,
    synth.synth,
    fpga.fpga,
    prove.prove,
    package.package,
    layout.layout,
    pack.pack,
    trace.trace,
    irradiance.irradiance,
    compare.compare,
    bench.bench,
    sim.sim,
    coverage.coverage,
):
    app.command()(_command)


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"lightloom {version('lightloom')}")
        raise typer.Exit()


@app.callback()
def _lightloom(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and exit.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    """Options before the command's name."""


@contextmanager
def _warnings_said() -> Iterator[None]:
    """What was left out of the input is said in a line on stderr each, the same line once."""
    said: set[str] = set()

    def show(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        if not issubclass(category, InputWarning):
            others(message, category, filename, lineno, file, line)
        elif str(message) not in said:
            said.add(str(message))
            print(f"warning: {message}", file=sys.stderr)

    with warnings.catch_warnings():
        others = warnings.showwarning
        warnings.simplefilter("always", InputWarning)
        warnings.showwarning = show
        yield


def run(arguments: Sequence[str]) -> int:
    """Runs one command line (without the program's name) and returns its exit code."""
    try:
        with _warnings_said():
            code = get_command(app).main(
                args=list(arguments) or ["--help"], prog_name="lightloom", standalone_mode=False
            )
        sys.stdout.flush()
        return code or 0
    except (InputError, typer.TyperException) as error:
        message = error.format_message() if isinstance(error, typer.TyperException) else str(error)
    except OSError as error:
        message = f"{error.filename or 'standard output'}: {error.strerror or error}"
    except MemoryError:
        message = "not enough memory; use a smaller scene, a smaller --size or fewer rays"
    except (KeyboardInterrupt, typer.Abort):
        print("interrupted; nothing was written", file=sys.stderr)
        return INTERRUPTED
    except Exception:
        traceback.print_exc()
        return OWN_FAULT
    print(f"error: {' '.join(message.split())}", file=sys.stderr)
    return BAD_INPUT


def main() -> None:
    """The console entry point."""
    # A polite kill unwinds like Ctrl-C, so that scratch files go.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(TERMINATED))
    code = run(sys.argv[1:])
    try:
        sys.stdout.flush()
    except OSError:
        # Said already. What is left in the buffer would fail again on the way out and take the place of the exit code.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(code)
