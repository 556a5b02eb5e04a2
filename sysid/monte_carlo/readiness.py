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
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.control import params
from mavlink_io.mission_items import MissionItem
from sitl.vehicle.config import VehicleConfig
from sysid.control_analysis.loop_transfer import Gains
from sysid.data import segments
from sysid.data.events import StopReason
from sysid.data.runs import Run
from sysid.models import prediction
from sysid.models.noise import Noise
from sysid.models.parameters import CandidateVehicle
from sysid.monte_carlo import samples, simulate
from sysid.monte_carlo.simulate import MissionRejectedError, Sea, SimulatedDive
from sysid.planes import PLANES, Plane
from sysid.screening import Screening, screen
from sysid.test_design import prior as design_priors
from sysid.test_design import vehicle_scale
from sysid.validation import crossover, frequency_response
from sysid.validation.acceptance import COHERENCE
from sysid.validation.crossover import UncertainVehicle
from sysid.validation.frequency_response import Pair
from sysid.validation.validate import OCTAVE

Items = tuple[MissionItem, ...]

FREQUENCIES = 20
"""Number of frequencies about crossover for the coherence, as in the model assessment."""
UNSTEADY, SATURATION = "unsteady start", "saturation"
"""Rules of the screening: the test began in a manoeuvre; a surface was at its stops."""
MIN_DEPTH_SHARE, MIN_LIMIT_SHARE = 0.5, 0.95
"""Smallest share of the commanded depth that a dive reaches, and share of the largest pitch and of
the travel from which on a command counts as the largest."""
MAX_TIME_AT_LIMITS = 0.5
"""Share of an unfinished dive with full commands above which the vehicle counts as too buoyant."""
KEPT_DIVES = 24
"""Number of the latest dives that are kept: several checks use the same ones."""
MIN_STEP_S = 4.5
"""Duration (s) after which a limit may end a step; screening rejects tests of less than 3 s."""


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
    is_afloat: bool = False
    """Whether the vehicle stays at the surface in this mission."""
    is_failsafe: bool = False
    """Whether a failsafe ends this mission."""


class SimulatedTest(NamedTuple):
    """Outcome of one simulated test."""

    too_large: bool
    """True if a limit ended it before `MIN_STEP_S`, or ended a sweep, or a surface saturated."""
    unsettled: bool
    """True if the motion before the test is that of a manoeuvre."""


