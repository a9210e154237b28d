"""Formats and their packing into the bits of a payload."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lightloom.golden_model.contract import bitpack, formats
from lightloom.golden_model.contract.formats import BOOL, F2, F4, I4, I8, bits, field_width, signed_bits
from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.fabric.layouts import layout_of, packet_of

FORMATS = sorted({unit.input for unit in PURE.values()} | {unit.output for unit in PURE.values()}, key=str)
EXAMPLE = np.dtype([("flag", BOOL), ("x", F4, (2,)), ("small", bits(5)), ("half", F2), ("wide", bits(32))])


def every_bit_random(dtype: np.dtype, count: int, seed: int) -> np.ndarray:
    """Words (N, words) whose bits above the payload are zero."""
    words = np.random.default_rng(seed).integers(0, 1 << 32, (count, bitpack.words(dtype)), dtype=np.uint32)
    if rest := bitpack.width(dtype) % 32:
        words[:, -1] &= np.uint32((1 << rest) - 1)
    return words


def test_widths() -> None:
    assert [field_width(t) for t in (F4, F2, I4, BOOL, bits(1), bits(8), bits(9), bits(32))] == [
        32,
        16,
        32,
        1,
        1,
        8,
        9,
        32,
    ]
    assert [field_width(t) for t in (I8, bits(33), bits(64), signed_bits(45))] == [64, 33, 64, 45]
    assert [bits(n).itemsize for n in (1, 8, 9, 16, 17, 32, 33, 64)] == [1, 1, 2, 2, 4, 4, 8, 8]
    assert bitpack.width(formats.RAY) == 8 * 32
    assert bitpack.width(formats.RAY_TRIANGLE) == 17 * 32 + 2 + 1 + 1
    assert bitpack.words(formats.RAY_TRIANGLE) == 18
    assert bitpack.width(formats.TRIANGLE_HIT) == 98


@pytest.mark.parametrize("width", [0, -1, 65])
def test_widths_out_of_range_are_refused(width: int) -> None:
    with pytest.raises(ValueError, match=str(width)):
        bits(width)


def test_fields_follow_each_other_from_the_lowest_bit() -> None:
    layout = [(name, index, offset, width) for name, index, _, offset, width in bitpack.fields(EXAMPLE)]
    assert layout == [
        ("flag", (), 0, 1),
        ("x", (0,), 1, 32),
        ("x", (1,), 33, 32),
        ("small", (), 65, 5),
        ("half", (), 70, 16),
        ("wide", (), 86, 32),
    ]
    record = np.zeros(1, dtype=EXAMPLE)
    record["x"][0, 1], record["small"], record["half"], record["wide"] = -0.0, 0b10101, 1.0, 0x80000001
    whole = 1 << 64 | 0b10101 << 65 | 0x3C00 << 70 | 0x80000001 << 86
    assert [int(word) for word in bitpack.pack(record)[0]] == [whole >> 32 * k & 0xFFFFFFFF for k in range(4)]


@pytest.mark.parametrize("dtype", [*FORMATS, EXAMPLE], ids=lambda dtype: "+".join(dtype.names))
def test_packing_is_lossless_in_both_directions(dtype: np.dtype) -> None:
    words = every_bit_random(dtype, 500, seed=3)
    records = bitpack.unpack(words, dtype)
    assert records.dtype == dtype
    assert (bitpack.pack(records) == words).all()


@pytest.mark.parametrize("dtype", [*FORMATS, EXAMPLE], ids=lambda dtype: "+".join(dtype.names))
def test_hardware_layout_is_the_packing(dtype: np.dtype) -> None:
    layout = layout_of(dtype)
    assert layout.size == bitpack.width(dtype)
    for name, index, _, offset, width in bitpack.fields(dtype):
        field, inner = layout[name], 0
        if index:
            inner, field = index[0] * width, field.shape[index[0]]
        assert layout[name].offset + inner == offset
        assert (field.width if index else layout[name].width) == width
    packet = packet_of(dtype, 7)
    assert (packet["data"].offset, packet["tag"].offset, packet.size) == (0, layout.size, layout.size + 7)


def test_bits_above_a_field_or_payload_are_ignored() -> None:
    words = every_bit_random(EXAMPLE, 100, seed=4)
    dirty = np.concatenate([words, np.full((100, 1), 0xFFFFFFFF, dtype=np.uint32)], axis=1)
    dirty[:, 3] |= np.uint32(0xFFFFFFFF << (bitpack.width(EXAMPLE) - 96) & 0xFFFFFFFF)
    assert (bitpack.pack(bitpack.unpack(dirty, EXAMPLE)) == words).all()
    record = np.zeros(1, dtype=EXAMPLE)
    record["small"] = 0xFF
    assert int(bitpack.pack(record)[0, 2]) == 0b11111 << 1


def test_equality_is_of_bits() -> None:
    left = np.array([(np.nan,), (0.0,), (1.0,)], dtype=formats.FLOAT)
    right = np.array([(np.nan,), (-0.0,), (1.0,)], dtype=formats.FLOAT)
    assert bitpack.equal(left, right).tolist() == [True, False, True]
    right["z"].view(np.uint32)[0] ^= 1
    assert bitpack.equal(left, right).tolist() == [False, False, True]


@settings(deadline=None)
@given(st.integers(1, 64), st.integers(1, 64), st.integers(1, 64), st.data())
def test_bit_fields_of_any_width(low: int, high: int, signed: int, data: st.DataObject) -> None:
    dtype = np.dtype([("low", bits(low)), ("high", bits(high)), ("signed", signed_bits(signed))])
    one, two = data.draw(st.integers(0, (1 << low) - 1)), data.draw(st.integers(0, (1 << high) - 1))
    three = data.draw(st.integers(-(1 << signed - 1), (1 << signed - 1) - 1))
    record = np.array([(one, two, three)], dtype=dtype)
    whole = sum(int(word) << 32 * k for k, word in enumerate(bitpack.pack(record)[0]))
    assert whole == one | two << low | (three & (1 << signed) - 1) << low + high
    assert (bitpack.unpack(bitpack.pack(record), dtype) == record).all()


def test_no_records_pack_to_no_words() -> None:
    assert bitpack.pack(np.zeros(0, dtype=EXAMPLE)).shape == (0, 4)
    assert len(bitpack.unpack(np.zeros((0, 4), dtype=np.uint32), EXAMPLE)) == 0
