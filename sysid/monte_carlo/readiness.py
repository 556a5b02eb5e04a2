"""Check before a campaign's first dive: can the vehicle of the prior complete its missions?

Each mission is flown in process by the vehicle of the prior's mean, under the gains of the first
dive and the disturbing moments of the scenario, scaled with the vehicle's inertia. Currents, waves
of the water and faults of a scenario are left out. Nothing of the simulator's truth is used.

The tests are flown with and without the sea. The coherence of the two rates about crossover is
that of command and rate which the verdict asks for (Tischler and Remple 2006, section 7.5).
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.control import params
from autopilot.control.params import Config
from mavlink_io.mission_items import MissionItem
from sitl.vehicle.config import VehicleConfig
from sysid.control_analysis.loop_transfer import Gains
from sysid.data import segments
from sysid.data.segments import Plane, Run
from sysid.models import prediction
from sysid.models.noise import Noise
from sysid.models.parameters import CandidateVehicle
from sysid.monte_carlo import samples as crew
from sysid.monte_carlo import simulate as dive
from sysid.monte_carlo.disturbance import ACTS_ON
from sysid.monte_carlo.simulate import MissionRejectedError, Sea, SimulatedDive
from sysid.test_design import prior as beliefs
from sysid.test_design.simulate import SURFACE
from sysid.validation import crossover, frequency_response
from sysid.validation.acceptance import COHERENCE
from sysid.validation.crossover import UncertainVehicle
from sysid.validation.frequency_response import Pair
from sysid.validation.validate import OCTAVE

Array = NDArray[np.float64]
Items = tuple[MissionItem, ...]

PLANES: tuple[Plane, ...] = ("yaw", "pitch")
FREQUENCIES = 20
"""Number of frequencies about crossover at which the coherence is computed, as in the verdict."""


class Moments(NamedTuple):
    """Disturbing moments of a scenario, one standard deviation each: slow, and in the wave band."""

    slow_nm: Mapping[Plane, float]
    slow_time_s: float
    wave_nm: Mapping[Plane, float]
    wave_frequency_hz: float
    wave_damping: float


class Obstacle(NamedTuple):
    """Reason why a campaign cannot work."""

    where: str
    """Mission, or kind of test, that cannot be completed."""
    reason: str


class _Trial(NamedTuple):
    """Vehicle of the prior's mean, its parameters and the sea, for all missions alike."""

    vehicle: CandidateVehicle
    levels: dict[Plane, Noise]
    config: Config


def noise_levels(vehicle: CandidateVehicle, moments: Moments) -> dict[Plane, Noise]:
    """Return the disturbance of both planes as angular accelerations.

    Notes
    -----
    rms = moment (N m) x (M^-1)_ii, M the mass matrix with added mass, i the row of yaw or pitch.
    """
    inverse = np.linalg.inv(vehicle.model.inertia.M)
    levels: dict[Plane, Noise] = {}
    for plane in PLANES:
        row = ACTS_ON[plane][1]
        levels[plane] = Noise(
            slow_radps2=float(moments.slow_nm[plane] * inverse[row, row]),
            slow_time_s=moments.slow_time_s,
            wave_radps2=float(moments.wave_nm[plane] * inverse[row, row]),
            wave_frequency_hz=moments.wave_frequency_hz,
            wave_damping=moments.wave_damping,
        )
    return levels


def find_obstacle(
    prior: VehicleConfig, gains: Gains, moments: Moments, missions: Mapping[str, Items], seed: int
) -> Obstacle | None:
    """Return the first reason why this vehicle cannot complete the missions, or None.

    Parameters
    ----------
    prior: the vehicle file known beforehand.
    gains: parameters of the first dive, by name; trims are those of the prior.
    moments: the scenario's disturbance.
    missions: items by the mission's name, in the order of flying.
    seed: seed of the sea and the instruments.
    """
    belief = beliefs.from_file(prior)
    vehicle = belief.vehicle(belief.mean)
    aboard = params.config({**gains, **crew.trims_deg(vehicle)})
    rehearsal = _Trial(vehicle, noise_levels(vehicle, moments), aboard)
    flown: dict[str, SimulatedDive] = {}
    for name, items in missions.items():
        try:
            flown[name] = _simulate(rehearsal, items, Sea(), seed)
        except MissionRejectedError as error:
            return Obstacle(name, f"the autopilot refuses the mission ({error})")
        if flown[name].failsafe:
            cause = f"it ends with the failsafe {flown[name].failsafe!r}"
            return Obstacle(name, f"{cause}; {_sea_in_words(rehearsal)}")
        if not flown[name].finished:
            return Obstacle(name, f"it does not end within its time; {_sea_in_words(rehearsal)}")
    return _hidden_tests(rehearsal, gains, missions, flown, seed)


def _simulate(rehearsal: _Trial, items: Items, sea: Sea, seed: int) -> SimulatedDive:
    return dive.fly(rehearsal.vehicle, rehearsal.levels, items, rehearsal.config, sea, (seed,))


def _sea_in_words(rehearsal: _Trial) -> str:
    yaw = rehearsal.levels["yaw"]
    rms = math.degrees(math.hypot(yaw.slow_radps2, yaw.wave_radps2))
    return f"the scenario's moments accelerate this vehicle by {rms:.2g} deg/s² rms in yaw"


def _hidden_tests(
    rehearsal: _Trial,
    gains: Gains,
    missions: Mapping[str, Items],
    flown: Mapping[str, SimulatedDive],
    seed: int,
) -> Obstacle | None:
    """Return the tests that the sea hides: the verdict would refuse the model for coherence."""
    swept = {name: _sweeps(dive) for name, dive in flown.items()}
    for plane in PLANES:
        tested = [name for name, found in swept.items() if any(run.plane == plane for run in found)]
        crossed = crossover.crossover(_uncertain_vehicle(rehearsal.vehicle), plane, gains)
        if not tested or crossed is None:
            continue
        pairs: list[Pair] = []
        for name in tested:
            calm = _simulate(rehearsal, missions[name], Sea(0.0), seed)
            pairs += _pairs(_sweeps(calm), swept[name], plane)
        low, high = (share * crossed.crossover_radps for share in OCTAVE)
        found = frequency_response.spectra(pairs, np.geomspace(low, high, FREQUENCIES))
        coherence = float(np.min(found.coherence))
        if coherence < COHERENCE:
            return Obstacle(
                f"{SURFACE[plane]} tests",
                f"the sea hides them: coherence about crossover {coherence:.2f}, "
                f"at least {COHERENCE:g} needed; {_sea_in_words(rehearsal)}",
            )
    return None


def _uncertain_vehicle(vehicle: CandidateVehicle) -> UncertainVehicle:
    return UncertainVehicle(lambda z: vehicle, np.zeros(0), None)


def _sweeps(flown: SimulatedDive) -> list[Run]:
    """Tests of a dive that tell a response over frequency."""
    return [
        run
        for run in segments.cut_runs(flown.log)
        if run.wave not in frequency_response.NARROWBAND_WAVES
    ]


def _pairs(calm: Sequence[Run], disturbed: Sequence[Run], plane: Plane) -> Iterator[Pair]:
    """Rates of the same tests without and with the sea, from LEAD_S before to the earlier end."""
    for quiet, rough in zip(calm, disturbed, strict=True):
        if quiet.plane == plane:
            simulated, measured = (
                run.since(-prediction.LEAD_S).rate_radps for run in (quiet, rough)
            )
            samples = min(simulated.size, measured.size)
            yield Pair(quiet.name, simulated[:samples], measured[:samples])
