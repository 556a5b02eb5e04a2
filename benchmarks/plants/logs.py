"""Campaigns of a plant as CSV files: the standard missions, recorded with jitter and lost rows."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.plants import flight
from benchmarks.plants.catalogue import Plant
from benchmarks.plants.flight import TICK_S, Gains, Recorded, Test

Array = NDArray[np.float64]
Planned = tuple[str, float, float]
"""Signal, degrees for Caribou, seconds."""

SETTLE_S = 60.0
"""Time before the first test."""
STEPS: dict[bool, tuple[Planned, ...]] = {
    True: tuple(("step", size, 20.0) for size in (3.0, -3.0, 5.0, -5.0, 7.0, -7.0, 9.0, -12.0)),
    False: (
        *(("step", size, 8.0) for size in (2.0, 3.0, 4.0, 5.0, 7.0, 9.0)),
        ("step", 12.0, 6.0),
        ("step", 14.0, 6.0),
    ),
}
"""Missions rudder_steps and elevator_steps; True is the rudder."""
SWEEPS: dict[bool, tuple[Planned, ...]] = {
    True: (
        ("chirp", 4.0, 28.0),
        ("chirp", 7.0, 28.0),
        ("doublet", 5.0, 24.0),
        ("doublet", -5.0, 24.0),
    ),
    False: (
        ("chirp", 3.0, 25.0),
        ("chirp", 5.0, 25.0),
        ("doublet", 4.0, 10.0),
        ("doublet", 6.0, 8.0),
    ),
}
"""Missions rudder_sweeps and elevator_sweeps."""
HELD_OUT: dict[bool, tuple[Planned, ...]] = {
    True: (
        ("step", 2.5, 25.0),
        ("step", -4.0, 20.0),
        ("step", 6.0, 20.0),
        ("step", -8.0, 20.0),
        ("doublet", 4.0, 16.0),
        ("doublet", -6.0, 12.0),
        ("3211", 5.0, 14.0),
    ),
    False: (
        ("step", 2.5, 8.0),
        ("step", 4.5, 8.0),
        ("step", 6.0, 8.0),
        ("step", 8.0, 8.0),
        ("step", 10.0, 8.0),
        ("doublet", 3.0, 10.0),
        ("3211", 4.0, 14.0),
    ),
}
"""Missions rudder_heldout and elevator_heldout."""
MISSIONS = {"steps": STEPS, "sweeps": SWEEPS, "heldout": HELD_OUT}
RECOVERY_S = {"steps": 55.0, "sweeps": 35.0, "heldout": 55.0}
"""Time after each test."""
CHIRP_HZ = {True: (0.06, 0.35), False: (0.08, 0.4)}
DEPTH_HZ = 10.0
"""Rate of the depth sensor's samples."""


class TestScaling(NamedTuple):
    """Ratios of the tests of a surface to Caribou's."""

    step_size: float
    sweep_size: float
    """Size of chirps, doublets and 3-2-1-1."""
    time: float = 1.0
    """Duration of steps."""
    frequency: float = 1.0
    """Frequencies of the other tests, and inverse of their duration."""


def signal_rad(planned: Planned, rudder: bool, scaling: TestScaling, max_deg: float) -> Array:
    """Return the signal of a test at 50 Hz, of at most ``max_deg``."""
    kind, degrees, seconds = planned
    is_step = kind == "step"
    degrees *= scaling.step_size if is_step else scaling.sweep_size
    size = math.radians(min(max(degrees, -max_deg), max_deg))
    seconds *= scaling.time if is_step else 1.0 / scaling.frequency
    time_s = TICK_S * np.arange(int(seconds / TICK_S))
    if is_step:
        return np.full(time_s.size, size)
    if kind == "doublet":
        return np.where(time_s < 0.5 * seconds, size, -size)
    if kind == "3211":
        unit = 7.0 * time_s / seconds
        return np.asarray(size * np.where((unit < 3.0) | ((unit >= 5.0) & (unit < 6.0)), 1.0, -1.0))
    low, high = (scaling.frequency * limit for limit in CHIRP_HZ[rudder])
    growth = math.log(high / low) / seconds
    return np.asarray(size * np.sin(2.0 * math.pi * low * np.expm1(growth * time_s) / growth))


