"""Line-of-sight guidance: properties for any line, circle and current."""

import cmath
import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from autopilot.control import guidance
from autopilot.control.params import Config
from autopilot.control.setpoints import Circle, TrackLine
from autopilot.control.types import Home, Navigation, VehicleEstimate
from mavlink_io.frames import wrap_pi
from mavlink_io.mission_items import NOT_GIVEN, MissionItem

CONFIG = Config(los_integral_mps=0.0)
PLACES = st.complex_numbers(max_magnitude=500.0, allow_nan=False, allow_infinity=False)
CURRENTS = st.complex_numbers(max_magnitude=0.8, allow_nan=False, allow_infinity=False)
COURSES = st.floats(-math.pi, math.pi)
STEP_S = 0.5


def at(position_m: complex, current_mps: complex = 0j, speed_mps: float = 1.3) -> VehicleEstimate:
    learned = Navigation(current_mps=current_mps)
    return VehicleEstimate(
        north_m=position_m.real, east_m=position_m.imag, speed_mps=speed_mps, navigation=learned
    )


def over_ground(heading_rad: float, current_mps: complex) -> complex:
    return cmath.rect(1.3, heading_rad) + current_mps


@given(course=COURSES, current=CURRENTS)
def test_crab_heading_gives_course_in_any_current(course: float, current: complex) -> None:
    velocity = over_ground(guidance.crab_heading(course, at(0j, current)), current)
    assert abs(wrap_pi(cmath.phase(velocity) - course)) < 1e-9


@given(course=COURSES, current=st.complex_numbers(min_magnitude=1.5, max_magnitude=5.0))
def test_crab_heading_strong_current_is_limited(course: float, current: complex) -> None:
    crab = wrap_pi(guidance.crab_heading(course, at(0j, current)) - course)
    assert abs(crab) <= math.radians(60.0) + 1e-9
    assert crab * (current * cmath.rect(1.0, -course)).imag <= 0.0


@given(start=PLACES, end=PLACES, off=PLACES)
def test_cross_track_error_equals_cross_product(start: complex, end: complex, off: complex) -> None:
    assume(abs(end - start) > 1.0)
    cross, azimuth, along, length = guidance.along_track_m(TrackLine(start, end), start + off)
    line = end - start
    assert cross == pytest.approx(
        (line.real * off.imag - line.imag * off.real) / abs(line), abs=1e-6
    )
    assert cross**2 + along**2 == pytest.approx(abs(off) ** 2, abs=1e-4)
    assert length == abs(line)
    assert abs(wrap_pi(azimuth - math.atan2(line.imag, line.real))) < 1e-12


@given(start=PLACES, azimuth=COURSES, aside=st.floats(-60.0, 60.0), current=CURRENTS)
def test_line_converges_from_either_side_in_current(
    start: complex, azimuth: float, aside: float, current: complex
) -> None:
    line = TrackLine(start, start + cmath.rect(2000.0, azimuth))
    place = start + cmath.rect(aside, azimuth + 0.5 * math.pi)
    for _ in range(600):
        _, heading = guidance.follow(line, at(place, current), CONFIG, 0, STEP_S)
        place += over_ground(heading, current) * STEP_S
    assert abs(guidance.along_track_m(line, place)[0]) < 0.2


@given(
    centre=PLACES,
    off=PLACES,
    radius=st.floats(10.0, 80.0),
    clockwise=st.booleans(),
    current=CURRENTS,
)
def test_circle_converges_from_anywhere_in_its_direction(
    centre: complex, off: complex, radius: float, clockwise: bool, current: complex
) -> None:
    path: Circle | TrackLine = Circle(centre, radius, clockwise)
    place = centre + off
    for tick in range(3000):
        path, heading = guidance.follow(path, at(place, current), CONFIG, tick, STEP_S)
        place += over_ground(heading, current) * STEP_S
    assert isinstance(path, Circle)
    assert abs(abs(place - centre) - radius) < 2.5
    assert path.swept_rad > 2.0 * math.pi


@given(place=PLACES)
def test_line_end_is_reached_within_radius_or_abeam(place: complex) -> None:
    line = TrackLine(0j, 100.0 + 0j)
    assert guidance.reached(line, at(place), 5.0) == (
        abs(place - 100.0) <= 5.0 or place.real >= 100.0
    )


def test_item_position_by_frame() -> None:
    home = Home(42.35, -71.0, True)
    assert guidance.item_position(MissionItem(0, 1, 16, x=105_000, y=-20_000), home) == 10.5 - 2j
    assert guidance.item_position(MissionItem(0, 3, 16, x=0, y=0), home) is None
    assert guidance.item_position(MissionItem(0, 2, 16, x=5, y=5), home) is None
    assert guidance.item_position(MissionItem(0, 3, 16, x=NOT_GIVEN, y=NOT_GIVEN), home) is None
    north = guidance.item_position(MissionItem(0, 6, 16, x=423_509_000, y=-710_000_000), home)
    assert north is not None
    assert abs(north - 100.08) < 0.05, "0.0009 deg of latitude at 111.19 km a degree"
