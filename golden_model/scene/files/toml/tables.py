"""Tables of a scene description, read with one-line refusals that name the file, the table and the key."""

import difflib
import math
from collections.abc import Collection
from typing import Any

import numpy as np

from lightloom.golden_model.host.errors import InputError

MOST = float(np.finfo(np.float32).max)
"""Of a number's size: scenes are kept in float32."""


class Table:
    """One TOML table with the words that begin messages about it; every reader raises InputError."""

    def __init__(self, where: str, values: Any, known: Collection[str]) -> None:
        if not isinstance(values, dict):
            raise InputError(f"{where}: must be a table")
        self.where = where
        self.values: dict[str, Any] = values
        for key in values:
            if key not in known:
                close = difflib.get_close_matches(key, known, n=1)
                hint = f"did you mean `{close[0]}`?" if close else f"known are {', '.join(known)}"
                raise InputError(f"{where}: unknown key `{key}`; {hint}")

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def need(self, key: str) -> Any:
        """The value of a key that must be there."""
        if key not in self.values:
            raise InputError(f"{self.where}: `{key}` is missing")
        return self.values[key]

    def numbers(self, key: str, count: int, default: tuple[float, ...] | None = None) -> list[float]:
        """`count` finite numbers."""
        value = self.need(key) if default is None else self.values.get(key, list(default))
        if not (isinstance(value, list) and len(value) == count and all(_is_number(x) for x in value)):
            raise InputError(f"{self.where}: `{key}` must be {count} numbers, not {value!r}")
        return [self._held(key, x) for x in value]

    def number(self, key: str, default: float | None = None) -> float:
        """A finite number."""
        value = self.need(key) if default is None else self.values.get(key, default)
        if not _is_number(value):
            raise InputError(f"{self.where}: `{key}` must be a number, not {value!r}")
        return self._held(key, value)

    def _held(self, key: str, value: float) -> float:
        """A number that float32 can hold; whole numbers of TOML may have any number of digits."""
        if abs(value) > MOST:
            raise InputError(f"{self.where}: `{key}` must lie within +-{MOST:.1e}")
        return float(value)

    def whole(self, key: str, low: int, high: int | None = None, default: int | None = None) -> int:
        """A whole number from `low`, to `high` if that is given."""
        value = self.need(key) if default is None else self.values.get(key, default)
        if not isinstance(value, int) or isinstance(value, bool) or value < low or (high is not None and value > high):
            end = "" if high is None else f" to {high}"
            raise InputError(f"{self.where}: `{key}` must be a whole number from {low}{end}, not {value!r}")
        return value

    def flag(self, key: str, default: bool) -> bool:
        """true or false."""
        value = self.values.get(key, default)
        if not isinstance(value, bool):
            raise InputError(f"{self.where}: `{key}` must be true or false, not {value!r}")
        return value

    def choice(self, key: str, known: Collection[str], default: str) -> str:
        """One of some words."""
        value = self.text(key, default)
        if value not in known:
            raise InputError(f"{self.where}: `{key}` must be one of {', '.join(known)}, not {value!r}")
        return value

    def positive(self, key: str, default: float | None = None) -> float:
        """A number greater than 0."""
        value = self.number(key, default)
        if value <= 0:
            raise InputError(f"{self.where}: `{key}` must be greater than 0, not {value:g}")
        return value

    def not_negative(self, key: str) -> list[float]:
        """Three numbers, 0 or more."""
        values = self.numbers(key, 3)
        if min(values) < 0:
            raise InputError(f"{self.where}: `{key}` must not be negative, not {values}")
        return values

    def quaternion(self, key: str) -> list[float]:
        """A rotation [w, x, y, z] of any length but zero; [1, 0, 0, 0] if the key is not there."""
        values = self.numbers(key, 4, (1, 0, 0, 0))
        if not sum(value * value for value in values) > 0:  # of numbers that are too small too
            raise InputError(f"{self.where}: `{key}` must not be all zero; it is a quaternion [w, x, y, z]")
        return values

    def text(self, key: str, default: str | None = None) -> str:
        """A string."""
        value = self.need(key) if default is None else self.values.get(key, default)
        if not isinstance(value, str):
            raise InputError(f"{self.where}: `{key}` must be text in quotes, not {value!r}")
        return value

    def tables(self, key: str, known: Collection[str]) -> list["Table"]:
        """An array of tables, none if the key is not there."""
        value = self.values.get(key, [])
        if not isinstance(value, list):
            raise InputError(f"{self.where}: write [[{key}]], with double brackets")
        return [Table(f"{self.where}, [[{key}]] {n}", item, known) for n, item in enumerate(value, start=1)]


def _is_number(value: Any) -> bool:
    return (isinstance(value, int) and not isinstance(value, bool)) or (
        isinstance(value, float) and math.isfinite(value)
    )
