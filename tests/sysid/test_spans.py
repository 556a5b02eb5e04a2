"""Tests that a log's texts mark, and their planes: one surface, both, or neither."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sysid.data import segments
from sysid.data.dataset import Actuators, Attitude, Depth, DuctAngles, Log, LogEvent, Setpoints
from sysid.data.events import StopReason, TestEnded, parse_text
from sysid.data.runs import Run

START_S, STOP_S = 20.0, 30.0
RUDDER_DEG, ELEVATOR_DEG = 5.0, 3.0


def cut(description: str) -> list[Run]:
    """Cut a log of forty seconds in which both surfaces step between the texts of one test."""
    return segments.cut_runs(log_of(description))


def log_of(description: str) -> Log:
    time_s = np.arange(0.0, 40.0, 0.02)
    none, empty = np.zeros_like(time_s), np.empty(0)
    inside = (time_s >= START_S) & (time_s < STOP_S)
    rudder_rad, elevator_rad = (np.radians(size) * inside for size in (RUDDER_DEG, ELEVATOR_DEG))
    return Log(
        name="dive.mcap",
        sha256="",
        attitude=Attitude(time_s, *(none,) * 6),
        actuators=Actuators(time_s, rudder_rad, elevator_rad, none),
        depth=Depth(time_s, none, none),
        setpoints=Setpoints(*(empty,) * 5),
        events=(
            LogEvent(START_S, parse_text(6, f"SystemID Starting: {description}")),
            LogEvent(STOP_S, TestEnded(StopReason.COMPLETE)),
        ),
        parameters={},
        duct=DuctAngles(*(empty,) * 3),
    )


@pytest.mark.parametrize(
    ("description", "expected"),
    [
        ("axis=12 wave=3211 magnitude=5.00", [("yaw", "3211", 5.0)]),
        ("axis=112 wave=prbs magnitude=-4.00", [("yaw", "prbs", -4.0)]),
        ("axis=111 wave=square magnitude=1.50", [("pitch", "square", 1.5)]),
        (
            "axis=23 wave=multisine magnitude=5.00 elevator=1.50",
            [("yaw", "multisine", 5.0), ("pitch", "multisine", 1.5)],
        ),
        (
            "axis=123 wave=multisine magnitude=4.00 elevator=-2.00",
            [("yaw", "multisine", 4.0), ("pitch", "multisine", -2.0)],
        ),
        ("axis=13 wave=step magnitude=12.00", []),
        ("axis=10 wave=chirp magnitude=12.00", []),
    ],
)
def test_cut_runs_gives_a_run_for_each_plane(
    description: str, expected: list[tuple[str, str, float]]
) -> None:
    assert [(run.plane, run.wave, run.magnitude_deg) for run in cut(description)] == expected


def test_cut_runs_dual_test_has_own_commands() -> None:
    yaw, pitch = cut("axis=23 wave=multisine magnitude=5.00 elevator=1.50")
    assert np.array_equal(yaw.time_s, pitch.time_s)
    assert math.degrees(yaw.command_rad[-10]) == pytest.approx(RUDDER_DEG)
    assert math.degrees(pitch.command_rad[-10]) == pytest.approx(ELEVATOR_DEG)
    assert yaw.name != pitch.name


ROWS_AT_10_HZ_SD_S = math.sqrt((0.1**2 - 0.02**2) / 12.0)
"""A command changed at any time between two rows, of which a step of the grid is known."""


@pytest.mark.parametrize(
    ("log_hz", "parameters", "hold_s", "delay_sd_s"),
    [
        (50, {"HDG_REF_RATE": 5.0}, 0.02, 0.0),
        (50, {"SCHED_LOOP_RATE": 25.0}, 0.02, 0.0),
        (10, {"SCHED_LOOP_RATE": 400.0}, 0.0025, ROWS_AT_10_HZ_SD_S),
        (100, {}, 0.01, 0.0),
        (50, {}, 0.01, 0.01 / math.sqrt(12.0)),
        (
            10,
            {"SCHED_LOOP_RATE": 0.0},
            0.01,
            math.hypot(0.01 / math.sqrt(12.0), ROWS_AT_10_HZ_SD_S),
        ),
    ],
)
def test_command_is_held_for_the_time_that_the_log_tells(
    log_hz: int, parameters: dict[str, float], hold_s: float, delay_sd_s: float
) -> None:
    """A command that grows with time, held for ``hold_s``: its mean over a step of the grid."""
    log = log_of("axis=12 wave=chirp magnitude=5.00")
    time_s = np.arange(0.0, 40.0, 1.0 / log_hz)
    actuators = Actuators(time_s, 0.01 * time_s, 0.0 * time_s, 0.0 * time_s)
    (run,) = segments.cut_runs(replace(log, actuators=actuators, parameters=parameters))
    mean_s = START_S + run.time_s + 0.5 * (0.02 - hold_s)
    np.testing.assert_allclose(run.command_rad, 0.01 * mean_s, rtol=0.0, atol=1e-12)
    assert run.delay_sd_s == pytest.approx(delay_sd_s)
