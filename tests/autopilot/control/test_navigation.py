"""Navigation filter against a Kalman filter of real matrices, and against known errors."""

import cmath
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from autopilot.control import navigation
from autopilot.control.navigation import MotionInput, NavSolution
from autopilot.control.params import Config
from autopilot.control.sensor_health.sensor_checks import add_fix
from autopilot.control.sensor_health.types import Device
from autopilot.control.types import Home, Inputs, NavCovariance, Navigation
from mavlink_io.frames import offset_to_geodetic, quaternion_from_euler
from mavlink_io.records import NO_FIX, NO_PING, Dvl, GpsFix
from tests.helpers.missions import TICK_US, sensors

HOME = Home(42.35, -71.0, True)
CONFIG = Config()
SMALL = st.complex_numbers(max_magnitude=1.5, allow_nan=False, allow_infinity=False)


def hermitian(c: NavCovariance) -> NDArray[np.complex128]:
    """Return the covariance as a matrix, shape (4, 4)."""
    upper: NDArray[np.complex128] = np.array(
        [
            [c.position / 2, c.position_current, c.position_speed, c.position_dvl],
            [0, c.current / 2, c.current_speed, c.current_dvl],
            [0, 0, c.speed / 2, c.speed_dvl],
            [0, 0, 0, c.dvl / 2],
        ]
    )
    return upper + upper.conj().T


def covariance(matrix: NDArray[np.complex128]) -> NavCovariance:
    m = matrix.tolist()
    return NavCovariance(
        m[0][0].real,
        m[1][1].real,
        m[2][2].real,
        m[3][3].real,
        m[0][1],
        m[0][2],
        m[0][3],
        m[1][2],
        m[1][3],
        m[2][3],
    )


