"""Records moved as a whole are the same records."""

import numpy as np

from lightloom.golden_model.contract.formats import HIT
from lightloom.golden_model.numerics.structured import join, put, take


def records(count: int) -> np.ndarray:
    out = np.zeros(count, dtype=HIT)
    out["primitive"], out["t"], out["front"] = np.arange(count), np.linspace(0, 1, count), np.arange(count) % 3 == 0
    return out


def test_take_put_and_join_are_numpys_own() -> None:
    all_of_them = records(40)
    index = np.random.default_rng(0).integers(0, 40, 100)
    assert take(all_of_them, index).tobytes() == all_of_them[index].tobytes()
    mask = all_of_them["front"]
    assert take(all_of_them, mask).tobytes() == all_of_them[mask].tobytes()
    whole, plain = records(40), records(40)
    put(whole, index[:50], records(50))
    plain[index[:50]] = records(50)
    assert whole.tobytes() == plain.tobytes()
    assert join([all_of_them[::2], all_of_them[:0], all_of_them]).tobytes() == (
        np.concatenate([all_of_them[::2], all_of_them]).tobytes()
    )
