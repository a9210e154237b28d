"""Tables of directions and counter-based random numbers."""

import zlib

import numpy as np

from lightloom.golden_model.numerics.counter_rng import hash_u32, uniform
from lightloom.golden_model.numerics.directions import (
    COUNT,
    ROTATIONS,
    RUN,
    cosine_table,
    rotation_table,
    sobol,
    tangent_of,
    to_world,
)

SEED = 20250101


def test_tables_have_the_committed_bits() -> None:
    # Held so that no machine, library or change of code can move them unseen: the hardware has them in memory.
    assert zlib.crc32(cosine_table().tobytes()) == 0x6C79EB83
    assert zlib.crc32(rotation_table().tobytes()) == 0x57245125


def test_cosine_table_is_unit_symmetric_and_cosine_distributed() -> None:
    table = cosine_table()
    assert table.shape == (COUNT, 3)
    assert table.dtype == np.float32
    wide = table.astype(np.float64)
    assert np.abs((wide * wide).sum(axis=1) - 1).max() < 2e-7
    assert (table[:, 2] > 0).all()
    # Every four entries sum to zero beside the axis: exactly, so no bias in any direction.
    assert (wide.reshape(-1, 4, 3).sum(axis=1)[:, :2] == 0).all()
    # Of the density cos/pi: E[z] = 2/3, E[z^2] = 1/2, E[x^2] = 1/4.
    assert abs(wide[:, 2].mean() - 2 / 3) < 1e-5
    assert abs((wide[:, 2] ** 2).mean() - 1 / 2) < 1e-4
    assert abs((wide[:, 0] ** 2).mean() - 1 / 4) < 1e-4


def test_aligned_runs_of_the_cosine_table_are_stratified() -> None:
    """Undoing the concentric map, each run of 4**k entries has one in each cell of a 2**k by 2**k grid."""
    x, y = cosine_table().astype(np.float64)[:, :2].T
    radius = np.sqrt(x * x + y * y)
    angle = np.abs(np.arctan2(y, x))  # any library function will do for a check
    flat = np.where(angle > np.pi / 2, np.pi - angle, angle)
    ratio = np.where(flat <= np.pi / 4, flat, np.pi / 2 - flat) / (np.pi / 4)
    a = np.copysign(np.where(flat <= np.pi / 4, radius, radius * ratio), x)
    b = np.copysign(np.where(flat <= np.pi / 4, radius * ratio, radius), y)
    for k in (1, 2, 3, 4, 5, 6):
        cells = 2**k
        cell = np.floor((a + 1) / 2 * cells).astype(int) * cells + np.floor((b + 1) / 2 * cells).astype(int)
        runs = np.sort(cell.reshape(-1, cells * cells), axis=1)
        assert (runs == np.arange(cells * cells)).all(), f"runs of {cells * cells}"
    assert RUN == 16


def test_sobol_points_fill_all_elementary_boxes() -> None:
    for start in (0, 64, 1024):
        x, y = sobol(np.arange(start, start + 64))
        for bits in range(7):
            box = (x.astype(np.uint64) >> np.uint64(32 - bits)) * np.uint64(64 >> bits)
            box += y.astype(np.uint64) >> np.uint64(26 + bits)
            assert len(np.unique(box)) == 64, f"from {start}, {bits} bits of x"


def test_rotations_are_evenly_spread_and_unit() -> None:
    table = rotation_table().astype(np.float64)
    assert table.shape == (ROTATIONS, 2)
    turn = np.arctan2(table[:, 1], table[:, 0]) / (2 * np.pi) % 1
    assert np.abs(turn - (np.arange(ROTATIONS) + 0.5) / ROTATIONS).max() < 1e-7
    assert np.abs((table * table).sum(axis=1) - 1).max() < 2e-7


def test_tangent_frames_are_orthonormal_and_carry_directions_into_the_world() -> None:
    random = np.random.default_rng(SEED)
    normal = random.normal(size=(5000, 3))
    normal = np.concatenate([normal, np.eye(3), -np.eye(3), [[1e-6, 0, -1], [0, -1e-6, 1]]])
    normal = (normal / np.linalg.norm(normal, axis=1)[:, None]).astype(np.float32)
    tangent = tangent_of(normal)
    wide_n, wide_t = normal.astype(np.float64), tangent.astype(np.float64)
    assert np.abs((wide_t * wide_t).sum(axis=1) - 1).max() < 4e-7
    assert np.abs((wide_n * wide_t).sum(axis=1)).max() < 4e-7

    local = cosine_table()[random.integers(COUNT, size=len(normal))]
    turn = rotation_table()[random.integers(ROTATIONS, size=len(normal))]
    world = to_world(local, normal, tangent, turn).astype(np.float64)
    assert np.abs((world * world).sum(axis=1) - 1).max() < 2e-6
    assert np.abs((world * wide_n).sum(axis=1) - local[:, 2]).max() < 2e-6
    angle = np.arctan2(local[:, 1], local[:, 0]) + np.arctan2(turn[:, 1], turn[:, 0])
    across = np.hypot(local[:, 0], local[:, 1]) * np.cos(angle)
    assert np.abs((world * wide_t).sum(axis=1) - across).max() < 2e-6


def test_hash_has_known_values_and_depends_on_each_counter() -> None:
    assert hash_u32(0) == np.uint32(0x07BB2FE2)
    assert hash_u32(1, 2, 3) == np.uint32(0x240A9BC0)
    counters = np.arange(1000)
    for other in (hash_u32(counters, 1), hash_u32(1, counters), hash_u32(counters, 0, 1)):
        assert len(np.unique(other)) > 995
        assert (other != hash_u32(counters, 0)).mean() > 0.99
    assert (hash_u32(-1) == hash_u32(2**32 - 1)).all()


def test_hash_bits_are_uniform_and_uncorrelated() -> None:
    """2**16 values: each of the 32 bits, and each pair of neighbouring counters' bits, is set half the time."""
    bits = np.unpackbits(hash_u32(np.arange(2**16), 7).view(np.uint8)).reshape(-1, 32).astype(np.float64)
    tolerance = 5 * 0.5 / np.sqrt(len(bits))  # five standard deviations
    assert np.abs(bits.mean(axis=0) - 0.5).max() < tolerance
    assert np.abs((bits[1:] != bits[:-1]).mean(axis=0) - 0.5).max() < tolerance


def test_uniform_is_exact_and_below_one() -> None:
    values = uniform(np.array([0, 0xFF, 0x100, 0x80000000, 0xFFFFFFFF], dtype=np.uint32))
    assert values.dtype == np.float32
    assert values.tolist() == [0, 0, 2.0**-24, 0.5, 1 - 2.0**-24]
