"""Tests without excitation and closed-loop data are rejected by name; real tests are accepted."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from sitl.vehicle import config
from sysid import refit
from sysid.data.runs import RATE_HZ, Run
from sysid.data.segments import MarkedInterval
from sysid.planes import Plane
from sysid.refit import RefitRequest
from sysid.screening import screen
from tests.sysid import dives, recording, sea
from tests.sysid.dives import DiveTest

TRIM_RAD = math.radians(6.0), math.radians(1.0)


def reasons(*runs: Run) -> list[str]:
    return [reason for screening in screen(runs) for reason in screening.reasons]


def still(field: config.VehicleConfig, plane: Plane, seed: int) -> Run:
    """Return 30 s of course keeping, without a test signal."""
    nothing = np.zeros(int(30 * RATE_HZ))
    return sea.fly(field, plane, nothing, seed=seed, trim_rad=TRIM_RAD, loop_on=True)


@pytest.mark.parametrize("plane", Plane)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_course_keeping_is_named_closed_loop(
    field: config.VehicleConfig, plane: Plane, seed: int
) -> None:
    (reason,) = [r for r in reasons(still(field, plane, seed)) if r.startswith("closed loop")]
    assert "command is feedback of the motion, and no test signal is added" in reason


def test_doublet_of_a_fast_hull_is_no_closed_loop_data(field: config.VehicleConfig) -> None:
    """Where the rate follows the rudder in 0.1 s, the motion explains the command well."""
    run = sea.fly(field, Plane.YAW, sea.doublet(8.0), trim_rad=TRIM_RAD)
    deflection = np.where(run.time_s < 0.0, 0.0, run.rudder_rad - TRIM_RAD[0])
    rate = lfilter([0.2], [1.0, -0.8], 1.2 * deflection)
    fast = replace(run, r_radps=rate, heading_rad=np.cumsum(rate) / RATE_HZ)
    assert not [reason for reason in reasons(fast) if reason.startswith("closed loop")]


def multisine(seconds: float, degrees: float, loop_gain: float = 1.0) -> np.ndarray:
    time_s = np.arange(int(seconds * RATE_HZ)) / RATE_HZ
    tones = [
        np.sin(2 * np.pi * f * time_s + 2.0 * k)
        for k, f in enumerate((0.05, 0.11, 0.17, 0.29, 0.41))
    ]
    total = np.sum(tones, axis=0)
    return np.asarray(math.radians(degrees) * total / np.max(np.abs(total)) * loop_gain)


@pytest.mark.parametrize("plane", Plane)
@pytest.mark.parametrize("loop_on", [False, True])
def test_multisine_is_no_closed_loop_data(
    field: config.VehicleConfig, plane: Plane, loop_on: bool
) -> None:
    run = sea.fly(field, plane, multisine(60.0, 5.0), seed=3, trim_rad=TRIM_RAD, loop_on=loop_on)
    assert [r for r in reasons(run) if r.startswith(("closed loop", "no excitation"))] == []


def test_held_surface_is_no_excitation(field: config.VehicleConfig) -> None:
    run = sea.fly(field, Plane.YAW, sea.step(4.0), level=sea.CALM, trim_rad=TRIM_RAD)
    held = replace(run, rudder_rad=np.full(run.time_s.size, TRIM_RAD[0]))
    assert "no excitation: the rudder moved by 0.00 deg, at least 0.1" in reasons(held)
    # The loop that takes over moves the rudder in the last sample; it is none of the test.
    taken_over = held.rudder_rad.copy()
    taken_over[-1] = run.travel_rad
    assert reasons(replace(held, rudder_rad=taken_over)) == reasons(held)
    moved = np.where(run.time_s < 0.0, TRIM_RAD[1], TRIM_RAD[1] + math.radians(4.0))
    swapped = [r for r in reasons(replace(held, elevator_rad=moved)) if r.startswith("no exc")]
    assert swapped == [
        "no excitation: the rudder moved by 0.00 deg, at least 0.1, and the elevator by 4.0 deg:"
        " swapped planes or outputs, give the order with --servo-channels"
    ]


def test_disconnected_surface_is_no_excitation(field: config.VehicleConfig) -> None:
    """The linkage of the rudder breaks as the tests begin; the tests of the elevator stay."""

    def flown(plane: Plane, k: int) -> Run:
        signal = sea.doublet((4.0, -4.0)[k])
        answered = signal if plane == Plane.PITCH else 0.0 * signal
        run = sea.fly(field, plane, answered, name=f"{plane}/{k}", seed=k, trim_rad=TRIM_RAD)
        rudder_rad = run.rudder_rad.copy()
        rudder_rad[~run.preroll] += signal if plane == Plane.YAW else 0.0
        return replace(run, rudder_rad=rudder_rad)

    runs = [flown(plane, k) for k in range(2) for plane in Plane]
    screenings = screen(runs)
    assert [s.accepted for s in screenings] == [False, True, False, True]
    assert (
        screenings[0]
        .reasons[0]
        .startswith("no excitation: the rudder does not move the yaw rate, effect")
    )


def test_marked_course_keeping_is_refused_as_closed_loop(
    field: config.VehicleConfig, tmp_path: Path
) -> None:
    nothing = DiveTest(Plane.YAW, np.zeros(int(40 * RATE_HZ)))
    messages = dives.entries(field, [nothing], texts=False, loop_on=True, trim_rad=TRIM_RAD)
    path = recording.write(tmp_path / "cruise.mcap", messages, {})
    with pytest.raises(
        refit.RefitError, match=r"cruise\.mcap: every test was screened out: .*closed loop: \d+%"
    ):
        refit.refit(RefitRequest(paths=[path], marks=[MarkedInterval(27.0, 62.0, Plane.YAW)]))
