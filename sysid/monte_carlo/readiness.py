"""Check before a campaign's first dive whether the vehicle of the prior can complete its missions.

Each mission is simulated in process with the vehicle of the prior's mean, the gains of the first
dive and the disturbing moments of the scenario, scaled with the vehicle's inertia. Currents, waves
of the water and faults of a scenario are left out. The simulator's truth is not used.

The tests are simulated with and without disturbance. The coherence of the two rates about crossover
equals that of command and rate which the model assessment requires (Tischler and Remple 2006,
section 7.5).
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
from sysid.data.segments import Run
from sysid.models import prediction
from sysid.models.noise import Noise
from sysid.models.parameters import CandidateVehicle
from sysid.monte_carlo import samples, simulate
from sysid.monte_carlo.simulate import MissionRejectedError, Sea, SimulatedDive
from sysid.planes import PLANES, Plane
from sysid.test_design import prior as design_priors
from sysid.validation import crossover, frequency_response
from sysid.validation.acceptance import COHERENCE
from sysid.validation.crossover import UncertainVehicle
from sysid.validation.frequency_response import Pair
from sysid.validation.validate import OCTAVE

Array = NDArray[np.float64]
Items = tuple[MissionItem, ...]

FREQUENCIES = 20
"""Number of frequencies about crossover for the coherence, as in the model assessment."""


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


class _NominalVehicle(NamedTuple):
    """Vehicle of the prior's mean, its parameters and the disturbance for all missions."""

    vehicle: CandidateVehicle
    levels: dict[Plane, Noise]
    config: Config


def noise_levels(vehicle: CandidateVehicle, moments: Moments) -> dict[Plane, Noise]:
    """Return the disturbance of both planes as angular accelerations.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Vehicle with its mass matrix.
    moments : Moments
        Disturbing moments (N m).

    Returns
    -------
    dict
        Noise model of each plane, without sensor noise.

    Notes
    -----
    rms = moment (N m) x (M^-1)_ii, M the mass matrix with added mass, i the row of yaw or pitch.
    """
    inverse = np.linalg.inv(vehicle.model.inertia.M)
    levels: dict[Plane, Noise] = {}
    for plane in Plane:
        row = PLANES[plane].velocities[2]
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
    prior : VehicleConfig
        Vehicle file.
    gains : Gains
        Parameters of the first dive, by name; trims are those of the prior.
    moments : Moments
        Disturbing moments of the scenario.
    missions : Mapping
        Mission items by the mission's name, in the order of the dives.
    seed : int
        Seed of disturbance and sensor noise.

    Returns
    -------
    Obstacle or None
        Mission or test with the reason.
    """
    design_prior = design_priors.from_file(prior)
    vehicle = design_prior.vehicle(design_prior.mean)
    config = params.config({**gains, **samples.trims_deg(vehicle)})
    nominal = _NominalVehicle(vehicle, noise_levels(vehicle, moments), config)
    dives: dict[str, SimulatedDive] = {}
    for name, items in missions.items():
        try:
            dives[name] = _simulate(nominal, items, Sea(), seed)
        except MissionRejectedError as error:
            return Obstacle(name, f"the autopilot refuses the mission ({error})")
        if dives[name].failsafe:
            outcome = f"it ends with the failsafe {dives[name].failsafe!r}"
            return Obstacle(name, f"{outcome}; {_describe_disturbance(nominal)}")
        if not dives[name].finished:
            return Obstacle(
                name, f"it does not end within its time; {_describe_disturbance(nominal)}"
            )
    return _hidden_tests(nominal, gains, missions, dives, seed)


def _simulate(nominal: _NominalVehicle, items: Items, condition: Sea, seed: int) -> SimulatedDive:
    """Simulate one mission."""
    return simulate.fly(nominal.vehicle, nominal.levels, items, nominal.config, condition, (seed,))


def _describe_disturbance(nominal: _NominalVehicle) -> str:
    """Return the size of the disturbance as text."""
    yaw = nominal.levels[Plane.YAW]
    rms = math.degrees(math.hypot(yaw.slow_radps2, yaw.wave_radps2))
    return f"the scenario's moments accelerate this vehicle by {rms:.2g} deg/s² rms in yaw"


def _hidden_tests(
    nominal: _NominalVehicle,
    gains: Gains,
    missions: Mapping[str, Items],
    dives: Mapping[str, SimulatedDive],
    seed: int,
) -> Obstacle | None:
    """Return the tests whose coherence is too low because of the disturbance, or None."""
    sweeps_of = {name: _sweeps(dive) for name, dive in dives.items()}
    for plane in Plane:
        tested_missions = [
            name
            for name, response in sweeps_of.items()
            if any(run.plane == plane for run in response)
        ]
        feasible_crossover = crossover.crossover(_uncertain_vehicle(nominal.vehicle), plane, gains)
        if not tested_missions or feasible_crossover is None:
            continue
        pairs: list[Pair] = []
        for name in tested_missions:
            calm = _simulate(nominal, missions[name], Sea(0.0), seed)
            pairs += _pairs(_sweeps(calm), sweeps_of[name], plane)
        low, high = (share * feasible_crossover.crossover_radps for share in OCTAVE)
        response = frequency_response.spectra(pairs, np.geomspace(low, high, FREQUENCIES))
        coherence = float(np.min(response.coherence))
        if coherence < COHERENCE:
            return Obstacle(
                f"{PLANES[plane].surface} tests",
                f"the disturbance masks them: coherence about crossover {coherence:.2f}, "
                f"at least {COHERENCE:g} needed; {_describe_disturbance(nominal)}",
            )
    return None


def _uncertain_vehicle(vehicle: CandidateVehicle) -> UncertainVehicle:
    """Return a vehicle without uncertainty."""
    return UncertainVehicle(lambda z: vehicle, np.zeros(0), None)


def _sweeps(simulate: SimulatedDive) -> list[Run]:
    """Return the broadband tests of a dive."""
    return [
        run
        for run in segments.cut_runs(simulate.log)
        if run.wave not in frequency_response.NARROWBAND_WAVES
    ]


def _pairs(calm: Sequence[Run], disturbed: Sequence[Run], plane: Plane) -> Iterator[Pair]:
    """Yield the rates of the same tests without and with disturbance, from LEAD_S before each."""
    for calm_run, disturbed_run in zip(calm, disturbed, strict=True):
        if calm_run.plane == plane:
            simulated, measured = (
                run.since(-prediction.LEAD_S).rate_radps for run in (calm_run, disturbed_run)
            )
            samples = min(simulated.size, measured.size)
            yield Pair(calm_run.name, simulated[:samples], measured[:samples])
