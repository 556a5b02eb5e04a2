"""Logs with swapped planes, a reversed sign or of two vehicles are refused with the cause.

Each log is a simulated dive in the disturbed sea; the faults are in the log, not in the records of
the check.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.identification import outside
from benchmarks.plants import catalogue
from benchmarks.plants import logs as plant_logs
from benchmarks.plants.flight import Gains
from sitl.vehicle import config
from sysid import refit
from sysid.data import readers, segments
from sysid.data.readers.servo_channels import OutputOptions, ServoChannels
from sysid.data.runs import RATE_HZ, Run
from sysid.planes import Plane
from sysid.refit import RefitRequest
from sysid.screening import wiring
from sysid.screening.control_effect import ControlEffect
from tests.sysid import dives, recording, sea
from tests.sysid.dives import Array, DiveTest

YAW_TESTS = [DiveTest(Plane.YAW, sea.doublet(5.0)), DiveTest(Plane.YAW, sea.doublet(-5.0))]
PITCH_TESTS = [
    DiveTest(Plane.PITCH, sea.doublet(4.0, 4.0)),
    DiveTest(Plane.PITCH, sea.doublet(-4.0, 4.0)),
]


@pytest.fixture(scope="module")
def field() -> config.VehicleConfig:
    return config.load("caribou_truth")


@pytest.fixture(scope="module")
def sound(field: config.VehicleConfig, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return dives.write(
        tmp_path_factory.mktemp("wiring") / "sound.mcap", field, YAW_TESTS + PITCH_TESTS
    )


def refusal(*paths: Path, channels: ServoChannels | None = None) -> str:
    logs = [readers.read(path, OutputOptions(channels)) for path in paths]
    return wiring.refusal([wiring.LogOfRuns(log, segments.cut_runs(log)) for log in logs])


def test_correctly_wired_dive_is_accepted(sound: Path) -> None:
    assert refusal(sound) == ""


@pytest.mark.parametrize(
    ("channels", "surface", "direction"),
    [(ServoChannels(-1, 2, 3), "rudder", "to port"), (ServoChannels(1, -2, 3), "elevator", "down")],
)
def test_reversed_output_names_surface(
    sound: Path, channels: ServoChannels, surface: str, direction: str
) -> None:
    said = refusal(sound, channels=channels)
    assert said.startswith(
        f"sound.mcap: reversed sign: a positive {surface} turns the nose {direction}"
    )
    with pytest.raises(refit.RefitError, match=re.escape(said)):
        refit.refit(RefitRequest(paths=[sound], outputs=channels))


@pytest.mark.parametrize(
    ("gyro", "reason"),
    [
        (1.18, "sound.mcap: the heading changes by 0.85 +- 0.0"),
        (0.83, "sound.mcap: the heading changes by 1.2"),
        (1.05, ""),
    ],
)
def test_scale_of_a_gyro_is_named(sound: Path, gyro: float, reason: str) -> None:
    """A fit to such rates gave unstable vehicles, and an error about the tests."""
    log = readers.read(sound, OutputOptions(None))
    runs = [replace(run, r_radps=gyro * run.r_radps) for run in segments.cut_runs(log)]
    said = wiring.refusal([wiring.LogOfRuns(log, runs * 2)])
    assert said.startswith(reason)
    assert bool(said) is bool(reason)


@pytest.mark.parametrize("late_s", [0.2, 0.04])
def test_lag_of_one_angle_alone_is_named(sound: Path, late_s: float) -> None:
    """A fit gave "z_CM at a bound: the prior is wrong" for a compass that was 0.2 s late."""
    log = readers.read(sound, OutputOptions(None))
    runs = [
        replace(run, heading_rad=np.interp(run.time_s - late_s, run.time_s, run.heading_rad))
        for run in segments.cut_runs(log)
    ]
    said = wiring.refusal([wiring.LogOfRuns(log, runs)] * 2)
    assert said.startswith("the heading follows its rate +0.20 s") is (late_s > 0.1)
    assert bool(said) is (late_s > 0.1)
    yaw = [run for run in runs if run.plane is Plane.YAW]
    assert wiring.refusal([wiring.LogOfRuns(log, yaw)] * 2) == "", "one lag is estimated"


def test_swapped_outputs_are_named(sound: Path) -> None:
    channels = ServoChannels(2, 1, 3)
    said = refusal(sound, channels=channels)
    assert said.startswith(
        "sound.mcap: swapped planes: in the rudder tests the elevator output moves the yaw rate"
    )
    assert "--servo-channels" in said
    with pytest.raises(refit.RefitError, match=re.escape(said)):
        refit.refit(RefitRequest(paths=[sound], outputs=channels))


def test_swapped_surfaces_of_vehicle_are_named(field: config.VehicleConfig, tmp_path: Path) -> None:
    """Both commands go to the other surface; the texts name the surfaces as commanded."""
    flown = [DiveTest(Plane.PITCH, test.signal_rad, announced=Plane.YAW) for test in YAW_TESTS]
    path = dives.write(
        tmp_path / "crossed.mcap",
        field,
        flown,
        change=lambda log: log[:, [0, 1, 2, 3, 4, 5, 6, 8, 7]],
    )
    assert refusal(path).startswith(
        "crossed.mcap: swapped planes: in the rudder tests the rudder output moves the pitch rate"
    )


def test_rudder_of_a_vehicle_that_keeps_turning_is_not_swapped() -> None:
    """Values of a campaign: the vehicle turned at 24 deg/s against its rudder, hard over."""
    own, gain = ControlEffect(0.032, 0.011, 0.08), ControlEffect(0.24, 0.032, 0.36)
    pitch = ControlEffect(-0.030, 0.0034, 0.43)
    assert not wiring._is_swapped(own, gain, pitch)
    assert wiring._is_swapped(own, gain._replace(share=0.05), pitch)


def test_logs_of_two_vehicles_are_refused(sound: Path, tmp_path: Path) -> None:
    """The other vehicle turns six times as fast for its rudder; both have no parameters."""
    remus = config.load("remus100")
    caribou = config.load("caribou_truth")
    one = recording.write(tmp_path / "one.mcap", dives.entries(caribou, YAW_TESTS[:1]), {})
    small = [DiveTest(Plane.YAW, sea.doublet(2.6))]
    other = recording.write(
        tmp_path / "other.mcap", dives.entries(remus, small, trim_rad=(0.0, 0.0), level=0.3), {}
    )
    logs = [readers.read(path) for path in (one, other)]
    said = wiring.refusal([wiring.LogOfRuns(log, segments.cut_runs(log)) for log in logs])
    assert said.startswith("one.mcap and other.mcap: two different vehicles")
    assert "fit the logs of one vehicle" in said
    with pytest.raises(refit.RefitError, match="two different vehicles"):
        refit.refit(RefitRequest(paths=[one], held_out=[other]))


@pytest.mark.parametrize(
    ("factor", "hint"),
    [(math.degrees(1.0), True), (math.radians(1.0) / 1.8, True), (6.0, False), (200.0, False)],
)
def test_effects_with_the_ratio_of_degrees_to_radians_name_the_unit(
    sound: Path, monkeypatch: pytest.MonkeyPatch, factor: float, hint: bool
) -> None:
    log, runs = readers.read(sound), segments.cut_runs(readers.read(sound))
    own, other = (replace(runs[0], name=name) for name in ("one", "other"))
    effects = {
        "one": ControlEffect(0.1 * factor, 0.001 * factor, 0.9),
        "other": ControlEffect(0.1, 0.001, 0.9),
    }
    monkeypatch.setattr(wiring, "control_effect", lambda runs, *_: effects[runs[0].name])
    reason = wiring._different_effects([wiring.LogOfRuns(log, [one]) for one in (own, other)])
    assert "two different vehicles" in reason
    assert ("is that of degrees to radians, about 57" in reason) is hint


@pytest.mark.slow
@pytest.mark.parametrize("seed", [11, 368, 370])
def test_logs_of_one_unstable_vehicle_are_accepted(seed: int, tmp_path: Path) -> None:
    """With seed 11 its long steps have a fifth of the effect of its sweeps.

    With the others it spins after large steps, loses its speed and begins the next tests so.
    """
    case = outside.case_of("stall")
    fitted, held_out = plant_logs.campaign(
        tmp_path,
        catalogue.plant("stall", seed),
        scalings=outside.scalings_of(case),
        gains=Gains(*case.hold),
        seed=seed,
    )
    assert refusal(*fitted, *held_out) == ""


def test_tests_that_the_surface_does_not_explain_are_not_compared(
    sound: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Values of a campaign: in its last test an unstable hull of 5.4 m turned by itself.

    It was refused as another vehicle.
    """
    step, sweep, doublet = (
        replace(segments.cut_runs(readers.read(sound))[0], name=name)
        for name in ("step", "sweep", "doublet")
    )

    def effect(runs: Sequence[Run], plane: Plane, surface: Plane) -> ControlEffect:
        """Return what the estimate from these runs was."""
        values = {
            "step": ControlEffect(0.424, 0.036, 0.86),
            "sweep": ControlEffect(0.253, 0.011, 0.93),
            "doublet": ControlEffect(0.034, 0.013, 0.19),
            "sweep doublet": ControlEffect(0.14, 0.01, 0.45),
        }
        return values[" ".join(run.name for run in runs)]

    log = readers.read(sound)
    monkeypatch.setattr(wiring, "control_effect", effect)
    logs = [wiring.LogOfRuns(log, [step]), wiring.LogOfRuns(log, [sweep, doublet])]
    assert wiring._different_effects(logs) == ""
    weaker = ControlEffect(0.1, 0.01, 0.9)
    monkeypatch.setattr(
        wiring, "control_effect", lambda runs, *_: weaker if runs[0] is sweep else effect(runs, *_)
    )
    assert "two different vehicles" in wiring._different_effects(logs)