class Readiness:
    """Simulated missions of the vehicle of the prior's mean.

    Parameters
    ----------
    prior : VehicleConfig
        Vehicle file.
    gains : Gains
        Parameters of the first dive, by name; trims are those of the prior.
    moments : Moments
        Disturbing moments of the scenario.
    seed : int
        Seed of disturbance and sensor noise.
    """

    def __init__(self, prior: VehicleConfig, gains: Gains, moments: Moments, seed: int) -> None:
        design_prior = design_priors.from_file(prior)
        vehicle = design_prior.vehicle(design_prior.mean)
        self._vehicle, self._levels = vehicle, noise_levels(vehicle, moments)
        self._config = params.config({**gains, **samples.trims_deg(vehicle)})
        self._gains, self._seed = gains, seed
        self._fly = lru_cache(KEPT_DIVES)(self._simulate)

    def fly(self, items: Items, disturbance: float = 1.0) -> SimulatedDive:
        """Simulate one mission.

        Parameters
        ----------
        items : tuple of MissionItem
            Mission.
        disturbance : float
            Factor on the disturbance.

        Returns
        -------
        SimulatedDive
            Log and outcome.

        Raises
        ------
        MissionRejectedError
            The autopilot rejects the mission.
        """
        return self._fly(items, disturbance)

    def _simulate(self, items: Items, disturbance: float) -> SimulatedDive:
        """Simulate one mission: the same items and disturbance give the same dive."""
        condition = Sea(disturbance)
        return simulate.fly(
            self._vehicle, self._levels, items, self._config, condition, (self._seed,)
        )

    def obstacle(self, name: str, dive: SimulatedDive) -> Obstacle | None:
        """Return the reason why a simulated mission failed.

        Parameters
        ----------
        name : str
            Name of the mission.
        dive : SimulatedDive
            Simulated mission.

        Returns
        -------
        Obstacle or None
            None if the mission was completed.
        """
        if dive.failsafe:
            outcome = f"it ends with the failsafe {dive.failsafe!r}"
            reason = f"{outcome}; {self.describe_disturbance()}"
            return Obstacle(name, reason, is_failsafe=True)
        if self.stays_afloat(dive):
            reached_m, asked_m = _depths_m(dive)
            depths = f"it reaches {reached_m:.1f} of {asked_m:.1f} m"
            return Obstacle(name, f"{depths}: {self._too_weak(dive)}", is_afloat=True)
        if not dive.finished:
            weak = np.mean(self._is_at_limits(dive)) > MAX_TIME_AT_LIMITS
            reason = self._too_buoyant() if weak else self.describe_disturbance()
            return Obstacle(name, f"it does not end within its time; {reason}")
        return None

    def stays_afloat(self, dive: SimulatedDive) -> bool:
        """Return whether the vehicle does not leave the surface for its depth.

        Parameters
        ----------
        dive : SimulatedDive
            Simulated mission.

        Returns
        -------
        bool
            Whether the largest true depth is below MIN_DEPTH_SHARE of the largest set-point.
        """
        reached_m, asked_m = _depths_m(dive)
        return reached_m < MIN_DEPTH_SHARE * asked_m

    def _too_weak(self, dive: SimulatedDive) -> str:
        """Return why a vehicle stays at the surface: it is too buoyant, or its gains are small.

        Gains that suffice command the largest pitch or elevator.
        """
        if np.any(self._is_at_limits(dive)):
            return self._too_buoyant()
        pitch_rad = -float(np.min(dive.log.setpoints.pitch_rad, initial=0.0))
        return (
            f"the gains of the first dive command {math.degrees(pitch_rad):.1f} deg of pitch at"
            " most; a faster tailcone, or one that was measured (`ground bench-test`), permits"
            " larger gains"
        )

    def _is_at_limits(self, dive: SimulatedDive) -> NDArray[np.bool_]:
        """Return for each sample whether the largest pitch down or elevator is commanded."""
        pitch_share = -dive.log.setpoints.pitch_rad / self._config.pitch_limit_rad
        elevator_share = np.abs(dive.log.actuators.elevator_rad) / self._config.travel_rad
        return np.asarray(np.maximum(pitch_share, elevator_share) >= MIN_LIMIT_SHARE)

    def _too_buoyant(self) -> str:
        """Return why a vehicle does not dive, or not as deep as commanded, with full commands."""
        return (
            "the vehicle cannot dive against its buoyancy of"
            f" {self._vehicle.config.ballast.net_buoyancy_n:.3g} N; less buoyancy, more speed or a"
            " larger elevator is needed"
        )

    def coherence(
        self, plane: Plane, missions: Mapping[str, Items], dives: Mapping[str, SimulatedDive]
    ) -> float | None:
        """Return the smallest coherence of the rate about crossover.

        Parameters
        ----------
        plane : Plane
            Plane of the tests.
        missions : Mapping
            Mission items by name.
        dives : Mapping
            The same missions, simulated with disturbance.

        Returns
        -------
        float or None
            None without a sweep of the plane in both dives.
        """
        sweeps_of = {name: _sweeps(dive) for name, dive in dives.items()}
        tested_missions = [
            name for name, sweeps in sweeps_of.items() if any(run.plane == plane for run in sweeps)
        ]
        loop = crossover.at_crossover(_uncertain_vehicle(self._vehicle), plane, self._gains)
        if not tested_missions or loop is None:
            return None
        pairs: list[Pair] = []
        for name in tested_missions:
            calm = self.fly(missions[name], disturbance=0.0)
            pairs += _pairs(_sweeps(calm), sweeps_of[name], plane)
        if not pairs:
            return None
        low, high = (share * loop.margins.crossover_radps for share in OCTAVE)
        response = frequency_response.spectra(pairs, np.geomspace(low, high, FREQUENCIES))
        return float(np.min(response.coherence))

    def outcomes_of_tests(self, dive: SimulatedDive) -> list[SimulatedTest]:
        """Return the outcomes of the tests of a simulated dive.

        Parameters
        ----------
        dive : SimulatedDive
            Simulated mission.

        Returns
        -------
        list of SimulatedTest
            One outcome per test that was begun, in the order of time.
        """
        return [
            SimulatedTest(
                too_large=_ended_early(item.run) or _has_reason(item, SATURATION),
                unsettled=_has_reason(item, UNSTEADY),
            )
            for item in screen(segments.cut_runs(dive.log))
        ]

    def describe_disturbance(self) -> str:
        """Return the size of the disturbance as text."""
        yaw = self._levels[Plane.YAW]
        rms = math.degrees(math.hypot(yaw.slow_radps2, yaw.wave_radps2))
        return f"the scenario's moments accelerate this vehicle by {rms:.2g} deg/s² rms in yaw"


