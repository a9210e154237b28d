"""Lines of Wavefront's text files, OBJ and MTL, as programs really write them."""

import re
from collections.abc import Iterator
from pathlib import Path

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.scene.files.plain_text import without_mark

LONGEST_WORD = 20
"""Characters that are shown of a word; in a file of another kind it may be of any length."""
NAMED = re.compile(r"\s*(?:newmtl|usemtl|mtllib|o|g)\s", re.IGNORECASE)
"""How lines begin that end in a name, which may hold ` #`: programs number materials so."""


def lines(path: Path) -> Iterator[tuple[int, str, str]]:
    """(line number, first word, the rest) of every line that holds something.

    A backslash at its end joins a line to the next. `#` begins a comment where a word could begin, but in a name.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    # Names in another encoding keep their differences: a byte that is no text becomes its code.
    text = without_mark(data).decode("utf-8", errors="backslashreplace").rstrip("\0\x1a")  # old ends of files
    pending = ""
    every = re.split(r"\r\n|\r|\n", text)
    for number, line in enumerate(every, start=1):
        line = pending + _without_comment(line, within_name=bool(NAMED.match(pending or line))).rstrip()
        if line.endswith("\\") and number < len(every):
            pending = line[:-1] + " "
            continue
        pending = ""
        words = line.rstrip("\\").split(maxsplit=1)
        if words:
            yield number, words[0], words[1].strip() if len(words) > 1 else ""


def _without_comment(line: str, within_name: bool) -> str:
    return line if within_name else re.split(r"(?:^|\s)#", line, maxsplit=1)[0]
