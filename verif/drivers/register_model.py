"""What software sees of registers, as a model: by the table of a manifest."""

from typing import Any

from lightloom.verif.drivers.stepped import Values

OKAY, SLVERR = 0, 2
WORD = 4
"""Bytes."""


class RegisterModel:
    """Registers as the manifest of a unit has them (`registers`), and what reads and writes of words do.

    `held` is what each field holds that software can change; `status` what read-only fields say, set by the bench.
    `strobes` are the fields that the last write has made high.
    """

    def __init__(self, registers: list[dict[str, Any]]) -> None:
        self.words = {
            register["offset"] + WORD * k: (register, k)
            for register in registers
            for k in range(register["width"] // 32)
        }
        fields = [field for register in registers for field in register["fields"]]
        self.status = {field["name"]: 0 for field in fields if field["access"] == "ro"}
        self.held = {field["name"]: field["reset"] for field in fields if field["access"] in ("rw", "w1c")}
        self.strobes: set[str] = set()
        self._kept = 0

    def happen(self, name: str) -> None:
        """An event."""
        self.held[name] = 1

    def write(self, address: int, data: int, strobes: int = 0xF) -> int:
        """A word with a strobe a byte; the response."""
        self.strobes = set()
        register, _ = self.words.get(address // WORD * WORD, (None, 0))
        fields = register["fields"] if register else []
        writable = [field for field in fields if field["access"] != "ro"]
        if not writable or any(self.status[field["held_by"]] for field in writable if "held_by" in field):
            return SLVERR
        mask = sum(0xFF << 8 * k for k in range(WORD) if strobes >> k & 1)
        for field in writable:
            name, ones = field["name"], (1 << field["width"]) - 1
            bits, written = data >> field["low"] & ones, mask >> field["low"] & ones
            if field["access"] == "rw":
                self.held[name] = (bits & written) | (self.held[name] & ~written)
            elif bits & written:
                if field["access"] == "w1p":
                    self.strobes.add(name)
                else:
                    self.held[name] = 0
        return OKAY

    def read(self, address: int) -> tuple[int, int]:
        """A word and the response."""
        register, half = self.words.get(address // WORD * WORD, (None, 0))
        if register is None:
            return 0, SLVERR
        if half:
            return self._kept, OKAY
        value = sum((self.held | self.status).get(field["name"], 0) << field["low"] for field in register["fields"])
        if register["width"] > 32:
            self._kept = value >> 32
        return value & 0xFFFF_FFFF, OKAY


EVENTS, ENABLES = "events", "event_enables"


class RegisterSteps:
    """The model as one that is stepped (`verif.drivers.stepped`): an access is a step.

    Operands of a write are `address`, `data` and `strobes`; seen is its `response`. Of a read it is `address`; seen are
    `response`, `word` (None: undefined) and the interrupt `irq` of its cycle. What only the hardware knows is not
    held to anything: what read-only fields say, whether operands wait, which events have happened.
    """

    def __init__(self, registers: list[dict[str, Any]]) -> None:
        self.model = RegisterModel(registers)
        fields = {register["name"]: register["fields"] for register in registers}
        self._enables = [field["name"] for field in fields[ENABLES]]
        self._events = next(register["offset"] for register in registers if register["name"] == EVENTS)

    def state(self) -> Values:
        return {name: value for name, value in self.model.held.items() if value}

    def step(self, operands: Values, seen: Values) -> Values:
        register, half = self.model.words.get(operands["address"] // WORD * WORD, (None, 0))
        fields = register["fields"] if register else []
        if "data" in operands:
            holds = {field["held_by"] for field in fields if "held_by" in field}
            self.model.status |= dict.fromkeys(holds, int(seen["response"] != OKAY))
            return {"response": self.model.write(operands["address"], operands["data"], operands["strobes"])}
        word, response = self.model.read(operands["address"])
        wanted = {"response": response, "word": word, "irq": seen["irq"]}
        unknown = [field for field in fields if field["access"] in ("ro", "w1c")]
        if seen["word"] is None:  # where nothing waits, nothing is defined
            return wanted | ({"word": None} if register and register["name"].startswith("result_") else {})
        mask = sum(((1 << field["width"]) - 1) << field["low"] for field in unknown) >> 32 * half
        wanted["word"] = (word & ~mask) | (seen["word"] & mask & 0xFFFF_FFFF)
        if register and register["offset"] == self._events:
            enabled = sum(self.model.held[name] << k for k, name in enumerate(self._enables))
            wanted["irq"] = int((seen["word"] & enabled) != 0)
        return wanted