def fly(
    plant: Plant,
    mission: str,
    rudder: bool,
    *,
    scaling: TestScaling,
    gains: Gains,
    rng: np.random.Generator,
    level: float = 1.0,
    grip: float = 1.0,
) -> Recorded:
    """Fly one mission; test sizes are limited to 60 % of the travel."""
    now_s, tests = SETTLE_S, []
    most_deg = 0.6 * math.degrees(plant.travel_rad)
    for planned in MISSIONS[mission][rudder]:
        signal = signal_rad(planned, rudder, scaling, most_deg)
        tests.append(Test(rudder, now_s, signal))
        now_s += TICK_S * signal.size + RECOVERY_S[mission] * max(1.0, scaling.time)
    return flight.dive(plant, tests, now_s, gains, rng, level, grip)


def write_csv(
    path: Path, plant: Plant, recorded: Recorded, gains: Gains, rng: np.random.Generator
) -> None:
    """Write a log as docs/logs.md describes it, with the errors of the recorder."""
    sensors = plant.sensors
    every = max(1, round(1.0 / (sensors.rate_hz * TICK_S)))
    ticks = np.arange(0, len(recorded.rows), every)
    ticks = ticks[rng.random(ticks.size) >= sensors.dropped]
    jitter_s = np.clip(
        sensors.jitter_s * rng.standard_normal(ticks.size), -0.4 * TICK_S, 0.4 * TICK_S
    )
    time_s = np.round(100.0 + TICK_S * ticks + jitter_s, 4)
    rows, under = recorded.rows[ticks], recorded.under_test[ticks]
    degrees = np.degrees(rows[:, :9])
    degrees[:, 5] = np.mod(degrees[:, 5], 360.0)
    fresh = np.diff(np.floor(ticks * TICK_S * DEPTH_HZ + 1e-9), prepend=-1.0) > 0.0
    trims = np.degrees(plant.trim_command_rad)
    parameters = {
        "ACT_TRAVEL_DEG": math.degrees(plant.travel_rad),
        "TRIM_RUD_DEG": trims[0],
        "TRIM_ELE_DEG": trims[1],
        "HDG_P": gains.heading_p,
        "HDG_D": gains.heading_d,
        "HDG_I": gains.heading_i,
        "HDG_IMAX": 0.1,
        "PTCH_P": gains.pitch_p,
        "PTCH_D": gains.pitch_d,
        "PTCH_I": 0.0,
        "PTCH_IMAX": 0.0,
        "DPT_P": gains.depth_p,
        "DPT_D": 0.0,
        "DPT_I": gains.depth_i,
        "DPT_IMAX": 0.1,
    }
    names = "time_s,p_degps,q_degps,r_degps,roll_deg,pitch_deg,heading_deg,depth_m"
    names += ",rudder_deg,elevator_deg,thrust_pct,test"
    doppler = sensors.speed_noise_mps > 0.0
    lines = [f"# {name} = {value:.6g}" for name, value in parameters.items()]
    lines.append(names + (",u_mps" if doppler else ""))
    surface = ("", "rudder", "elevator")
    for k in range(ticks.size):
        angles = ",".join(f"{value:.2f}" for value in degrees[k, :6])
        depth = f"{rows[k, 6]:.3f}" if fresh[k] else ""
        commands = f"{degrees[k, 7]:.3f},{degrees[k, 8]:.3f},{plant.thrust_pct:g}"
        line = f"{time_s[k]:.4f},{angles},{depth},{commands},{surface[under[k]]}"
        if doppler:
            line += f",{rows[k, 9]:.3f}" if fresh[k] else ","
        lines.append(line)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def campaign(
    folder: Path,
    plant: Plant,
    *,
    scalings: tuple[TestScaling, TestScaling],
    gains: Gains,
    seed: int,
    level: float = 1.0,
    grip: float = 1.0,
) -> tuple[list[Path], list[Path]]:
    """Fly and record the standard campaign; return the logs to fit and those held out.

    ``scalings`` are those of rudder and elevator tests; ``level`` and ``grip`` are those of
    ``flight.dive``.
    """
    fitted, held_out = list[Path](), list[Path]()
    for number, (mission, rudder) in enumerate(
        (mission, rudder) for mission in MISSIONS for rudder in (True, False)
    ):
        rng = np.random.default_rng([seed, number])
        recorded = fly(
            plant,
            mission,
            rudder,
            scaling=scalings[0 if rudder else 1],
            gains=gains,
            rng=rng,
            level=level,
            grip=grip,
        )
        path = folder / f"{'rudder' if rudder else 'elevator'}_{mission}.csv"
        write_csv(path, plant, recorded, gains, rng)
        (held_out if mission == "heldout" else fitted).append(path)
    return fitted, held_out
