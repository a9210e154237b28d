"""Windows of 3 x 3 texels against loops over the maps."""

import numpy as np

from lightloom.golden_model.engine.selection.neighbourhoods import Windows
from tests.golden_model.engine.publishing.test_publisher import maps_of


def test_windows_stay_in_their_map_and_chart() -> None:
    maps = maps_of([(7, 5), (1, 4), (3, 1)])
    maps.chart[3:7] = 9  # part of the first row is a chart of its own
    maps.texels["state"][[16, 36]] = 0, 2
    valid = maps.texels["state"] == 1
    rng = np.random.default_rng(1)
    values = rng.integers(0, 4, len(valid)).astype(np.uint8) * valid
    largest, total = values.copy(), values.copy()
    for axis in (0, 1):  # along rows, then along columns: a corner counts when one of the two ways to it is free
        before_largest, before_total = largest.copy(), total.copy()
        for texel in np.flatnonzero(valid):
            owner = maps.texels["object"][texel]
            row, column = divmod(texel - maps.offset[owner], maps.width[owner])
            for step in (-1, 1):
                j, i = (row, column + step) if axis == 0 else (row + step, column)
                if 0 <= j < maps.height[owner] and 0 <= i < maps.width[owner]:
                    other = maps.offset[owner] + j * maps.width[owner] + i
                    if valid[other] and maps.chart[other] == maps.chart[texel]:
                        largest[texel] = max(largest[texel], before_largest[other])
                        total[texel] += before_total[other]
    windows = Windows(maps)
    assert (windows.largest(values) == largest).all()
    assert (windows.total(values) == total).all()


def test_repeated_windows_reach_further() -> None:
    maps = maps_of([(9, 9)])
    spot = np.zeros(81, dtype=np.uint8)
    spot[40] = 3
    windows = Windows(maps)
    for times in range(4):
        found = windows.largest(spot, times).reshape(9, 9)
        assert (found > 0).sum() == (2 * times + 1) ** 2
        assert (found[4 - times : 5 + times, 4 - times : 5 + times] == 3).all()
