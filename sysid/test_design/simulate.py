"""Test signals as the autopilot generates them, and the run that a log would contain."""

import math
from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.control import waveforms
from sysid.data.events import StopReason
from sysid.data.runs import RATE_HZ, Run
from sysid.planes import PLANES, Plane

Array = NDArray[np.float64]

LEAD_S = 5.0
"""Length of straight flight before a test in a simulated run (s)."""
DEPTH_M = 10.0
"""Depth of simulated tests."""
Wave = Literal["step", "doublet", "3211", "chirp", "multisine", "prbs", "square"]
"""Test signals by the names in missions and logs."""


class Manoeuvre(NamedTuple):
    """A test of one surface, from trim with the loop off, or added to the loop's command."""

    plane: Plane
    wave: Wave
    size_deg: float
    duration_s: int
    start_hz: float = 0.0
    stop_hz: float = 0.0
    """Upper end of the band of a chirp or multisine, or clock of a pseudo-random sequence (Hz)."""
    seed: int = 0
    runs: tuple[int, ...] = ()
    """Switch intervals of a square wave."""
    loop_on: bool = False
    elevator_deg: float = 0.0
    """Elevator size (deg) of a multisine of both surfaces.

    For such a test `plane` is yaw and `size_deg` the rudder's size.
    """
    comb: tuple[int, int] = (0, 1)
    """Index and number of the disjoint sets of a multisine's tones."""

    @property
    def surface(self) -> str:
        """Return the surface under test: rudder, elevator or both."""
        return "both" if self.elevator_deg else PLANES[self.plane].surface

    @property
    def halves(self) -> tuple["Manoeuvre", ...]:
        """Return the test of each moving surface; their multisines have no tone in common."""
        if not self.elevator_deg:
            return (self,)
        alone = self._replace(elevator_deg=0.0)
        elevator = alone._replace(plane=Plane.PITCH, size_deg=self.elevator_deg, comb=(1, 2))
        return alone._replace(comb=(0, 2)), elevator

    @property
    def planes(self) -> tuple[Plane, ...]:
        """Return the tested planes."""
        return tuple(half.plane for half in self.halves)

    @property
    def mirrored(self) -> "Manoeuvre":
        """Return the test with opposite sign."""
        return self._replace(size_deg=-self.size_deg, elevator_deg=-self.elevator_deg)


class SimulatedLevelFlight(NamedTuple):
    """Straight level flight: surface, propeller and attitude."""

    trim_rad: float
    """Angle of the surface under test (rad)."""
    thrust: float
    speed_mps: float
    pitch_rad: float


def signal_rad(manoeuvre: Manoeuvre) -> Array:
    """Return the test's part of the command.

    Parameters
    ----------
    manoeuvre : Manoeuvre
        Signal, size and duration of the test.

    Returns
    -------
    ndarray
        Angle on the grid of a run, in radians; the last sample is zero.
    """
    return math.radians(manoeuvre.size_deg) * _shape(
        manoeuvre._replace(size_deg=1.0, loop_on=False)
    )


@lru_cache(maxsize=512)
def _shape(manoeuvre: Manoeuvre) -> Array:
    """Return the signal of unit size."""
    ticks = int(manoeuvre.duration_s * RATE_HZ)
    return np.array([*(_value(manoeuvre, k / RATE_HZ) for k in range(ticks)), 0.0])


def _value(m: Manoeuvre, t_s: float) -> float:
    """Return the waveform in [-1, 1], as in ``autopilot.control.waveforms``."""
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


def as_run(manoeuvre: Manoeuvre, trim: SimulatedLevelFlight, command_from_trim_rad: Array) -> Run:
    """Return the run of a test from straight level flight; measurements are those of level flight.

    Parameters
    ----------
    manoeuvre : Manoeuvre
        Test.
    trim : SimulatedLevelFlight
        Level flight before the test.
    command_from_trim_rad : ndarray
        Command relative to trim (rad): the signal, with the loop on plus its feedback.

    Returns
    -------
    Run
        With `LEAD_S` of level flight before the test.
    """
    lead_samples = int(LEAD_S * RATE_HZ)
    samples = lead_samples + command_from_trim_rad.size
    command = np.full(samples, trim.trim_rad)
    command[lead_samples:] += command_from_trim_rad
    zeros = np.zeros(samples)
    other = PLANES[manoeuvre.plane].other
    commands = {manoeuvre.plane: command, other: zeros}
    trims_rad = {manoeuvre.plane: trim.trim_rad, other: 0.0}
    return Run(
        name=manoeuvre.wave,
        plane=manoeuvre.plane,
        wave=manoeuvre.wave,
        magnitude_deg=manoeuvre.size_deg,
        time_s=(np.arange(samples) - lead_samples) / RATE_HZ,
        rudder_rad=commands[Plane.YAW],
        elevator_rad=commands[Plane.PITCH],
        thrust=np.full(samples, trim.thrust),
        p_radps=zeros,
        q_radps=zeros,
        r_radps=zeros,
        roll_rad=zeros,
        pitch_rad=np.full(samples, trim.pitch_rad),
        heading_rad=zeros,
        depth_m=np.full(samples, DEPTH_M),
        stop_reason=StopReason.COMPLETE,
        longest_gap_s=1.0 / RATE_HZ,
        rudder_trim_rad=trims_rad[Plane.YAW],
        elevator_trim_rad=trims_rad[Plane.PITCH],
    )
