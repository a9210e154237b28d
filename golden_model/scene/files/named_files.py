"""Files that are named in other files."""

from pathlib import Path


def lack(file: Path) -> str:
    """Why there is no file of a name: "missing" or "a folder"; "" where there is one."""
    try:
        return "" if file.is_file() else "a folder" if file.is_dir() else "missing"
    except (OSError, ValueError):  # a name that no file can have
        return "missing"
