"""Outputs appear whole or not at all: files and folders are written beside their place and renamed into it."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from lightloom.golden_model.host.errors import InputError


@contextmanager
def _parents(path: Path) -> Iterator[None]:
    """Makes the folders that `path` lies in; on failure those that it made go again, if they are empty."""
    missing = [folder for folder in path.parents if not folder.exists()]
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        yield
    except BaseException:
        with suppress(OSError):
            for folder in missing:
                folder.rmdir()
        raise


@contextmanager
def whole_file(path: Path | str) -> Iterator[Path]:
    """Yields a temporary path beside `path`; renames it into place on success, removes it on any failure.

    Raises InputError where the place cannot be written (no permission, a full disk).
    """
    path = Path(path)
    scratch = path.with_name(f".{path.name}.{os.getpid()}.part{path.suffix}")
    try:
        with _parents(path):
            try:
                yield scratch
                scratch.replace(path)
            finally:
                scratch.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error}); choose another --out") from error


@contextmanager
def whole_folder(path: Path | str) -> Iterator[Path]:
    """Yields an empty temporary folder beside `path`; on success it replaces what was at `path`, on failure it goes.

    Only a folder that this function made before (it holds the marker file) or an empty one is ever replaced.
    """
    path = Path(path)
    marker = ".lightloom"
    if path.exists() and not path.is_dir():
        raise InputError(f"{path}: is a file; choose a folder for --out")
    if path.is_dir() and any(path.iterdir()) and not (path / marker).exists():
        raise InputError(f"{path}: the folder holds files that Lightloom did not write; choose another --out")
    scratch = path
    try:
        with _parents(path):
            scratch = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
            try:
                scratch.chmod(0o755)
                (scratch / marker).touch()
                yield scratch
                if path.exists():
                    shutil.rmtree(path)
                scratch.replace(path)
            finally:
                shutil.rmtree(scratch, ignore_errors=True)
    except InputError as error:  # of a file in the folder: the user knows it by its place, not by the scratch's name
        raise InputError(str(error).replace(str(scratch), str(path))) from error
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error}); choose another --out") from error