def _depths_m(dive: SimulatedDive) -> tuple[float, float]:
    """Return the largest true depth and the largest commanded one."""
    return (
        float(np.max(dive.true_depth_m, initial=0.0)),
        float(np.max(dive.log.setpoints.depth_m, initial=0.0)),
    )


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
    levels: dict[Plane, Noise] = {}
    for plane in Plane:
        response = vehicle_scale.inverse_inertia(vehicle, plane)
        levels[plane] = Noise(
            slow_radps2=moments.slow_nm[plane] * response,
            slow_time_s=moments.slow_time_s,
            wave_radps2=moments.wave_nm[plane] * response,
            wave_frequency_hz=moments.wave_frequency_hz,
            wave_damping=moments.wave_damping,
        )
    return levels


def find_obstacle(check: Readiness, missions: Mapping[str, Items]) -> Obstacle | None:
    """Return the first reason why this vehicle cannot complete the missions, or None.

    Parameters
    ----------
    check : Readiness
        Vehicle, gains and disturbance.
    missions : Mapping
        Mission items by the mission's name, in the order of the dives.

    Returns
    -------
    Obstacle or None
        Mission or test with the reason.
    """
    dives: dict[str, SimulatedDive] = {}
    for name, items in missions.items():
        try:
            dives[name] = check.fly(items)
        except MissionRejectedError as error:
            return Obstacle(name, f"the autopilot refuses the mission ({error})")
        if obstacle := check.obstacle(name, dives[name]):
            return obstacle
    for plane in Plane:
        coherence = check.coherence(plane, missions, dives)
        if coherence is not None and coherence < COHERENCE:
            return Obstacle(
                f"{PLANES[plane].surface} tests",
                f"the disturbance masks them: coherence about crossover {coherence:.2f}, "
                f"at least {COHERENCE:g} needed; {check.describe_disturbance()}; a calmer scenario"
                " may do",
            )
    return None


def _ended_early(run: Run) -> bool:
    """Return whether a limit ended a sweep, or a step before `MIN_STEP_S`."""
    if run.stop_reason == StopReason.COMPLETE:
        return False
    return run.wave not in frequency_response.NARROWBAND_WAVES or run.time_s[-1] < MIN_STEP_S


def _has_reason(screening: Screening, rule: str) -> bool:
    """Return whether a rule of the screening rejects a run."""
    return any(reason.startswith(rule) for reason in screening.reasons)


def _uncertain_vehicle(vehicle: CandidateVehicle) -> UncertainVehicle:
    """Return a vehicle without uncertainty."""
    return UncertainVehicle(lambda z: vehicle, np.zeros(0), None)


def _sweeps(dive: SimulatedDive) -> list[Run]:
    """Return the broadband tests of a dive."""
    return [
        run
        for run in segments.cut_runs(dive.log)
        if run.wave not in frequency_response.NARROWBAND_WAVES
    ]


def _pairs(calm: Sequence[Run], disturbed: Sequence[Run], plane: Plane) -> Iterator[Pair]:
    """Yield the rates of the same tests without and with disturbance, from LEAD_S before each.

    A dive that ended with a failsafe has fewer tests than the other one.
    """
    for calm_run, disturbed_run in zip(calm, disturbed, strict=False):
        if calm_run.plane == plane:
            simulated, measured = (
                run.since(-prediction.LEAD_S).rate_radps for run in (calm_run, disturbed_run)
            )
            samples = min(simulated.size, measured.size)
            yield Pair(calm_run.name, simulated[:samples], measured[:samples])