def real(matrix: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return a complex matrix as a real one with 2 x 2 blocks."""
    return np.block(
        [[np.array([[z.real, -z.imag], [z.imag, z.real]]) for z in row] for row in matrix]
    )


@st.composite
def covariances(draw: st.DrawFn) -> NavCovariance:
    parts = draw(st.lists(SMALL, min_size=16, max_size=16))
    root = np.array(parts).reshape(4, 4)
    return covariance(root @ root.conj().T + 0.01 * np.eye(4))


@given(
    before=covariances(),
    row=st.lists(SMALL, min_size=4, max_size=4),
    error=SMALL,
    variance=st.floats(0.01, 4.0),
)
def test_kalman_update_equals_real_valued_filter(
    before: NavCovariance, row: list[complex], error: complex, variance: float
) -> None:
    """Reference: Kalman filter in eight real variables (Gelb 1974, table 4.2-1)."""
    solution = NavSolution(0j, 0j, Navigation(covariance=before))
    after = navigation._kalman_update(solution, (row[0], row[1], row[2], row[3]), error, variance)
    p, h = real(hermitian(before)), real(np.array([row]))
    gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + variance * np.eye(2))
    step = gain @ np.array([error.real, error.imag])
    moved = (
        after.position_m,
        after.memory.current_mps,
        after.memory.speed_error,
        after.memory.dvl_error,
    )
    np.testing.assert_allclose([part for z in moved for part in (z.real, z.imag)], step, atol=1e-9)
    np.testing.assert_allclose(
        real(hermitian(after.memory.covariance)), (np.eye(8) - gain @ h) @ p, atol=1e-9
    )


@given(
    before=covariances(),
    distance=SMALL,
    turn=st.floats(-0.5, 0.5),
    has_dvl=st.booleans(),
    over_ground=st.booleans(),
)
def test_covariance_propagation_equals_matrix_equation(
    before: NavCovariance, distance: complex, turn: float, has_dvl: bool, over_ground: bool
) -> None:
    """Reference: F P F^H in complex numbers; process noise only adds to the diagonal."""
    memory = Navigation(
        current_mps=0.1 - 0.2j,
        covariance=before,
        ping_us=0 if has_dvl else -1,
        over_ground=over_ground,
    )
    motion = MotionInput(100_000, (1.0, 0.0, 0.0, 0.0), distance / 0.2, True, turn, 0.0)
    after = hermitian(
        navigation._propagate_covariance(memory, 0.2, distance, motion, CONFIG).covariance
    )
    f = np.eye(4, dtype=complex)
    f[0, 1:] = (0.2, distance, 0.0)
    if has_dvl:
        f[0, 1:] = (
            (0.0, 0.0, -(distance + memory.current_mps * 0.2))
            if over_ground
            else (0.2, 0.0, -distance)
        )
    noise = after - f @ hermitian(before) @ f.conj().T
    off_diagonal = noise - np.diag(np.diag(noise))
    assert np.abs(off_diagonal).max() < 1e-12
    assert np.diag(noise).real.min() > -1e-12


def advance(solution: NavSolution, motion: MotionInput, inputs: Inputs, dt_s: float) -> NavSolution:
    """Dead reckoning by one tick, with the measurements of the tick if there are any."""
    located = inputs.gps is not None or inputs.dvl is not None
    solution = navigation.predict(
        solution.position_m, solution.memory, motion, CONFIG, dt_s, located
    )
    if not located:
        return solution
    fix, ping = inputs.gps or NO_FIX, inputs.dvl or NO_PING
    return navigation.correct(solution, motion, fix, inputs.dvl is not None, ping, HOME, CONFIG)


def drive(
    memory: Navigation,
    *,
    seconds: float,
    heading_rad: float,
    current: complex = 0j,
    water: complex = 1 + 0j,
    dvl: bool = False,
    gps: bool = False,
    start_us: int = 0,
    place: complex = 0j,
) -> tuple[NavSolution, complex, int]:
    """Drive straight at 1.3 m/s by thrust, ``water`` times that in truth.

    Returns the solution, the true position and the time.
    """
    ahead = cmath.rect(1.3, heading_rad)
    true_mps = ahead * water + current
    now_us = start_us
    solution = NavSolution(place, 0j, memory)
    true = place
    attitude = quaternion_from_euler(0.0, 0.0, heading_rad)
    for tick in range(round(seconds * 50)):
        now_us += TICK_US
        true += true_mps * 0.02
        body = true_mps * cmath.rect(1.0, -heading_rad)
        ping = (
            Dvl(now_us, body.real, body.imag, 0.0, True, 0.01, 100)
            if dvl and tick % 10 == 0
            else None
        )
        lat, lon = offset_to_geodetic(true.real, true.imag, HOME.lat_deg, HOME.lon_deg)
        fix = (
            GpsFix(now_us, 3, lat, lon, 0.0, true_mps.real, true_mps.imag, 0.0, 10, 1.5)
            if gps
            else None
        )
        inputs = Inputs(sensors(now_us), fix if tick % 10 == 0 else None, None, None, dvl=ping)
        motion = MotionInput(now_us, attitude, ahead, True, 0.0, 0.0)
        solution = advance(solution, motion, inputs, 0.02)
    return solution, true, now_us


def test_turn_separates_speed_error_from_current() -> None:
    """On one course 5 % of speed equals 6.5 cm/s of current; on two courses they differ."""
    memory, place, now_us = navigation.initial_solution(CONFIG), 0j, 0
    for heading in (0.0, 0.5 * math.pi, math.pi, 0.0):
        solution, place, now_us = drive(
            memory,
            seconds=60.0,
            heading_rad=heading,
            current=0.1j,
            water=0.96 + 0.02j,
            dvl=True,
            start_us=now_us,
            place=place,
        )
        memory = solution.memory
    assert memory.current_mps == pytest.approx(0.1j, abs=0.01)
    assert memory.speed_error == pytest.approx(-0.04 + 0.02j, abs=0.01)
    assert abs(solution.position_m - place) < 0.02 * abs(place) + 1.0


def test_position_sd_without_dvl_matches_error() -> None:
    solution, true, _ = drive(
        navigation.initial_solution(CONFIG), seconds=100.0, heading_rad=0.3, current=0.2 + 0j
    )
    assert abs(solution.position_m - true) == pytest.approx(20.0, rel=0.01)
    assert navigation.sd_m(solution.memory) == pytest.approx(
        math.hypot(100 * 0.2, 130 * 0.05), rel=0.02
    )


def test_fix_outlier_is_rejected_until_it_persists() -> None:
    solution, true, now_us = drive(
        navigation.initial_solution(CONFIG), seconds=20.0, heading_rad=0.0, gps=True
    )
    for k in range(1, 40):
        now_us, true = now_us + 200_000, true + 0.26
        lat, lon = offset_to_geodetic(true.real + 40.0, true.imag, HOME.lat_deg, HOME.lon_deg)
        fix = GpsFix(now_us, 3, lat, lon, 0.0, 1.3, 0.0, 0.0, 10, 1.5)
        motion = MotionInput(now_us, (1.0, 0.0, 0.0, 0.0), 1.3 + 0j, True, 0.0, 0.0)
        inputs = Inputs(sensors(now_us), fix, None, None)
        solution = advance(solution, motion, inputs, 0.2)
        if k == 10:
            assert abs(solution.position_m - true) < 3.0
            assert solution.memory.fixes_rejected == 10
    assert abs(solution.position_m - (true + 40.0)) < 10.0


@pytest.mark.parametrize(("lon_deg", "plausible"), [(-179.99999, True), (181.0, False)])
def test_fix_across_the_antimeridian_is_near_the_last_one(lon_deg: float, plausible: bool) -> None:
    before = GpsFix(1_000_000, 3, -17.0, 179.99999, 0.0, 1.3, 0.0, 0.0, 10, 1.5)
    _, device = add_fix(Device(), before, 1_000_000)
    fix = before._replace(time_us=1_200_000, lon_deg=lon_deg)
    assert add_fix(device, fix, 1_200_000)[0] == plausible


@settings(max_examples=20)
@given(north=st.floats(-500, 500), east=st.floats(-500, 500))
def test_set_home_keeps_position_over_ground(north: float, east: float) -> None:
    moved = Home(*offset_to_geodetic(north, east, HOME.lat_deg, HOME.lon_deg), True)
    assert navigation.shift_home(3 + 4j, HOME, moved) == pytest.approx(
        3 - north + (4 - east) * 1j, abs=0.1
    )
    assert navigation.shift_home(3 + 4j, Home(), moved) == 3 + 4j
