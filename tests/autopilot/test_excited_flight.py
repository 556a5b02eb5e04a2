"""Identification tests in the pure tick: moved actuators, open loops and termination."""

import math

import pytest

from autopilot.control import modes, requests
from autopilot.control.params import Config
from autopilot.control.types import ACCEPTED
from tests.helpers.missions import Flight, excitation_item, leg, under_way


def test_step_excitation_opens_only_its_plane_and_ends() -> None:
    flight = under_way(rudder_trim_deg=2.0)
    request = requests.StartTest(12, 5.0, 0.0, 0.0, 4.0, 1, 0.0)
    assert flight.ask(request) == ACCEPTED
    before = flight.state.loops.heading_integral_rad
    flight.step()
    assert math.degrees(flight.trace.rudder_rad) == pytest.approx(7.0)
    assert flight.state.mode == modes.SYSID.number
    for _ in flight.run(3.9):
        pass
    assert flight.state.loops.heading_integral_rad == before, (
        "the integrator of an open loop is frozen"
    )
    assert flight.run_until(lambda s: s.test is None, 1.0) == pytest.approx(0.1, abs=0.03)
    assert flight.texts()[-2:] == ["SystemID Finished", "Mode DEPTH"]
    assert flight.heading > math.radians(5.0)
    assert abs(flight.depth_m - 5.0) < 0.1, "the loop of the other plane stays closed"


@pytest.mark.parametrize(
    ("changes", "altitude_m", "word"),
    [
        ({"sid_pitch_max_deg": 10.0}, None, "pitch"),
        ({"sid_depth_min_m": 4.5}, None, "depth"),
        ({"sid_altitude_min_m": 3.0}, 2.0, "altitude"),
        ({"sid_time_max_s": 2.0}, None, "time"),
        ({"sid_rate_max_degps": 3.0}, None, "rate"),
    ],
)
def test_excitation_outside_envelope_stops_with_reason(
    changes: dict[str, float], altitude_m: float | None, word: str
) -> None:
    flight = under_way(modes.DEPTH, **changes)
    flight.altitude_m = altitude_m
    assert flight.ask(requests.StartTest(11, 8.0, 0.0, 0.0, 60.0, 1, 0.0)) == ACCEPTED
    flight.run_until(lambda s: s.test is None, 20.0)
    stopped = [text for text in flight.texts() if text.startswith("SystemID Stopped: ")]
    assert len(stopped) == 1
    assert word in stopped[0]
    assert flight.state.armed
    assert flight.state.mode == modes.DEPTH.number


def test_mission_continues_after_stopped_excitation() -> None:
    flight = Flight(config=Config(sid_pitch_max_deg=10.0))
    flight.step()
    items = (
        *leg(depth_m=5, heading_deg=0, duration_s=5),
        excitation_item(4, axis=11, magnitude_deg=8.0, duration_s=60),
        *leg(depth_m=5, heading_deg=0, duration_s=5, first=5),
    )
    assert flight.ask(requests.LoadMission(items)) == ACCEPTED
    flight.ask(requests.SetMode(modes.MISSION.number))
    flight.ask(requests.Arm())
    flight.run_until(lambda s: s.mission.current > 4, 30.0)
    assert any("pitch" in text for text in flight.texts())
    flight.run_until(lambda s: not s.armed, 60.0)


def test_added_excitation_keeps_loop_closed() -> None:
    """Reference: the same flight without a test.

    The command differs first by the signal only; later the loop balances it.
    """
    flight, plain = under_way(), under_way()
    for run in (flight, plain):
        run.ask(requests.ChangeTarget(heading_rad=math.radians(3.0)))
    assert flight.ask(requests.StartTest(112, 5.0, 0.0, 0.0, 40.0, 1, 0.0)) == ACCEPTED
    for run in (flight, plain):
        run.step()
    assert flight.trace.rudder_rad == pytest.approx(plain.trace.rudder_rad + math.radians(5.0))
    assert flight.trace.excitation_rad == pytest.approx(math.radians(5.0))
    for _ in flight.run(38.0):
        pass
    assert math.degrees(flight.heading) == pytest.approx(
        3.0 + 5.0 / flight.config.heading_p, abs=1.0
    )


def test_combined_excitation_opens_both_loops() -> None:
    flight = under_way(rudder_trim_deg=2.0, elevator_trim_deg=-1.0, sid_elevator_pct=25.0)
    assert flight.ask(requests.StartTest(23, 4.0, 0.05, 0.5, 40.0, 4, 0.0)) == ACCEPTED
    outputs = [(flight.trace.rudder_rad, flight.trace.elevator_rad) for _ in flight.run(39.9)]
    rudder, elevator = zip(*outputs, strict=True)
    for surface, trim_deg, size_deg in ((rudder, 2.0, 4.0), (elevator, -1.0, 1.0)):
        assert math.degrees(sum(surface) / len(surface)) == pytest.approx(trim_deg, abs=0.05)
        peak = max(abs(math.degrees(angle) - trim_deg) for angle in surface)
        assert 0.8 * size_deg < peak <= size_deg


def test_thrust_excitation_adds_to_thrust_with_closed_loops() -> None:
    flight = under_way()
    flight.ask(requests.ChangeTarget(thrust=0.58))
    flight.step()
    assert flight.ask(requests.StartTest(13, 12.0, 0.0, 0.0, 4.0, 1, 0.0)) == ACCEPTED
    flight.step()
    assert flight.trace.thrust == pytest.approx(0.70)
    flight.ask(requests.ChangeTarget(heading_rad=0.2))
    flight.step()
    assert flight.trace.rudder_rad > 0.05
    flight.run_until(lambda s: s.test is None, 5.0)
    assert flight.trace.thrust == pytest.approx(0.58)