def test_logs_with_different_travel_are_two_vehicles(
    sound: Path, field: config.VehicleConfig, tmp_path: Path
) -> None:
    messages = dives.entries(field, YAW_TESTS[:1], seed=7)
    other = recording.write(tmp_path / "other.mcap", messages, {"ACT_TRAVEL_DEG": 13.6})
    said = refusal(sound, other)
    assert said == (
        "sound.mcap and other.mcap: two different vehicles: ACT_TRAVEL_DEG = 15 and 13.6; fit the"
        " logs of one vehicle"
    )


def test_tests_of_both_surfaces_are_checked(sound: Path, field: config.VehicleConfig) -> None:
    """Multisines with alternating tones on both surfaces at once."""
    time_s = np.arange(int(60 * RATE_HZ)) / RATE_HZ
    rudder, elevator = (
        np.radians(1.5) * sum(np.sin(2 * np.pi * f * time_s + 9.0 * f) for f in tones)
        for tones in ((0.04, 0.12, 0.2, 0.28), (0.08, 0.16, 0.24, 0.32))
    )
    trim_rad = math.radians(6.0), math.radians(1.0)
    measured = sea.fly_tests(
        field, sea.Tests(rudder, elevator), rng=np.random.default_rng(1), trim_rad=trim_rad
    )
    log = readers.read(sound)

    def said(rows: Array) -> str:
        runs = [
            replace(
                sea.run_of(rows, field, p, s, name=f"x/{p}", wave="multisine", trim_rad=trim_rad),
                both=True,
            )
            for p, s in ((Plane.YAW, rudder), (Plane.PITCH, elevator))
        ]
        return wiring.refusal([wiring.LogOfRuns(log, runs)])

    assert said(measured) == ""
    reversed_rudder, swapped = measured.copy(), measured.copy()
    reversed_rudder[:, 7] *= -1.0
    swapped[:, [7, 8]] = measured[:, [8, 7]]
    assert "reversed sign: a positive rudder turns the nose to port" in said(reversed_rudder)
    assert "swapped planes" in said(swapped)


def test_reversed_sensor_is_left_to_kinematics(field: config.VehicleConfig, tmp_path: Path) -> None:
    def reversed_gyro(log: Array) -> Array:
        log = np.array(log)
        log[:, 2] *= -1.0
        return log

    path = dives.write(tmp_path / "gyro.mcap", field, YAW_TESTS, change=reversed_gyro)
    with pytest.raises(refit.RefitError, match="kinematics: heading and yaw rate disagree"):
        refit.refit(RefitRequest(paths=[path]))
