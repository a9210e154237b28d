"""Parameters: name, default, what it may be and what it is, declared once, as a field of a dataclass.

    bounces: int = number(4, 0, 16, "Mirrors and panes of glass that a ray may meet.")

`check` holds an object to what its class declares, `parameters` lists it for pages and reports.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from lightloom.golden_model.host.errors import InputError


def number(default: Any, low: float, high: float | None, says: str) -> Any:
    """A field for a number from `low` to `high`, None: without an end, or for a tuple of them; whole if `low` is."""
    return field(default=default, metadata={"says": says, "range": (low, high)})


def whole(default: int, values: Sequence[int], says: str) -> Any:
    """A field for a whole number, or a truth value, that is one of `values`, in rising order: a range, or a few."""
    return field(default=default, metadata={"says": says, "values": values})


def choice(default: str, choices: Sequence[str], says: str) -> Any:
    """A field for one of several words."""
    return field(default=default, metadata={"says": says, "choices": tuple(choices)})


def flag(default: bool, says: str) -> Any:
    """A field for yes or no."""
    return field(default=default, metadata={"says": says})


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A field of a dataclass that was made by `number`, `whole`, `choice` or `flag`."""

    name: str
    default: Any
    says: str
    range: tuple[float, float | None] | None = None
    """Lowest and highest value of a number."""
    choices: tuple[str, ...] | None = None
    """The words that it may be."""
    values: Sequence[int] = ()
    """What was made by `whole` may be, in rising order."""

    @property
    def allowed(self) -> str:
        """What it may be, in words: "0 to 16", "1 or more", "off, volumes, footprints", "4 or 8", "yes, no"."""
        if self.values:
            return described(self.values)
        if self.range is None:
            return ", ".join(self.choices or ("yes", "no"))
        low, high = self.range
        return f"{low} or more" if high is None else f"{low} to {high}"

    def check(self, value: Any, called: str) -> None:
        """Raises InputError where it may not be `value`; `called` is what the user knows it by."""
        if self.values:
            if type(value) is not type(self.default) or value not in self.values:
                raise InputError(f"{called} {value!r}: must be {self.allowed}")
        elif self.range is not None:
            several = isinstance(self.default, tuple)
            if several and not (isinstance(value, tuple) and value):
                raise InputError(f"{called} {value!r}: must be several numbers, each {self.allowed}")
            for one in value if several else (value,):
                self._check_number(one, f"{called} {value}")
        elif self.choices is not None:
            if value not in self.choices:
                raise InputError(f"{called} {value}: must be one of {self.allowed}")
        elif not isinstance(value, bool | np.bool_):
            raise InputError(f"{called} {value}: must be True or False")

    def parsed(self, text: str) -> int:
        """Which of `values` the text means, such as "64" or "True". Raises InputError where there is none."""
        for value in self.values:
            if str(value).lower() == text.lower():
                return value
        raise InputError(f"{self.name} {text}: must be {self.allowed}")

    def _check_number(self, value: Any, what: str) -> None:
        assert self.range is not None
        low, high = self.range
        number = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
        if not number or not low <= value or not (high is None or value <= high):
            raise InputError(f"{what}: must be {self.allowed}")
        if isinstance(low, int) and not isinstance(value, int | np.integer):
            raise InputError(f"{what}: must be whole, {self.allowed}")


def powers_of_two(least: int, greatest: int) -> tuple[int, ...]:
    """All of them from `least` to `greatest`, which are two of them."""
    return tuple(1 << place for place in range(least.bit_length() - 1, greatest.bit_length()))


def described(values: Sequence[int]) -> str:
    """What a whole number may be, in words: "4 to 64", "a power of two, 2 to 256", "4 or 8"."""
    least, greatest = values[0], values[-1]
    if isinstance(values, range):
        return f"{least} to {greatest}"
    if least and len(values) > 2 and tuple(values) == powers_of_two(least, greatest):
        return f"a power of two, {least} to {greatest}"
    return ", ".join(map(str, values[:-1])) + f" or {greatest}"


def parameters(kind: type) -> dict[str, Parameter]:
    """The parameters of a dataclass, by name, in its order; fields without a declaration are not among them."""
    return {
        item.name: Parameter(name=item.name, default=item.default, **item.metadata)
        for item in fields(kind)
        if item.metadata
    }


def check(options: Any, owner: str = "") -> None:
    """Raises InputError, one line, for the first field of `options` that its declaration does not allow.

    `owner` says there of what it is a parameter: "policy sweep 300: must be 0 to 256".
    """
    for each in parameters(type(options)).values():
        each.check(getattr(options, each.name), f"{owner} {each.name}".lstrip())
