"""Planned test signals equal those that the autopilot generates."""

import numpy as np
import pytest

from autopilot.control import excitation, requests
from autopilot.control.params import Config
from autopilot.control.types import AutopilotState
from sysid.data.runs import RATE_HZ
from sysid.planes import PLANES, Plane
from sysid.test_design import simulate
from sysid.test_design.simulate import Manoeuvre, SimulatedLevelFlight

WAVES = [
    Manoeuvre(Plane.YAW, "step", 4.0, 6),
    Manoeuvre(Plane.PITCH, "doublet", 2.0, 7),
    Manoeuvre(Plane.YAW, "3211", -3.0, 11),
    Manoeuvre(Plane.PITCH, "chirp", 2.0, 20, 0.05, 0.5),
    Manoeuvre(Plane.YAW, "multisine", 5.0, 30, 0.05, 0.5, loop_on=True),
    Manoeuvre(Plane.PITCH, "prbs", 1.5, 20, stop_hz=0.6, seed=3),
    Manoeuvre(Plane.YAW, "square", 3.0, 17, runs=(3, 1, 4, 1, 5, 9, 2, 6)),
]


@pytest.mark.parametrize("planned", WAVES, ids=lambda m: m.wave)
def test_signal_equals_autopilot_excitation(planned: Manoeuvre) -> None:
    number = {name: wave for wave, name in excitation.WAVES.items()}[planned.wave]
    axis = PLANES[planned.plane].sid_axis
    wish = requests.StartTest(
        axis,
        planned.size_deg,
        planned.start_hz,
        planned.stop_hz,
        planned.duration_s,
        number,
        0.0,
        planned.seed,
        planned.runs,
    )
    test = excitation.precompute(wish, AutopilotState(), Config())
    assert excitation.check(test, 15.0) == ""
    signal = simulate.signal_rad(planned)
    played = [excitation.sample(test, k / RATE_HZ) for k in range(signal.size - 1)]
    moved = [(p.rudder_rad, p.elevator_rad)[PLANES[planned.plane].index] for p in played]
    np.testing.assert_allclose(signal[:-1], moved, atol=1e-12)
    assert signal[-1] == 0.0


def test_signal_dual_axis_equals_autopilot_excitation() -> None:
    """Separate tones for each surface, the elevator's size by the autopilot's parameter."""
    planned = Manoeuvre(Plane.YAW, "multisine", 4.0, 30, 0.05, 0.5, loop_on=True, elevator_deg=1.4)
    number = {name: wave for wave, name in excitation.WAVES.items()}["multisine"]
    wish = requests.StartTest(123, 4.0, 0.05, 0.5, 30, number, 0.0, 0, ())
    test = excitation.precompute(wish, AutopilotState(), Config(sid_elevator_pct=35.0))
    assert excitation.check(test, 15.0) == ""
    rudder, elevator = (simulate.signal_rad(half) for half in planned.halves)
    played = [excitation.sample(test, k / RATE_HZ) for k in range(rudder.size - 1)]
    np.testing.assert_allclose(rudder[:-1], [p.rudder_rad for p in played], atol=1e-12)
    np.testing.assert_allclose(elevator[:-1], [p.elevator_rad for p in played], atol=1e-12)
    assert abs(rudder @ elevator) < 1e-9 * (rudder @ rudder)
    assert planned.mirrored.halves[1].size_deg == -1.4


def test_as_run_starts_in_level_flight() -> None:
    still = SimulatedLevelFlight(trim_rad=0.1, thrust=0.58, speed_mps=1.3, pitch_rad=0.02)
    run = simulate.as_run(WAVES[1], still, simulate.signal_rad(WAVES[1]))
    before = run.preroll
    assert np.all(run.elevator_rad[before] == 0.1)
    assert np.all(run.pitch_rad == 0.02)
    assert run.time_s[-1] == pytest.approx(7.0)
    assert np.max(run.elevator_rad) == pytest.approx(0.1 + np.radians(2.0))
