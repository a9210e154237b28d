"""What holds for all tests: the order in which they run, and how often garbage is looked for."""

import gc

import pytest

LONGEST = "tests/verif/"
"""The folder whose tests take longest, one by one."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest tests go first: at the end of a run one of them would leave the other workers without work."""
    items.sort(key=lambda item: not item.nodeid.startswith(LONGEST))


def pytest_configure() -> None:
    """Amaranth makes millions of small objects, nearly all of which live as long as the unit does: to look for garbage
    among them as often as Python does by itself takes a fifth of the time of an emission."""
    gc.set_threshold(200_000, 50, 50)
