"""Compiled steady ticks of a vehicle with all devices: the same as its ticks in Python."""

from typing import Any

import pytest
from msgspec.structs import replace

from autopilot.control import estimator, modes, request_handler, requests
from autopilot.control.setpoints import Setpoint
from autopilot.control.types import Inputs
from autopilot.pilot import Pilot
from mavlink_io.mission_items import MissionItem
from sitl import scenario
from sitl.scenario import Scenario
from tests.helpers.missions import excitation_item, leg
from tests.helpers.navigation_sim import Voyage

WAYPOINT = MissionItem(4, 1, 16, x=200_000, y=-100_000, z=3.0)
"""To a place 20 m north and 10 m west, 3 m deep."""
LEGS = (*leg(depth_m=2.0, heading_deg=40.0, duration_s=15.0), WAYPOINT)
TESTS = (
    *leg(depth_m=3.0, heading_deg=0.0, duration_s=15.0),
    excitation_item(4, axis=12, magnitude_deg=4.0, duration_s=15, wave=0)._replace(p3=0.1, p4=0.5),
    excitation_item(5, axis=111, magnitude_deg=1.0, duration_s=10, wave=2),
)
SHAPED = {"DPT_REF_W": 0.5, "HDG_REF_W": 0.5, "TRIM_AUTO_S": 20.0, "ACT_LEAD_W": 6.0}


class Doubled(Voyage):
    """A voyage in Python; a compiled pilot gets the same inputs and requests."""

    def __init__(self, sea: Scenario, values: dict[str, float]) -> None:
        self.pilot = Pilot(compiled=True)
        self.full_ticks = 0
        super().__init__(sea, values=values)

    def ask(self, *requests_: requests.Request) -> None:
        super().ask(*requests_)
        for request in requests_:
            self.pilot.state = request_handler.handle_request(
                self.pilot.state, request, self.config
            )[0]

    def _tick(self, reading: Any) -> Any:
        told = len(self.events)
        frame = super()._tick(reading)
        devices = reading.dvl, reading.battery, reading.leak, reading.duct
        inputs = Inputs(reading.frame, reading.gps, reading.altimeter, None, None, *devices)
        inputs = inputs._replace(**self.silences)
        if self.pilot.advance(inputs, self.config):
            assert len(self.events) == told
        else:
            self.full_ticks += 1
            assert list(self.pilot.tick(inputs, self.config)) == self.events[told:]
        assert repr(self.pilot.trace) == repr(self.trace)
        motion = estimator.motion_of(self.state.estimate, self.state.time_us)
        assert repr(self.pilot.motion) == repr(motion)
        assert repr(self.pilot.setpoint) == repr(Setpoint(*map(float, self.state.setpoint)))
        return frame


@pytest.mark.slow
@pytest.mark.parametrize("items", [LEGS, TESTS])
@pytest.mark.parametrize("values", [{}, SHAPED])
def test_compiled_ticks_equal_python(
    items: tuple[MissionItem, ...], values: dict[str, float]
) -> None:
    voyage = Doubled(scenario.load("disturbed"), values)
    voyage.sail(1.0)
    voyage.fly(*items)
    voyage.sail(34.0)
    # repr: a NaN equals itself, and a different last digit is seen.
    assert repr(voyage.pilot.state) == repr(voyage.state)
    assert voyage.full_ticks < 0.1 * 35.0 / 0.02, voyage.texts()


@pytest.mark.slow
def test_fault_of_device_ends_steady_ticks() -> None:
    voyage = Doubled(scenario.load("disturbed"), {})
    voyage.sail(1.0)
    voyage.fly(*LEGS)
    voyage.sail(8.0)
    voyage.silences = {"dvl": None}
    before = voyage.full_ticks
    voyage.sail(8.0)
    assert "DVL silent" in voyage.texts()
    assert repr(voyage.pilot.state) == repr(voyage.state)
    assert voyage.full_ticks > before


@pytest.mark.slow
def test_silent_ground_station_ends_steady_ticks() -> None:
    voyage = Doubled(scenario.load("calm"), {"FS_GCS_TIMEOUT": 5.0})
    voyage.sail(1.0)
    voyage.fly(*LEGS)
    voyage.sail(4.0)
    voyage.silences = {"ground_silent_s": 6.0}
    voyage.sail(0.1)
    assert any(text.startswith("Failsafe: ground lost") for text in voyage.texts())
    assert repr(voyage.pilot.state) == repr(voyage.state)


@pytest.mark.slow
@pytest.mark.parametrize("sea", ["calm", "disturbed"])
@pytest.mark.parametrize("values", [{}, {"SURF_FIX_S": 0.0}])
def test_ascent_and_wait_at_the_surface_are_steady(sea: str, values: dict[str, float]) -> None:
    voyage = Doubled(scenario.load(sea), values)
    voyage.sail(1.0)
    voyage.fly(*leg(depth_m=6.0, heading_deg=40.0, duration_s=60.0))
    voyage.sail(45.0)
    voyage.ask(requests.SetMode(modes.SURFACE.number))
    before, surfacing_s = voyage.full_ticks, 0.0
    while voyage.state.armed and surfacing_s < 90.0:
        voyage.sail(1.0)
        surfacing_s += 1.0
    assert "Surfaced: disarmed" in voyage.texts()
    assert repr(voyage.pilot.state) == repr(voyage.state)
    # The last second is disarmed in part, and then in Python.
    assert voyage.full_ticks - before < 0.1 * surfacing_s / 0.02 + 50, surfacing_s


@pytest.mark.slow
@pytest.mark.parametrize("unit", ["elevator", "propeller"])
def test_ascent_that_escalates_is_that_of_python(unit: str) -> None:
    fault = {"at_s": 50.0, "unit": unit, "kind": "stuck"}
    sea = replace(scenario.load("disturbed"), fault=(fault,))
    voyage = Doubled(sea, {"SURF_RISE_S": 4.0, "SURF_BUOY_N": 5.0})
    voyage.sail(1.0)
    voyage.fly(*leg(depth_m=6.0, heading_deg=40.0, duration_s=60.0))
    voyage.sail(52.0)
    voyage.ask(requests.SetMode(modes.SURFACE.number))
    voyage.sail(60.0)
    assert repr(voyage.pilot.state) == repr(voyage.state)


@pytest.mark.slow
def test_all_flights_use_one_compiled_tick() -> None:
    # A number of another type would compile the tick again in flight, for half a minute.
    from autopilot.control import steady_kernel

    for items in (LEGS, TESTS):
        voyage = Doubled(scenario.load("calm"), {})
        voyage.sail(1.0)
        voyage.fly(*items)
        voyage.sail(20.0)
    kernel: Any = steady_kernel.advance
    assert len(kernel.signatures) == 1
