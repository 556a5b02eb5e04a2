"""Mode numbers of other autopilots: a number of ArduSub must not select a mode."""

from typing import Any

import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import all as mavlink

from autopilot.control import modes
from tests.helpers.commands import ACCEPTED, DENIED, NAN, results
from tests.helpers.fake_hil import Harness, texts

ARDUSUB = sorted(mavutil.mode_mapping_sub)
"""Mode numbers of ArduSub, for example 0 STABILIZE, 3 AUTO, 9 SURFACE, 19 MANUAL."""


def set_mode_apm(number: float) -> Any:
    """Return the message of pymavlink's ``mavfile.set_mode_apm``, used by MAVProxy's ``mode``."""
    return mavlink.MAVLink_command_long_message(1, 1, 176, 0, 1, number, 0, 0, 0, 0, 0)


def by_command_int(number: int) -> Any:
    return mavlink.MAVLink_command_int_message(1, 1, 0, 176, 0, 0, 1, number, 0, 0, 0, 0, 0)


def by_message(number: int) -> Any:
    return mavlink.MAVLink_set_mode_message(1, 1, number)


@pytest.mark.parametrize("armed", [False, True])
@pytest.mark.parametrize("build_message", [set_mode_apm, by_command_int, by_message])
@pytest.mark.parametrize("number", ARDUSUB)
def test_ardusub_mode_number_is_refused_without_effect(
    harness: Harness, number: int, build_message: Any, armed: bool
) -> None:
    if armed:
        harness.command(400, 1)
    received = harness.ask(build_message(number))
    harness.command(400, 1)
    harness.tick(50)
    state = harness.vehicle.state
    assert (state.mode, state.setpoint.thrust, state.thrust) == (modes.HOLD.number, 0.0, 0.0)
    assert results(received) == ([] if build_message is by_message else [DENIED])
    assert texts(received) == [
        f"Mode {number} refused: not a mode of this vehicle (AVAILABLE_MODES); "
        "MAVProxy needs `ground modes export-mavproxy`"
    ]


@pytest.mark.parametrize("mode", [modes.MANUAL, modes.DEPTH, modes.STATION, modes.STABILIZE])
def test_mavsdk_main_mode_is_set(harness: Harness, mode: modes.Mode) -> None:
    """MAVSDK 4.1 sends POSCTL, ALTCTL and OFFBOARD with param3 0 and param4 to 7 NaN."""
    assert results(harness.command(176, 129, mode.number >> 16, 0, NAN, NAN, NAN, NAN)) == [
        ACCEPTED
    ]
    assert harness.vehicle.state.mode == mode.number


@pytest.mark.parametrize("mode", [m for m in modes.MODES if m not in (modes.SYSID, modes.OFFBOARD)])
@pytest.mark.parametrize("build_message", [set_mode_apm, by_message])
def test_complete_custom_mode_is_set(
    harness: Harness, mode: modes.Mode, build_message: Any
) -> None:
    """MAVProxy after ``ground modes export-mavproxy``; QGroundControl with SET_MODE."""
    harness.command(176, 1, float(modes.MANUAL.number if mode == modes.HOLD else modes.HOLD.number))
    harness.ask(build_message(mode.number))
    assert harness.vehicle.state.mode == mode.number


@pytest.mark.parametrize("mode", [modes.HOLD, modes.MISSION, modes.RTL, modes.SURFACE])
def test_main_and_sub_mode_with_zero_parameters_are_set(harness: Harness, mode: modes.Mode) -> None:
    harness.command(176, 1, float(modes.MANUAL.number))
    assert results(harness.command(176, 1, 4, mode.number >> 24, 0, 0, 0, 0)) == [ACCEPTED]
    assert harness.vehicle.state.mode == mode.number
