"""A model with state beside the hardware, a step at a time: the first step that differs is named, with what led to it.

A step is a cycle, or a transaction; what a model holds between them is its state. A comparison of all results at the
end tells that something went wrong, and not when: the state before the first wrong step does.
"""

from collections.abc import Mapping
from typing import Any, Protocol

Values = Mapping[str, Any]


class Model(Protocol):
    """A model that is stepped."""

    def state(self) -> Values:
        """What it holds now, to be printed: a copy."""

    def step(self, operands: Values, seen: Values) -> Values:
        """What has to come out of operands, by the names of what the hardware gave (`seen`); the state goes on.

        `seen` is for what the model leaves open: a choice at random, or what only the hardware knows. There it follows
        the hardware, as far as that is allowed, and gives back what was seen.
        """


class Stepped:
    """A model that is held to the hardware, step by step. `what` it is a model of; `seed` is that of the run."""

    def __init__(self, model: Model, what: str, seed: int) -> None:
        self.model, self.what, self.seed = model, what, seed
        self.number = 0
        """Steps so far."""

    def step(self, operands: Values, seen: Values) -> None:
        """Fails where the hardware gave something else than the model."""
        before = self.model.state()
        wanted = self.model.step(operands, seen)
        wrong = [name for name in seen if seen[name] != wanted[name]]
        got, right = ({name: values[name] for name in wrong} for values in (seen, wanted))
        assert not wrong, (
            f"seed {self.seed}: {self.what}, step {self.number}, {shown(operands)}: {shown(got)}; "
            f"the model: {shown(right)}; its state before: {shown(before)}"
        )
        self.number += 1


def shown(values: Values) -> str:
    """Names with values, numbers from 10 up in hexadecimal digits."""
    return ", ".join(
        f"{name} {value:#x}" if isinstance(value, int) and value > 9 else f"{name} {value}"
        for name, value in values.items()
    )
