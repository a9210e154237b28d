"""xatlas in a process of its own: on some meshes it crashes or never ends, and then only that process dies.

(One such mesh is a closed sphere of many triangles, of which it makes a single chart without a border.)
This file is both ends: `Unwrapper` runs it as a program, which reads meshes from stdin and writes charts to stdout.
"""

import io
import os
import signal
import struct
import subprocess
import sys
import threading
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import numpy as np

SECONDS, SECONDS_A_TRIANGLE = 120.0, 0.01
"""Time that a mesh may take, many times what it needs: a busy machine has to make the same charts as an idle one."""


CRASHES = frozenset(-number for number in (signal.SIGSEGV, signal.SIGABRT, signal.SIGBUS, signal.SIGFPE, signal.SIGILL))
"""Exit codes of a child that died of what it did itself; any other death came from outside."""

DIES_WITH_PARENT = 1
"""PR_SET_PDEATHSIG of Linux' prctl."""


class KilledError(Exception):
    """The child was ended from outside: that says nothing about the mesh, which may have charts at another time."""


class Unwrapper:
    """Unwraps meshes in a child process: started with the first one, and anew after a crash. Use it in a `with`."""

    def __init__(self, program: Path = Path(__file__)) -> None:
        self._program = program
        self._child: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> "Unwrapper":
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._end()

    def charts(self, points: np.ndarray, faces: np.ndarray, padding: int) -> dict[str, np.ndarray] | None:
        """What `unwrap` makes of the mesh; None where it crashes, takes too long or finds no chart that can be used.

        A mesh whose child is killed from outside is tried once more; raises KilledError where that happens again.
        """
        try:
            made = self._ask(points, faces, padding)
        except KilledError:
            made = self._ask(points, faces, padding)
        return made if made is not None and _usable(made, len(faces)) else None

    def _ask(self, points: np.ndarray, faces: np.ndarray, padding: int) -> dict[str, np.ndarray] | None:
        """The child's answer; None where it crashes or takes too long, KilledError where it ends in another way."""
        child = self._child or self._start()
        late = threading.Event()

        def stop() -> None:
            late.set()
            child.kill()

        limit = threading.Timer(SECONDS + SECONDS_A_TRIANGLE * len(faces), stop)
        limit.start()
        try:
            try:
                _send(child.stdin, points=points, faces=faces, padding=np.array(padding))
                made = _receive(child.stdout)
            except OSError:  # it died while it was written to
                made = None
            crashed = made is None and child.wait() in CRASHES
        except BaseException:  # Ctrl-C: the child may be in the middle of an answer
            self._end()
            raise
        finally:
            limit.cancel()
        if made is None:
            self._end()
            if not (crashed or late.is_set()):
                raise KilledError
        return made

    def _start(self) -> "subprocess.Popen[bytes]":
        # -P: the folder of this file must not come before the standard library, whose names some of its files have.
        # A session of its own: Ctrl-C reaches this process only, which then ends the child.
        self._child = child = subprocess.Popen(
            [sys.executable, "-P", str(self._program), str(os.getpid())],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        if _receive(child.stdout) is None:
            code = child.wait()
            self._end()
            if code < 0 and code not in CRASHES:
                raise KilledError
            raise RuntimeError(
                f"the process for lightmap charts does not start; try: {sys.executable} -c 'import xatlas'"
            )
        return child

    def _end(self) -> None:
        if self._child is not None:
            self._child.kill()
            self._child.communicate()
            self._child = None


def _usable(made: dict[str, np.ndarray], faces: int) -> bool:
    """Whether there are charts at all, at places that are numbers."""
    if not ("chart" in made and made["chart"].shape == (faces,)):
        return False
    return bool((made["chart"] >= 0).any() and np.isfinite(made["uv"]).all() and made["size"].min() > 0)


def unwrap(points: np.ndarray, faces: np.ndarray, padding: int) -> dict[str, np.ndarray]:
    """Charts of a mesh measured in texels: points (P, 3) float32, faces (F, 3) uint32, texels between two charts.

    `size` is the map's width and height, `uv` (F, 3, 2) float32 are the corners in texels, `chart` (F,) int32 is the
    chart of each triangle, -1 for those that xatlas leaves out.
    """
    import xatlas

    atlas = xatlas.Atlas()
    _kept.append(atlas)
    atlas.add_mesh(points, faces)
    packing = xatlas.PackOptions()
    packing.texels_per_unit = 1.0
    packing.padding = padding
    packing.bilinear = True
    atlas.generate(xatlas.ChartOptions(), packing)
    _, new_faces, uv = atlas.get_mesh(0)
    size = np.array([atlas.width, atlas.height])
    chart = np.full(len(faces), -1, dtype=np.int32)
    for k in range(atlas.get_mesh_chart_count(0)):
        chart[atlas.get_mesh_chart(0, k).faces] = k
    return {"size": size, "uv": np.asarray(uv)[new_faces] * size.astype(np.float32), "chart": chart}


_kept: list[Any] = []
"""Never destroyed: the destructor wakes the worker threads without holding their lock, so that on a busy machine one
can miss it, and the destructor then waits for that thread for ever."""


def serve(stdin: BinaryIO, stdout: BinaryIO) -> None:
    """Answers meshes with charts until stdin ends; one that xatlas refuses with an answer of nothing."""
    import xatlas  # noqa: F401 (tells at once whether it can be loaded)

    _send(stdout)
    while (mesh := _receive(stdin)) is not None:
        try:
            made = unwrap(mesh["points"], mesh["faces"], int(mesh["padding"]))
        except Exception:
            made = {}
        _send(stdout, **made)


def _send(stream: Any, **arrays: np.ndarray) -> None:
    """One message: its length and an .npz archive."""
    data = io.BytesIO()
    np.savez(data, **arrays)  # type: ignore[arg-type]
    stream.write(struct.pack("<Q", data.tell()) + data.getbuffer())
    stream.flush()


def _receive(stream: Any) -> dict[str, np.ndarray] | None:
    """The next message; None where the stream ends."""
    head = stream.read(8)
    if len(head) < 8:
        return None
    length = struct.unpack("<Q", head)[0]
    data = stream.read(length)
    if len(data) < length:
        return None
    with np.load(io.BytesIO(data)) as arrays:
        return dict(arrays)


def _die_with_parent(parent: int) -> None:
    """A parent that is killed ends no child, and one that is busy would not notice for as long as its mesh takes.

    Linux only: elsewhere the child goes on to the end of its mesh, and then finds that nobody listens.
    """
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(DIES_WITH_PARENT, signal.SIGKILL, 0, 0, 0)
        if os.getppid() != parent:  # it died before it could be asked for
            os._exit(1)


def main() -> None:
    """The child process. What xatlas may print goes nowhere; at the end nothing is destroyed."""
    _die_with_parent(int(sys.argv[1]))
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    serve(sys.stdin.buffer, answers)
    os._exit(0)


if __name__ == "__main__":
    main()
