"""The first lines of an emitted file: what it is, what it was made from, its licence, and a hash of the rest."""

import hashlib
import re
import textwrap
from importlib.metadata import version

from lightloom.golden_model.host.errors import InputError
from lightloom.rtl.config import Config

LONGEST_PREFIX = 64
"""Of a prefix; tools and file systems limit names."""
LICENCE = "Apache-2.0"
"""Of what is emitted, as of the project, by its SPDX identifier."""
MARK = "// SHA-256 of all that follows this line: "


def header(title: str, config: Config, preset: str | None, verilog: str) -> str:
    """Comment lines for a file: `title`, what it is; `preset`, the configuration's name, None where it has none."""
    parameters = ", ".join(f"{name} {value}" for name, value in config.flat().items())
    lines = [
        title,
        f"Made by Lightloom {version('lightloom')}" + (f", preset {preset}." if preset else "."),
        f"Parameters: {parameters}.",
        f"SPDX-License-Identifier: {LICENCE}",
    ]
    wrapped = [part for line in lines for part in textwrap.wrap(line, 112, subsequent_indent="  ")]
    digest = hashlib.sha256(verilog.encode()).hexdigest()
    return "".join(f"// {line}\n" for line in wrapped) + f"{MARK}{digest}\n"


def checked_prefix(prefix: str) -> str:
    """What the names of all modules are to begin with, if a name can. Raises InputError where it cannot."""
    if len(prefix) <= LONGEST_PREFIX and re.fullmatch(r"([A-Za-z_]\w*)?", prefix, re.ASCII):
        return prefix
    raise InputError(
        f"--prefix {prefix!r}: must be letters, digits and underscores, {LONGEST_PREFIX} at most, and not begin with a "
        "digit"
    )
