"""The joint estimate of both planes: maximum a posteriori on residuals whitened by a noise model estimated with it."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, least_squares

from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.model import Model
from sysid import greybox, noise, parameters, planes
from sysid.greybox import Start
from sysid.noise import Filter, Noise
from sysid.parameters import NAMES, PARAMETERS, Vehicle
from sysid.planes import LinearPlane
from sysid.runs import RATE_HZ, Plane, Run

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]
"""Called with what is being done and the share of the work that is behind, 0..1."""

STRIDE = 5
"""Samples of the 50 Hz grid in one step of the fit: 10 Hz, five times above anything the vehicle does."""
PASSES = 3
"""Outer iterations: noise from residuals, then parameters under that noise."""
OTHER_STARTS = 2
COARSE = 1e-3
"""Relative cost change that ends a pass whose noise levels are about to be renewed."""
Z_LIMIT = 4.0
"""Bounds, in prior standard deviations."""
DIFFERENCE = 1e-4
"""Forward step of the sensitivities, in prior standard deviations."""
AGREEMENT = 0.01
"""Relative cost by which other starts may differ from the best."""


class Prior(NamedTuple):
    """Belief before the data: z is normal with ``mean`` and ``covariance``."""

    config: VehicleConfig
    biases_rad: dict[Plane, float]
    mean: Array
    covariance: Array


class Experiment(NamedTuple):
    """One run as the fit sees it."""

    run: Run
    start: Start
    measured: Array
    """(samples, outputs) at 10 Hz, each the mean of the samples around it: rate, angle, and depth in pitch."""


class Fit(NamedTuple):
    z: Array
    covariance: Array
    """Of z, from the whitened information and the prior."""
    data_information: Array
    """Of z, from the data alone."""
    vehicle: Vehicle
    noise: dict[Plane, Noise]
    experiments: dict[Plane, tuple[Experiment, ...]]
    cost: float
    start_costs: tuple[float, ...]
    """Costs at which the other starts ended."""
    at_bounds: tuple[str, ...]
    evaluations: int


def experiment(run: Run) -> Experiment:
    columns = [run.rate_radps, run.heading_rad if run.plane == "yaw" else run.pitch_rad]
    if run.plane == "pitch":
        columns.append(run.depth_m)
    return Experiment(run, greybox.measured_start(run), np.column_stack([_decimate(c) for c in columns]))


def _decimate(values: Array) -> Array:
    """Centred means of STRIDE samples at every STRIDE-th sample; the ends repeat what they have."""
    padded = np.pad(values, STRIDE // 2, mode="edge")
    return np.convolve(padded, np.full(STRIDE, 1.0 / STRIDE), mode="valid")[::STRIDE]


def linear_plane(vehicle: Vehicle, plane: Plane) -> LinearPlane:
    """Small-signal plane of a candidate at its operating point."""
    config = vehicle.config
    c, speed, mass = parameters.short(config.linear), config.operating_point.speed_mps, config.ballast.mass_kg
    if plane == "yaw":
        return planes.yaw_plane(c, speed, mass)
    return planes.pitch_plane(c, speed, mass, config.water.gravity_mps2)


def cruise_speed_mps(vehicle: Vehicle, thrust: float) -> float:
    """Steady straight speed at a thrust (fraction of full), at least a crawl."""
    model, rps = vehicle.model, thrust * vehicle.model.propeller.full_rps

    def surge(u: float) -> float:
        return float(greybox.accelerations(model, "yaw", np.array([u, 0.0, 0.0, 0.0, 0.0]), 0.0, rps)[0])

    slowest, fastest = 0.1, 5.0
    if surge(slowest) <= 0.0:
        return slowest
    return float(brentq(surge, slowest, fastest, xtol=1e-9))


def residuals(vehicle: Vehicle, experiments: Sequence[Experiment]) -> list[Array]:
    """Measured less simulated of each run, (samples, outputs)."""
    thrusts = {float(e.run.thrust[0]) for e in experiments}
    speeds_mps = {thrust: cruise_speed_mps(vehicle, thrust) for thrust in thrusts}
    return [_residual(vehicle, e, speeds_mps[float(e.run.thrust[0])]) for e in experiments]


def _residual(vehicle: Vehicle, what: Experiment, speed_mps: float) -> Array:
    actuator = vehicle.actuators[what.run.plane]
    motion = greybox.simulate(vehicle.model, actuator, what.run, what.start, STRIDE, speed_mps)
    columns = [motion.rate_radps, motion.angle_rad]
    if what.run.plane == "pitch":
        columns.append(motion.depth_m)
    return what.measured - np.column_stack(columns)


def trim_biases(config: VehicleConfig, model: Model, runs: Sequence[Run]) -> dict[Plane, float]:
    """Actuator biases that make the prior vehicle balance where the measured one did: what a trim flight tells.

    Before each test the loops hold the vehicle straight and level; their mean command plus the bias is the angle at
    which the prior vehicle balances (zero for the rudder).
    """
    held: dict[Plane, list[float]] = {"yaw": [], "pitch": []}
    for run in runs:
        if run.preroll.any():
            held["yaw"].append(float(np.mean(run.rudder_rad[run.preroll])))
            held["pitch"].append(float(np.mean(run.elevator_rad[run.preroll])))
    level = level_elevator_rad(config, model)
    commands = {plane: float(np.median(values)) if values else 0.0 for plane, values in held.items()}
    return {"yaw": -commands["yaw"], "pitch": level - commands["pitch"]}


def level_elevator_rad(config: VehicleConfig, model: Model) -> float:
    """Elevator at which the vehicle flies straight at constant depth, from its own nonlinear equations."""
    return float(_level_flight(config, model)[1])


def level_pitch_rad(config: VehicleConfig, model: Model) -> float:
    """Pitch (positive nose up) at which the vehicle flies straight at constant depth."""
    return float(_level_flight(config, model)[0])


def _level_flight(config: VehicleConfig, model: Model) -> Array:
    """(pitch nose up, elevator) of level flight at the operating point, from heave and pitch moment."""
    from scipy.optimize import fsolve

    speed = config.operating_point.speed_mps
    rps = config.operating_point.thrust_fraction * model.propeller.full_rps

    def unbalanced(x: Array) -> Array:
        theta, elevator = -float(x[0]), float(x[1])
        u, w = speed * math.cos(theta), speed * math.sin(theta)
        state = np.array([u, w, 0.0, theta, greybox.SUBMERGED_Z_M])
        return greybox.accelerations(model, "pitch", state, elevator, rps)[1:]

    return np.asarray(fsolve(unbalanced, np.zeros(2), xtol=1e-12))


def fit(runs: Sequence[Run], prior: Prior, progress: Progress | None = None) -> Fit:
    """Estimate z from ``runs`` (at least one).

    Raises:
        ValueError: there is no run.
    """
    if not runs:
        raise ValueError("no run is left to fit; record rudder or elevator tests, or relax the screening")
    report = progress or (lambda what, share: None)
    experiments = {plane: tuple(experiment(r) for r in runs if r.plane == plane) for plane in ("yaw", "pitch")}
    problem = _Problem(prior, {plane: e for plane, e in experiments.items() if e})  # type: ignore[misc]
    z, steps = prior.mean.copy(), PASSES + OTHER_STARTS
    levels: dict[Plane, Noise] = {plane: Noise() for plane in problem.experiments}
    for number in range(PASSES):
        report(f"fit, pass {number + 1} of {PASSES}", number / steps)
        problem.refilter(z, levels)
        z = problem.solve(z, ftol=COARSE)
        levels = problem.estimate_noise(z, levels)
    problem.refilter(z, levels)
    z = problem.solve(z)
    best = problem.cost(z)
    others = []
    for number, start in enumerate(_other_starts(prior)):
        report(f"fit, other start {number + 1} of {OTHER_STARTS}", (PASSES + number) / steps)
        end = problem.solve(start, ftol=COARSE)
        others.append(problem.cost(end))
        if others[-1] < best * (1.0 - AGREEMENT):
            z = problem.solve(end)
            best = problem.cost(z)
    report("fit", 1.0)
    jacobian = problem.data_jacobian(z)
    information = jacobian.T @ jacobian
    return Fit(
        z=z,
        covariance=np.linalg.inv(information + np.linalg.inv(prior.covariance)),
        data_information=information,
        vehicle=problem.vehicle(z),
        noise=levels,
        experiments=problem.experiments,
        cost=best,
        start_costs=tuple(others),
        at_bounds=tuple(n for n, value in zip(NAMES, z, strict=True) if abs(value) > 0.99 * Z_LIMIT),
        evaluations=problem.evaluations,
    )


def _other_starts(prior: Prior) -> list[Array]:
    """Draws from the prior, the same on every machine."""
    generator = np.random.default_rng(4154)
    spread = np.linalg.cholesky(prior.covariance)
    draws = generator.standard_normal((OTHER_STARTS, len(NAMES)))
    return [np.clip(prior.mean + spread @ draw, -0.9 * Z_LIMIT, 0.9 * Z_LIMIT) for draw in draws]


class _Problem:
    """Whitened residuals and their sensitivities under the current filters."""

    def __init__(self, prior: Prior, experiments: dict[Plane, tuple[Experiment, ...]]) -> None:
        self.prior, self.experiments = prior, experiments
        self.evaluations = 0
        self._prior_root = np.linalg.inv(np.linalg.cholesky(prior.covariance))
        self._filters: dict[Plane, Filter] = {}
        self._samples = {plane: max(len(e.measured) for e in group) for plane, group in experiments.items()}

    def vehicle(self, z: Array) -> Vehicle:
        return parameters.vehicle(self.prior.config, self.prior.biases_rad, z)

    def refilter(self, z: Array, levels: dict[Plane, Noise]) -> None:
        """Linearise the noise filters about z."""
        vehicle = self.vehicle(z)
        for plane in self.experiments:
            self._filters[plane] = noise.build(
                linear_plane(vehicle, plane), levels[plane], STRIDE / RATE_HZ, self._samples[plane]
            )

    def estimate_noise(self, z: Array, levels: dict[Plane, Noise]) -> dict[Plane, Noise]:
        vehicle = self.vehicle(z)
        return {
            plane: noise.estimate(
                linear_plane(vehicle, plane), residuals(vehicle, group), STRIDE / RATE_HZ, levels[plane]
            )
            for plane, group in self.experiments.items()
        }

    def solve(self, z: Array, ftol: float = 1e-7) -> Array:
        found = least_squares(
            self._stacked, z, jac=self._stacked_jacobian, bounds=(-Z_LIMIT, Z_LIMIT), ftol=ftol, xtol=1e-6, max_nfev=60
        )
        return np.asarray(found.x)

    def cost(self, z: Array) -> float:
        return 0.5 * float(np.sum(self._stacked(z) ** 2))

    def data_jacobian(self, z: Array) -> Array:
        base = {plane: self._whitened(self.vehicle(z), plane) for plane in self.experiments}
        columns = []
        for i, parameter in enumerate(PARAMETERS):
            moved = z.copy()
            moved[i] += DIFFERENCE
            vehicle = self.vehicle(moved)
            moves = [
                self._whitened(vehicle, plane) - white if plane in parameter.planes else np.zeros_like(white)
                for plane, white in base.items()
            ]
            columns.append(np.concatenate(moves) / DIFFERENCE)
        return np.column_stack(columns)

    def _whitened(self, vehicle: Vehicle, plane: Plane) -> Array:
        self.evaluations += 1
        by = self._filters[plane]
        return np.concatenate([noise.whitened(e, by).ravel() for e in residuals(vehicle, self.experiments[plane])])

    def _stacked(self, z: Array) -> Array:
        vehicle = self.vehicle(z)
        white = [self._whitened(vehicle, plane) for plane in self.experiments]
        return np.concatenate([*white, self._prior_root @ (z - self.prior.mean)])

    def _stacked_jacobian(self, z: Array) -> Array:
        return np.vstack([self.data_jacobian(z), self._prior_root])
