"""One test as the autopilot would play it, and the run that a log of it would give."""

import math
from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.control import waveforms
from sysid.data.segments import RATE_HZ, Plane, Run

Array = NDArray[np.float64]

LEAD_S = 5.0
"""Straight motion before a test that a simulated run begins with."""
Wave = Literal["step", "doublet", "3211", "chirp", "multisine", "prbs", "square"]
"""As missions and logs name them."""
SURFACE: dict[Plane, str] = {"yaw": "rudder", "pitch": "elevator"}


class Manoeuvre(NamedTuple):
    """A test of one surface: from trim with that plane's loop off, or added to what the loop asks
    for."""

    plane: Plane
    wave: Wave
    size_deg: float
    duration_s: int
    start_hz: float = 0.0
    stop_hz: float = 0.0
    """Band of a chirp or a multisine; the clock of a pseudo-random sequence."""
    seed: int = 0
    runs: tuple[int, ...] = ()
    loop_on: bool = False
    elevator_deg: float = 0.0
    """Of a multisine of both surfaces at once; its ``plane`` is yaw, its ``size_deg`` the
    rudder's."""
    comb: tuple[int, int] = (0, 1)
    """Which of how many sets of a multisine's tones, that have none in common."""

    @property
    def surface(self) -> str:
        return "both" if self.elevator_deg else SURFACE[self.plane]

    @property
    def halves(self) -> tuple["Manoeuvre", ...]:
        """What each surface that moves does: the rudder has every second tone, the elevator those
        between."""
        if not self.elevator_deg:
            return (self,)
        alone = self._replace(elevator_deg=0.0)
        elevator = alone._replace(plane="pitch", size_deg=self.elevator_deg, comb=(1, 2))
        return alone._replace(comb=(0, 2)), elevator

    @property
    def planes(self) -> tuple[Plane, ...]:
        return tuple(half.plane for half in self.halves)

    @property
    def mirrored(self) -> "Manoeuvre":
        return self._replace(size_deg=-self.size_deg, elevator_deg=-self.elevator_deg)


class LevelFlight(NamedTuple):
    """What the surfaces and the propeller do in straight level flight, and how the vehicle then
    lies."""

    trim_rad: float
    """Of the surface under test."""
    thrust: float
    speed_mps: float
    pitch_rad: float
    depth_m: float = 10.0


def signal_rad(manoeuvre: Manoeuvre) -> Array:
    """What the test adds to the command, from its start on the grid of a run; the last sample is
    its end."""
    return math.radians(manoeuvre.size_deg) * _shape(
        manoeuvre._replace(size_deg=1.0, loop_on=False)
    )


@lru_cache(maxsize=512)
def _shape(manoeuvre: Manoeuvre) -> Array:
    ticks = int(manoeuvre.duration_s * RATE_HZ)
    return np.array([*(_value(manoeuvre, k / RATE_HZ) for k in range(ticks)), 0.0])


def _value(m: Manoeuvre, t_s: float) -> float:
    """The wave in [-1, 1], as ``autopilot.excitation.play`` has it."""
    match m.wave:
        case "doublet":
            return waveforms.doublet(t_s, m.duration_s)
        case "3211":
            return waveforms.square(t_s, waveforms.THREE_TWO_ONE_ONE, m.duration_s)
        case "chirp":
            return waveforms.chirp(t_s, m.start_hz, m.stop_hz, m.duration_s)[0]
        case "multisine":
            return waveforms.multisine(
                t_s, waveforms.comb(m.start_hz, m.stop_hz, m.duration_s, *m.comb), m.duration_s
            )
        case "prbs":
            return waveforms.prbs(t_s, m.stop_hz, m.duration_s, m.seed)
        case "square":
            return waveforms.square(t_s, m.runs, m.duration_s)
    return 1.0


def as_run(manoeuvre: Manoeuvre, still: LevelFlight, away_rad: Array) -> Run:
    """The run of a test that begins in straight level flight, with nothing measured in it but that.

    ``away_rad`` is the command from trim: ``signal_rad``, and with the loop on its answer to it.
    """
    before = int(LEAD_S * RATE_HZ)
    n = before + away_rad.size
    command = np.full(n, still.trim_rad)
    command[before:] += away_rad
    zeros = np.zeros(n)
    yaws = manoeuvre.plane == "yaw"
    return Run(
        name=manoeuvre.wave,
        plane=manoeuvre.plane,
        wave=manoeuvre.wave,
        magnitude_deg=manoeuvre.size_deg,
        time_s=(np.arange(n) - before) / RATE_HZ,
        rudder_rad=command if yaws else zeros,
        elevator_rad=zeros if yaws else command,
        thrust=np.full(n, still.thrust),
        p_radps=zeros,
        q_radps=zeros,
        r_radps=zeros,
        roll_rad=zeros,
        pitch_rad=np.full(n, still.pitch_rad),
        heading_rad=zeros,
        depth_m=np.full(n, still.depth_m),
        stop_reason="",
        longest_gap_s=1.0 / RATE_HZ,
        rudder_trim_rad=still.trim_rad if yaws else 0.0,
        elevator_trim_rad=0.0 if yaws else still.trim_rad,
    )
