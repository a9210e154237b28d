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

USUAL = (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)
"""Chromaticities that a file without them has, of Rec. 709; others are taken for these."""
CLOSE = 1e-3
"""Programs write them rounded to three or four digits: what differs by less is the same."""


def read_exr(path: Path) -> np.ndarray:
    """The picture of a file: (H, W, C) float16 or float32, C channels R, G, B and A if it is there, or Y alone.

    Other channels are said to be left out. Raises InputError for a damaged file and for one without these channels.
    """
    import OpenEXR  # large: not needed by those who read no EXR

    try:
        with quiet_libraries(), OpenEXR.File(str(path), separate_channels=True) as file:
            head, parts = dict(file.header()), len(file.parts)
            channels = {name: channel.pixels for name, channel in file.channels().items()}
    except (RuntimeError, OSError, ValueError) as error:
        raise InputError(f"{path}: not a readable EXR file; write it again") from error
    coloured = {"R", "G", "B"} <= set(channels)
    names = [name for name in (("R", "G", "B", "A") if coloured else ("Y",)) if name in channels]
    if not names:
        raise InputError(f"{path}: has channels {', '.join(channels)}; a picture needs R, G, B (or Y)")
    data, display = (np.array(head[name]) for name in ("dataWindow", "displayWindow"))
    if (data != display).any():
        raise InputError(f"{path}: holds another part than the picture (`dataWindow`); write it whole")
    remarks = Remarks(path)
    if parts > 1:
        remarks.leave_out(f"{parts - 1} of {parts} parts")
    if head.get("pixelAspectRatio", 1) != 1:
        remarks.leave_out("`pixelAspectRatio`")
    if not np.allclose(head.get("chromaticities", USUAL), USUAL, rtol=0, atol=CLOSE):
        remarks.leave_out("`chromaticities`")
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
