"""Outputs appear whole or not at all."""

import errno
from pathlib import Path

import pytest

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.outputs import whole_file, whole_folder


def test_file_appears_only_when_complete(tmp_path: Path) -> None:
    target = tmp_path / "new" / "a.txt"
    with whole_file(target) as scratch:
        scratch.write_text("whole")
        assert not target.exists()
    assert target.read_text() == "whole"
    assert list(target.parent.iterdir()) == [target]


def test_failure_leaves_the_old_file_and_no_scratch(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    target.write_text("old")
    with pytest.raises(RuntimeError, match="stop"), whole_file(target) as scratch:
        scratch.write_text("half")
        raise RuntimeError("stop")
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_full_disk_is_one_clear_line(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    with pytest.raises(InputError, match=r"a\.txt: cannot be written \(No space left") as caught, whole_file(target):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_folder_replaces_its_own_predecessor_whole(tmp_path: Path) -> None:
    target = tmp_path / "out"
    for content in ("first", "second"):
        with whole_folder(target) as scratch:
            (scratch / f"{content}.txt").write_text(content)
    assert {path.name for path in target.iterdir()} == {".lightloom", "second.txt"}
    assert list(tmp_path.iterdir()) == [target]


def test_failure_leaves_the_old_folder(tmp_path: Path) -> None:
    target = tmp_path / "out"
    with whole_folder(target) as scratch:
        (scratch / "old.txt").touch()
    with pytest.raises(KeyboardInterrupt), whole_folder(target) as scratch:
        (scratch / "new.txt").touch()
        raise KeyboardInterrupt
    assert {path.name for path in target.iterdir()} == {".lightloom", "old.txt"}
    assert list(tmp_path.iterdir()) == [target]


def test_foreign_folder_is_refused_untouched(tmp_path: Path) -> None:
    target = tmp_path / "mine"
    target.mkdir()
    (target / "thesis.tex").touch()
    with pytest.raises(InputError, match="did not write"), whole_folder(target):
        pass
    assert [path.name for path in target.iterdir()] == ["thesis.tex"]


def test_place_that_cannot_be_a_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="is a file"), whole_folder(tmp_path / "file"):
        pass
    with pytest.raises(InputError, match="cannot be written"), whole_folder(tmp_path / "file" / "below"):
        pass
