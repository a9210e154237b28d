"""Text of mesh files: byte order marks, and words that are numbers."""

import codecs
import math
import re
from collections.abc import Callable
from typing import TypeVar

Number = TypeVar("Number", int, float)

MARKS = {codecs.BOM_UTF8: "utf-8", codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}
"""Encodings by the byte order marks that some editors begin a file with."""


def without_mark(data: bytes) -> bytes:
    """A file's bytes behind its mark, in UTF-8 whatever the mark says; without one as they are."""
    for mark, encoding in MARKS.items():
        if data.startswith(mark):
            rest = data[len(mark) :]
            return rest if encoding == "utf-8" else rest.decode(encoding, errors="backslashreplace").encode()
    return data


NO_NUMBER = re.compile(r"[+-]?(?:nan(?:\(\w*\))?|1\.#(?:ind|[qs]nan)\d*)", re.IGNORECASE)
"""NaN, as the run-time libraries of C print it."""
INFINITE = re.compile(r"([+-]?)1\.#inf\d*", re.IGNORECASE)


def real(word: str) -> float:
    """A number. Raises ValueError for other words, among them 1_0 and foreign digits, which Python would read."""
    if NO_NUMBER.fullmatch(word):
        return math.nan
    if infinite := INFINITE.fullmatch(word):
        return float(f"{infinite[1]}inf")
    return _number(float, word)


def whole(word: str) -> int:
    """A whole number. Raises ValueError as `real` does."""
    return _number(int, word)


def differs(words: list[str], neutral: float) -> bool:
    """Whether any of the words is a number other than `neutral`; words that are no numbers say nothing."""
    for word in words:
        try:
            if real(word) != neutral:
                return True
        except ValueError:
            continue
    return False


def _number(kind: Callable[[str], Number], word: str) -> Number:
    if "_" not in word and word.isascii():
        try:
            return kind(word)
        except ValueError:
            pass
    raise ValueError(f"{word[:20]!r} is not a number")
