"""What holds for all tests: the order in which they run."""

import pytest

LONGEST = "tests/verif/"
"""The folder whose tests take longest, one by one."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest tests go first: at the end of a run one of them would leave the other workers without work."""
    items.sort(key=lambda item: not item.nodeid.startswith(LONGEST))
