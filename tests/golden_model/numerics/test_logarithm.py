"""Logarithms in half octaves."""

import numpy as np

from lightloom.golden_model.numerics.logarithm import half_octaves


def test_half_octaves_of_every_short_number() -> None:
    numbers = np.arange(1, 5000)
    found = half_octaves(numbers).tolist()
    for n, half in zip(numbers.tolist(), found, strict=True):
        top = n.bit_length() - 1
        assert half == 2 * top + (128 * n >= 181 << top)
        if half != (n * n).bit_length() - 1:
            assert 1.4140625 <= n / 2**top < 2**0.5, "one off between the square root of two and its eight bits"


def test_large_numbers_and_none() -> None:
    assert half_octaves(np.array([-3, 0, 1, 1 << 40, (1 << 40) * 3 // 2])).tolist() == [0, 0, 0, 80, 81]
