"""Keyframed paths: where objects and lights are between keyframes, before and after them, and in loops."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from lightloom.golden_model.numerics.vectors import vector
from lightloom.golden_model.scene.keyframes import (
    LightKey,
    LightPath,
    ObjectKey,
    ObjectPath,
    light_at,
    object_pose,
    rotated,
    rotation_of,
)

QUARTER = (0.5**0.5, 0, 0.5**0.5, 0)
numbers = st.floats(-10, 10, width=32, allow_subnormal=False)
quaternions = st.tuples(numbers, numbers, numbers, numbers).filter(lambda q: sum(x * x for x in q) > 0.01)


def key(
    frame: int,
    translate: tuple[float, ...] = (0, 0, 0),
    rotate: tuple[float, ...] = (1, 0, 0, 0),
    emission: float = 1,
    present: bool = True,
) -> ObjectKey:
    unit = np.array(rotate) / np.sqrt(np.square(rotate).sum())
    return ObjectKey(
        frame=frame,
        translate=vector(translate),
        rotate=unit.astype(np.float32),
        emission=np.float32(emission),
        present=present,
    )


def path(*keys: ObjectKey, pivot: tuple[float, ...] = (0, 0, 0), loop: int = 0) -> ObjectPath:
    return ObjectPath(keys=keys, pivot=vector(pivot), loop=loop)


@settings(max_examples=50, deadline=None, derandomize=True)
@given(quaternions)
def test_rotations_keep_lengths_and_handedness(quaternion: tuple[float, ...]) -> None:
    rotation = rotation_of(np.array(quaternion, dtype=np.float32)).astype(np.float64)
    assert np.abs(rotation @ rotation.T - np.eye(3)).max() < 1e-6
    assert abs(np.linalg.det(rotation) - 1) < 1e-6


def test_a_rotation_turns_the_right_way_and_quarter_turns_are_exact() -> None:
    # About y by +90 degrees: z goes to x, x to -z.
    rotation = rotation_of(np.array(QUARTER, dtype=np.float32))
    assert rotated(rotation, np.eye(3, dtype=np.float32)).tolist() == [[0, 0, -1], [0, 1, 0], [1, 0, 0]]
    whole = rotation_of(np.array([1, 1, 1, 1], dtype=np.float32))
    assert rotated(whole, np.eye(3, dtype=np.float32)).tolist() == [[0, 1, 0], [0, 0, 1], [1, 0, 0]]


@settings(max_examples=50, deadline=None, derandomize=True)
@given(quaternions, st.tuples(numbers, numbers, numbers), st.integers(0, 20))
def test_the_pivot_stays_where_it_is(quaternion: tuple[float, ...], pivot: tuple[float, ...], frame: int) -> None:
    pose = object_pose(path(key(0), key(20, rotate=quaternion), pivot=pivot), frame)
    moved = rotated(pose.rotation, vector(pivot)) + pose.translation
    assert np.abs(moved - vector(pivot)).max() <= 1e-5 * max(1, *map(abs, pivot))


def test_between_keyframes_straight_lines_and_held_ends() -> None:
    moving = path(key(10, translate=(2, 0, 0), emission=0), key(20, translate=(4, 8, 0), emission=2))
    for frame, place, emission in ((0, 2, 0), (10, 2, 0), (15, 3, 1), (20, 4, 2), (99, 4, 2)):
        pose = object_pose(moving, frame)
        assert pose.translation[0] == place, frame
        assert pose.emission == emission, frame
        assert (pose.rotation == np.eye(3)).all()


def test_orientations_go_the_shorter_way() -> None:
    start, end = (1, 0, 0, 0), (-(0.9**0.5), 0, 0, -(0.1**0.5))  # the same turn as its negative: about z, forwards
    half = object_pose(path(key(0, rotate=start), key(2, rotate=end)), 1).rotation
    whole = object_pose(path(key(0, rotate=start), key(2, rotate=end)), 2).rotation
    angle, full = np.arctan2(half[1, 0], half[0, 0]), np.arctan2(whole[1, 0], whole[0, 0])
    assert np.isclose(angle, full / 2, atol=1e-6)
    assert 0 < full < 1


def test_presence_is_a_step_and_what_is_absent_is_dark() -> None:
    moving = path(key(0), key(5, present=False), key(10))
    seen = [object_pose(moving, frame) for frame in range(12)]
    assert [pose.present for pose in seen] == [True] * 5 + [False] * 5 + [True] * 2
    assert [float(pose.emission) for pose in seen] == [1.0] * 5 + [0.0] * 5 + [1.0] * 2


def test_a_turntable_goes_round_without_a_seam() -> None:
    third = (1, 0, 3**0.5, 0)
    table = path(key(0), key(4, rotate=third), key(8, rotate=(-1, 0, 3**0.5, 0)), key(12), loop=12)
    angles = []
    for frame in range(25):
        rotation = object_pose(table, frame).rotation.astype(np.float64)
        angles.append(np.arctan2(rotation[0, 2], rotation[0, 0]))
    steps = np.diff(np.unwrap(angles))
    assert (steps > 0).all(), "it never turns back"
    assert np.isclose(np.unwrap(angles)[24], 4 * np.pi)
    for frame in (0, 5, 11):
        assert object_pose(table, frame).rotation.tobytes() == object_pose(table, frame + 12).rotation.tobytes()


def test_only_what_never_leaves_its_place_stays() -> None:
    assert path(key(0), key(9, emission=0)).stays
    assert not path(key(0), key(9, translate=(0, 1, 0))).stays
    assert not path(key(0), key(9, rotate=QUARTER)).stays
    assert not path(key(0), key(9, present=False)).stays
    assert not path(key(0, translate=(1, 0, 0))).stays


def test_point_lights_wander_and_change() -> None:
    wandering = LightPath(
        keys=(
            LightKey(frame=0, position=vector((0, 0, 0)), intensity=vector((4, 0, 0))),
            LightKey(frame=4, position=vector((4, 8, 0)), intensity=vector((0, 0, 4))),
        ),
        loop=6,
    )
    position, intensity = light_at(wandering, 7)
    assert position.tolist() == [1, 2, 0]
    assert intensity.tolist() == [3, 0, 1]
    assert light_at(wandering, 5)[0].tolist() == [4, 8, 0]
