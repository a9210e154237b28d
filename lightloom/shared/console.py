"""What commands show: tables and JSON on stdout, progress on stderr, so that stdout can always be piped."""

import json
import math
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

Advance = Callable[[float], None]


class Progress:
    """Stages of a long job: a bar each on a terminal, one line each elsewhere; `seconds` keeps how long each took.

    A context manager. A `quiet` one keeps the times and shows nothing, for what runs beside others.
    """

    def __init__(self, quiet: bool = False) -> None:
        self.seconds: dict[str, float] = {}
        self.quiet = quiet
        self._bars: Any = None
        if sys.stderr.isatty() and not quiet:
            from rich import progress
            from rich.console import Console

            self._bars = progress.Progress(
                progress.SpinnerColumn(finished_text="[green]✓"),
                progress.TextColumn("{task.description}"),
                progress.BarColumn(bar_width=32),
                progress.TaskProgressColumn(),
                progress.TimeElapsedColumn(),
                console=Console(stderr=True),
            )

    def __enter__(self) -> "Progress":
        if self._bars is not None:
            self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bars is not None:
            self._bars.stop()

    @contextmanager
    def stage(self, name: str, total: float = 1) -> Iterator[Advance]:
        """One stage of `total` steps; yields the function that reports how many more of them are done."""
        task = self._bars.add_task(name, total=total) if self._bars is not None else None
        started = time.perf_counter()

        def advance(steps: float = 1) -> None:
            if task is not None:
                self._bars.advance(task, steps)

        yield advance
        self.seconds[name] = time.perf_counter() - started
        if task is not None:
            self._bars.update(task, completed=total)
        elif not self.quiet:
            print(f"{name}: {self.seconds[name]:.1f} s", file=sys.stderr, flush=True)


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """A table on stdout; columns whose cells are numbers, or None, are set right-aligned. None is a dash."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, title_justify="left", title_style="bold")
    for index, column in enumerate(columns):
        numeric = bool(rows) and all(
            isinstance(row[index], int | float | np.number) or row[index] in ("", None) for row in rows
        )
        table.add_column(column, justify="right" if numeric else "left")
    for row in rows:
        table.add_row(*(_cell(value) for value in row))
    # Elsewhere than on a terminal nothing is cut off or wrapped.
    Console(width=None if sys.stdout.isatty() else 160, markup=False, highlight=False).print(table)


def _cell(value: object) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, int | np.integer):
        return f"{value:,}"
    if isinstance(value, float | np.floating):
        number = float(value)
        return f"{number:,.0f}" if abs(number) >= 1e4 else f"{number:.5g}"
    return str(value)


def json_text(data: object) -> str:
    """Strict JSON: NumPy values become plain ones, numbers that are not finite become null."""
    return json.dumps(_plain(data), indent=2, allow_nan=False) + "\n"


def print_json(data: object) -> None:
    """JSON on stdout, and nothing else there."""
    sys.stdout.write(json_text(data))


def _plain(data: Any) -> Any:
    if isinstance(data, dict):
        return {str(key): _plain(value) for key, value in data.items()}
    if isinstance(data, np.ndarray):
        return _plain(data.tolist())
    if isinstance(data, list | tuple):
        return [_plain(value) for value in data]
    if isinstance(data, np.generic):
        data = data.item()
    return None if isinstance(data, float) and not math.isfinite(data) else data
