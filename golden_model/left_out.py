"""What of a mesh file is not read: gathered while it is read, and said in one line."""

from pathlib import Path

from golden_model.errors import warn


class LeftOut:
    """Things in a file that are left out, each by the name that the file's format has for it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._names: dict[str, None] = {}

    def add(self, name: str) -> None:
        """The same name counts once."""
        self._names[name] = None

    def say(self) -> None:
        """Warns, if there is anything."""
        if self._names:
            warn(f"{self.path}: left out: {', '.join(self._names)}")
