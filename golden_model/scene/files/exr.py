"""EXR files: linear light."""

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path

import numpy as np

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.scene.files.remarks import Remarks


def read_exr(path: Path) -> np.ndarray:
    """The picture of a file: (H, W, C) float16 or float32, C channels R, G, B and A if it is there, or Y alone.

    Other channels are said to be left out. Raises InputError for a damaged file and for one without these channels.
    """
    import OpenEXR  # large: not needed by those who read no EXR

    try:
        with quiet_libraries(), OpenEXR.File(str(path), separate_channels=True) as file:
            channels = {name: channel.pixels for name, channel in file.channels().items()}
    except (RuntimeError, OSError, ValueError) as error:
        raise InputError(f"{path}: not a readable EXR file; write it again") from error
    names = [name for name in ("R", "G", "B", "A", "Y") if name in channels]
    if not {"R", "G", "B"} <= set(names) and names != ["Y"]:
        raise InputError(f"{path}: has channels {', '.join(channels)}; a picture needs R, G, B (or Y)")
    remarks = Remarks(path)
    for name in sorted(set(channels) - set(names)):
        remarks.leave_out(f"channel `{name}`")
    remarks.say()
    return np.stack([channels[name] for name in names], axis=-1)


@contextmanager
def quiet_libraries() -> Iterator[None]:
    """Drops what libraries print: of a damaged EXR file many lines, before the exception that says so."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = [(stream, os.dup(stream)) for stream in (1, 2)]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for stream, _ in kept:
            os.dup2(nowhere, stream)
        with redirect_stdout(io.StringIO()):
            yield
    finally:
        for stream, original in kept:
            os.dup2(original, stream)
            os.close(original)
        os.close(nowhere)
