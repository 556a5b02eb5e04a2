"""Axes and angles against scipy's rotations."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from mavlink_io import frames

angles = st.floats(-math.pi, math.pi)
pitches = st.floats(-1.5, 1.5)
reals = st.floats(-1e3, 1e3)
vectors = st.tuples(reals, reals, reals)
HALF_TURN_ABOUT_X = Rotation.from_euler("x", 180, degrees=True)


def rotation(q: frames.Quaternion) -> Rotation:
    return Rotation.from_quat((*q[1:], q[0]))


@given(vectors)
def test_flip_is_half_turn_about_x_and_own_inverse(v: frames.Vector) -> None:
    assert frames.flip(*v) == pytest.approx(tuple(HALF_TURN_ABOUT_X.apply(v)), abs=1e-9)
    assert frames.flip(*frames.flip(*v)) == v


@given(angles, pitches, angles, vectors)
def test_flip_quaternion_rotates_flipped_vectors(
    roll: float, pitch: float, yaw: float, v: frames.Vector
) -> None:
    q = frames.quaternion_from_euler(roll, pitch, yaw)
    rotated = frames.rotate(frames.flip_quaternion(*q), frames.flip(*v))
    assert rotated == pytest.approx(frames.flip(*frames.rotate(q, v)), abs=1e-9)


@given(angles, pitches, angles)
def test_euler_angles_are_yaw_pitch_roll(roll: float, pitch: float, yaw: float) -> None:
    q = frames.quaternion_from_euler(roll, pitch, yaw)
    reference = Rotation.from_euler("ZYX", (yaw, pitch, roll))
    np.testing.assert_allclose(rotation(q).as_matrix(), reference.as_matrix(), atol=1e-12)
    restored = frames.quaternion_from_euler(*frames.euler_from_quaternion(*q))
    np.testing.assert_allclose(rotation(restored).as_matrix(), reference.as_matrix(), atol=1e-7)


@given(angles, pitches, angles, vectors)
def test_rotate_body_to_world_and_back_is_identity(
    roll: float, pitch: float, yaw: float, v: frames.Vector
) -> None:
    q = frames.quaternion_from_euler(roll, pitch, yaw)
    assert frames.rotate(q, v) == pytest.approx(tuple(rotation(q).apply(v)), abs=1e-9)
    assert frames.rotate_back(q, frames.rotate(q, v)) == pytest.approx(v, abs=1e-9)


@given(st.floats(-1e4, 1e4))
def test_wrap_pi_keeps_the_angle(angle: float) -> None:
    wrapped = frames.wrap_pi(angle)
    assert -math.pi <= wrapped < math.pi
    assert (math.cos(wrapped), math.sin(wrapped)) == pytest.approx(
        (math.cos(angle), math.sin(angle)), abs=1e-9
    )


@given(st.floats(-5e3, 5e3), st.floats(-5e3, 5e3), st.floats(-70, 70), st.floats(-180, 180))
@example(0.0, 200.0, 20.0, 179.9999)
@example(0.0, -200.0, -20.0, -179.9999)
def test_geodetic_and_offset_are_inverse(north: float, east: float, lat: float, lon: float) -> None:
    place = frames.offset_to_geodetic(north, east, lat, lon)
    assert abs(place[1]) <= 180.0
    assert frames.geodetic_to_offset(*place, lat, lon) == pytest.approx((north, east), abs=1e-4)


def test_minute_of_latitude_is_a_nautical_mile() -> None:
    north, east = frames.geodetic_to_offset(1 / 60, 0.0, 0.0, 0.0)
    assert north == pytest.approx(1852.0, rel=2e-3)
    assert east == 0.0
