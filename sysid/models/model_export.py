"""Make the model file from an estimate: derived quantities, standard deviations, and status."""

import math
from collections.abc import Collection

import msgspec
import numpy as np
from numpy.typing import NDArray

from sysid.estimation.map import bounds, steady_state
from sysid.estimation.map.convergence import DESIGN_NUMBERS, SearchCosts, failures
from sysid.estimation.map.fit import Fit
from sysid.estimation.map.gauss_newton import Z_LIMIT
from sysid.estimation.map.model_error import RANK_TOLERANCE
from sysid.estimation.map.problem import Prior
from sysid.models import delta_method, linear_planes, noise, parameters, prediction
from sysid.models.linear_planes import SmallSignal
from sysid.models.model_file import (
    FORMAT,
    MAX_POSTERIOR_TO_PRIOR_SD,
    Coefficient,
    Convergence,
    IdentifiedModel,
    Joint,
    NoiseModel,
    ParameterCovariance,
    ParameterEstimate,
    PlaneModel,
    Status,
    VehicleRecord,
)
from sysid.models.parameters import INERTIAS, NAMES, PARAMETERS
from sysid.planes import Plane
from sysid.reproduction.paper_method import FREE, PlaneFit
from sysid.reproduction.paper_tables import UNITS, Table1Column

Array = NDArray[np.float64]

MAX_ROUNDING = 1e-4
"""Relative difference of a number in a model file that versions of libraries may cause."""


def from_fit(fit: Fit, prior: Prior, prior_name: str) -> IdentifiedModel:
    """Return the model file of a maximum a posteriori estimate.

    Parameters
    ----------
    fit : Fit
        The estimate.
    prior : Prior
        Prior that was used for the estimate.
    prior_name : str
        Name or path of the prior vehicle file.

    Returns
    -------
    IdentifiedModel
        Content of ``model.json``, without data, screening and validation.

    Notes
    -----
    Standard deviations of derived values by the delta method, see `sysid.models.delta_method`.
    """

    def derive(z: Array) -> Array:
        return _derived(parameters.candidate_vehicle(prior.config, prior.biases_rad, z))

    values, slope = derive(fit.z), delta_method.slopes(derive, fit.z).T
    # Whether the data inform a number is decided without errors of the model structure.
    informed = np.linalg.inv(fit.data_information + np.linalg.inv(prior.covariance))
    before, after, spread = (
        slope @ covariance @ slope.T for covariance in (prior.covariance, informed, fit.covariance)
    )
    sds = np.sqrt(np.diag(spread))
    measured = set(fit.datasets)
    design_covariances = {
        p: (_design_covariance(p, before), _design_covariance(p, after))
        for p in Plane
        if p in measured
    }
    return IdentifiedModel(
        format=FORMAT,
        method="map",
        speed_mps=prior.config.operating_point.speed_mps,
        thrust_fraction=prior.config.operating_point.thrust_fraction,
        planes={
            p: _plane(p, dict(zip(_derived_names(), zip(values, sds, strict=True), strict=True)))
            for p in Plane
        },
        coefficients=_coefficients(fit, prior, measured),
        vehicle=_vehicle(fit, prior, prior_name),
        noise=_noise(fit),
        joint=_joint(fit),
        convergence=Convergence(
            cost=fit.cost,
            start_costs=fit.start_costs,
            agreed=SearchCosts(fit.cost, fit.start_costs).is_unique,
            at_bounds=fit.at_bounds,
            failures=failures(
                fit.cost, fit.start_costs, fit.at_bounds, design_covariances, fit.at_edge
            ),
        ),
        data=(),
        screening=(),
        fit_quality=(),
        held_out=(),
        notes=(*_notes(fit, prior, measured), *_at_limits(sds)),
        design={plane: _design_numbers_covariance(plane, spread) for plane in Plane},
    )


def _derived_names() -> list[tuple[Plane, str]]:
    """Return (plane, name) of the derived values, in the order of ``_derived``."""
    return [
        (plane, name)
        for plane in Plane
        for name in (*SmallSignal._fields, "delay_s", "actuator_bias_deg")
    ]


def _derived(vehicle: parameters.CandidateVehicle) -> Array:
    """Return the derived values of both planes: small-signal numbers, delay, bias (deg)."""
    rows: list[float] = []
    for plane in Plane:
        actuator = vehicle.actuators[plane]
        rows += linear_planes.small_signal(steady_state.linear_plane(vehicle, plane))
        rows += [actuator.delay_s, math.degrees(actuator.bias_rad)]
    return np.array(rows)


def derived_numbers(vehicle: parameters.CandidateVehicle) -> dict[tuple[Plane, str], float]:
    """Return the numbers of both planes that follow from a vehicle.

    Parameters
    ----------
    vehicle : CandidateVehicle
        The vehicle.

    Returns
    -------
    dict
        Fields of `SmallSignal`, delay (s) and bias (deg), by plane and name.
    """
    return dict(zip(_derived_names(), _derived(vehicle).tolist(), strict=True))


def edited_number(model: IdentifiedModel) -> str:
    """Return which number of a plane is not that of the vehicle in the model file.

    Parameters
    ----------
    model : IdentifiedModel
        Content of a model file. With another method than map the planes are the fit itself.

    Returns
    -------
    str
        Key, value and the number of the vehicle; empty if all agree.
    """
    if model.method != "map" or model.vehicle.file is None:
        return ""
    for (plane, name), right in derived_numbers(prediction.vehicles(model)[0]).items():
        known = getattr(model.planes[plane], name)
        if known is not None and not math.isclose(known.value, right, rel_tol=MAX_ROUNDING):
            return (
                f"planes.{plane}.{name}.value = {known.value:g}: vehicle.file and joint.z give"
                f" {right:g}; give a model.json that `ground refit` wrote, without changes"
            )
    return ""


def _at_limits(sds: Array) -> list[str]:
    """Return notes on delays at their lower limit of zero, which no parameter changes."""
    return [
        f"{plane}: {name} is at its limit of zero and has no standard deviation"
        for (plane, name), sd in zip(_derived_names(), sds, strict=True)
        if name == "delay_s" and sd == 0.0
    ]


def _design_covariance(plane: Plane, spread: Array) -> Array:
    """Return the covariance of one plane's DESIGN_NUMBERS."""
    index = [_derived_names().index((plane, name)) for name in DESIGN_NUMBERS]
    return spread[np.ix_(index, index)]


def _design_numbers_covariance(plane: Plane, spread: Array) -> ParameterCovariance:
    """Return the covariance of one plane's derived values; yaw has no restoring moment."""
    absent = set(SmallSignal._fields) - set(linear_planes.small_signal_names(plane))
    chosen = [
        (i, name)
        for i, (owner, name) in enumerate(_derived_names())
        if owner == plane and name not in absent
    ]
    index = [i for i, _ in chosen]
    return ParameterCovariance(
        tuple(name for _, name in chosen), _rows(spread[np.ix_(index, index)])
    )


def _plane(plane: Plane, derived: dict[tuple[Plane, str], tuple[float, float]]) -> PlaneModel:
    """Return the derived values of a plane; ``derived`` holds (value, standard deviation).

    A static gain without a bounded interval has no standard deviation.
    """

    def estimate(name: str) -> ParameterEstimate:
        """Return value and standard deviation of a derived number."""
        value, sd = derived[plane, name]
        return ParameterEstimate(
            float(value), float(sd) if sd else None
        )  # sd of 0: at a limit, not exactly known

    gain, slow = estimate("static_gain_per_s"), estimate("p_slow_per_s")
    if slow.sd and not linear_planes.static_gain_is_bounded(slow.value, slow.sd):
        gain = msgspec.structs.replace(gain, sd=None)
    return PlaneModel(
        static_gain_per_s=gain,
        b1_per_s2=estimate("b1_per_s2"),
        p_fast_per_s=estimate("p_fast_per_s"),
        p_slow_per_s=estimate("p_slow_per_s"),
        restoring_per_s2=estimate("restoring_per_s2")
        if "restoring_per_s2" in linear_planes.small_signal_names(plane)
        else None,
        delay_s=estimate("delay_s"),
        actuator_bias_deg=estimate("actuator_bias_deg"),
    )


def _coefficients(fit: Fit, prior: Prior, measured: set[Plane]) -> dict[str, Coefficient]:
    """Return Table 1's coefficients with their standard deviations and status."""
    # Ratio: sd(value) = |value - added| prior_sd sd(z), where added is the added inertia of I_zz
    # or I_yy, and 0 for the others. sd_ratio = posterior over prior sd of z.
    before = parameters.to_table_1_column(prior.config.linear)
    after = parameters.to_table_1_column(fit.vehicle.config.linear)
    report = {}
    for name in Table1Column._fields:
        value, first, unit = getattr(after, name), getattr(before, name), str(getattr(UNITS, name))
        if name not in NAMES:
            report[name] = Coefficient(
                value=value,
                sd=0.0,
                prior=first,
                prior_sd=0.0,
                posterior_to_prior_sd=1.0,
                status="prior",
                unit=unit,
            )
            continue
        i = NAMES.index(name)
        parameter = PARAMETERS[i]
        added = getattr(after, INERTIAS[name]) if name in INERTIAS else 0.0
        sd, prior_sd = math.sqrt(fit.covariance[i, i]), math.sqrt(prior.covariance[i, i])
        sd_ratio = sd / prior_sd
        status: Status = (
            "measured"
            if sd_ratio <= MAX_POSTERIOR_TO_PRIOR_SD and parameter.planes[0] in measured
            else "prior"
        )
        report[name] = Coefficient(
            value=value,
            sd=abs(value - added) * parameter.prior_sd * sd,
            prior=first,
            prior_sd=abs(first - added) * parameter.prior_sd * prior_sd,
            posterior_to_prior_sd=sd_ratio,
            status=status,
            unit=unit,
        )
    return report


def _vehicle(fit: Fit, prior: Prior, prior_name: str) -> VehicleRecord:
    """Return the part of the model file that describes the vehicle."""
    config, tailcone = fit.vehicle.config, fit.vehicle.actuators[Plane.YAW]

    def estimate(name: str, value: float, prior_sd: float) -> ParameterEstimate:
        i = NAMES.index(name)
        return ParameterEstimate(value, prior_sd * math.sqrt(fit.covariance[i, i]))

    def ratio(name: str, value: float) -> ParameterEstimate:
        return estimate(name, value, value * parameters.prior_sd(prior.config, name))

    return VehicleRecord(
        prior=prior_name,
        mass_kg=config.ballast.mass_kg,
        prior_biases_deg={plane: math.degrees(b) for plane, b in prior.biases_rad.items()},
        net_buoyancy_n=estimate(
            "net_buoyancy",
            config.ballast.net_buoyancy_n,
            parameters.net_buoyancy_sd_n(prior.config),
        ),
        crossflow_cd=ratio("crossflow_cd", config.damping.crossflow_cd),
        natural_frequency_radps=ratio("natural_frequency", tailcone.natural_frequency_radps),
        damping_ratio=ratio("damping_ratio", tailcone.damping_ratio),
        level_elevator_deg=math.degrees(steady_state.level_elevator_rad(config, fit.vehicle.model)),
        level_pitch_deg=math.degrees(steady_state.level_pitch_rad(config, fit.vehicle.model)),
        file=prior.config,
    )


def _noise(fit: Fit) -> dict[Plane, NoiseModel]:
    """Return the noise of each plane, with the mean depth of its tests if they show waves."""
    has_waves = any(level.wave_depth_m for level in fit.noise.values())

    def depth_m(plane: Plane) -> float:
        """Return the mean depth of the tests of a plane."""
        return float(np.mean([np.mean(data.run.depth_m) for data in fit.datasets[plane]]))

    return {
        plane: noise.to_model(level._replace(test_depth_m=depth_m(plane) if has_waves else 0.0))
        for plane, level in fit.noise.items()
    }


def _joint(fit: Fit) -> Joint:
    """Return estimate, covariance and information of the data in terms of z."""
    sd = np.sqrt(np.diag(fit.covariance))
    used = parameters.parameters_of_planes(list(fit.datasets))
    information = np.linalg.eigvalsh(fit.data_information[np.ix_(used, used)])
    smallest, largest = float(information[0]), float(information[-1])
    return Joint(
        names=NAMES,
        z=tuple(fit.z.tolist()),
        covariance=_rows(fit.covariance),
        correlation=_rows(fit.covariance / np.outer(sd, sd)),
        rank=int(np.count_nonzero(information > RANK_TOLERANCE * largest)),
        informed_directions=int(np.count_nonzero(information > 1.0)),
        condition_number=largest / smallest if smallest > 1e-14 * largest else None,
        run_scatter=fit.run_scatter.value,
        deviating_run=fit.deviating_run if fit.run_scatter.value > 0.0 else "",
        run_scatter_without=fit.run_scatter.without_run,
        prior_conflict=fit.prior_conflict,
    )


def _rows(matrix: Array) -> tuple[tuple[float, ...], ...]:
    """Return a matrix as a tuple of rows."""
    return tuple(tuple(row) for row in matrix.tolist())


def _notes(fit: Fit, prior: Prior, measured: set[Plane]) -> tuple[str, ...]:
    """Return notes on planes without runs, bounds, errors of the structure, and speed."""
    unseen = [plane for plane in Plane if plane not in measured]
    notes = [
        f"no run in {plane}: its values come from the prior and from the other plane"
        for plane in unseen
    ]
    if fit.at_bounds:
        notes.append(
            f"at a bound of {Z_LIMIT:g} prior standard deviations: {', '.join(fit.at_bounds)}"
        )
    costs = SearchCosts(fit.cost, fit.start_costs)
    if costs.elsewhere and costs.is_unique:
        notes.append(f"{costs.description}: minima that the data reject")
    notes += bounds.reached(fit.z, prior.config.tailcone.lag_relative_sd).notes
    if fit.run_scatter.value > 0.0:
        notes.append(
            f"the tests disagree by {fit.run_scatter.value:.2g} prior standard deviations beyond"
            " noise: the model structure is in error, which the standard deviations contain"
        )
    if fit.prior_conflict > 0.0:
        offsets_sd = (fit.z - prior.mean) / np.sqrt(np.diag(prior.covariance))
        farthest = int(np.argmax(np.abs(offsets_sd)))
        notes.append(
            "the parameters lie further from the prior than its uncertainty allows, most of all"
            f" {NAMES[farthest]} by {offsets_sd[farthest]:.1f} standard deviations: the vehicle"
            " file or the model structure is in error, which the standard deviations contain"
        )
    measured_speed = all(
        data.run.relative_speed is not None for group in fit.datasets.values() for data in group
    )
    notes.append(
        "speed was measured relative to that before each test: coefficients are valid at the"
        " prior's speed for the thrust used"
        if measured_speed
        else "speed was not measured: coefficients are valid at the prior's speed for the thrust"
        " used"
    )
    return tuple(notes)


def from_paper(plane_fits: dict[Plane, PlaneFit], prior: Prior, prior_name: str) -> IdentifiedModel:
    """Return the model file of the paper's method; undetermined values have no standard deviation.

    Parameters
    ----------
    plane_fits : dict
        Fit of each plane.
    prior : Prior
        Prior that was used.
    prior_name : str
        Name or path of the prior vehicle file.

    Returns
    -------
    IdentifiedModel
        Content of ``model.json``, without data, screening and validation.
    """
    before = parameters.to_table_1_column(prior.config.linear)
    after = before
    for plane_fit in plane_fits.values():
        after = plane_fit.coefficients
    nominal = parameters.candidate_vehicle(prior.config, prior.biases_rad, np.zeros(len(NAMES)))
    config, zeros = prior.config, np.zeros((len(NAMES), len(NAMES)))
    free = [name for plane in plane_fits for name in FREE[plane]]
    rank = sum(f.rank for f in plane_fits.values())
    mass, speed = config.ballast.mass_kg, config.operating_point.speed_mps
    return IdentifiedModel(
        format=FORMAT,
        method="paper",
        speed_mps=speed,
        thrust_fraction=config.operating_point.thrust_fraction,
        planes={
            plane: _plane_of_paper(
                plane,
                linear_planes.small_signal(linear_planes.linear_plane(plane, after, speed, mass)),
                nominal.actuators[plane].delay_s,
                prior.biases_rad[plane],
            )
            for plane in Plane
        },
        coefficients=_coefficients_of_paper(before, after, free),
        vehicle=VehicleRecord(
            prior=prior_name,
            mass_kg=mass,
            prior_biases_deg={plane: math.degrees(b) for plane, b in prior.biases_rad.items()},
            net_buoyancy_n=ParameterEstimate(config.ballast.net_buoyancy_n, 0.0),
            crossflow_cd=ParameterEstimate(config.damping.crossflow_cd, 0.0),
            natural_frequency_radps=ParameterEstimate(config.tailcone.natural_frequency_radps, 0.0),
            damping_ratio=ParameterEstimate(config.tailcone.damping_ratio, 0.0),
            level_elevator_deg=math.degrees(steady_state.level_elevator_rad(config, nominal.model)),
            level_pitch_deg=math.degrees(steady_state.level_pitch_rad(config, nominal.model)),
            file=prior.config,
        ),
        noise={},
        joint=Joint(
            names=NAMES,
            z=tuple([0.0] * len(NAMES)),
            covariance=_rows(zeros),
            correlation=_rows(zeros),
            rank=rank,
            informed_directions=rank,
            condition_number=None,
        ),
        convergence=Convergence(
            cost=sum(f.cost for f in plane_fits.values()), start_costs=(), agreed=True, at_bounds=()
        ),
        data=(),
        screening=(),
        fit_quality=(),
        held_out=(),
        notes=tuple(
            f"{plane}: {len(FREE[plane])} coefficients fitted, rank {f.rank}: no unique solution; "
            f"measured acceleration {f.acceleration_per_s2:.3f} per s2 and radian of duct"
            for plane, f in plane_fits.items()
        ),
    )


def _plane_of_paper(
    plane: Plane, numbers: SmallSignal, delay_s: float, bias_rad: float
) -> PlaneModel:
    """Return the numbers of a plane, with the delay and bias of the prior's actuator."""
    has_restoring = "restoring_per_s2" in linear_planes.small_signal_names(plane)
    return PlaneModel(
        static_gain_per_s=ParameterEstimate(numbers.static_gain_per_s, None),
        b1_per_s2=ParameterEstimate(numbers.b1_per_s2, None),
        p_fast_per_s=ParameterEstimate(numbers.p_fast_per_s, None),
        p_slow_per_s=ParameterEstimate(numbers.p_slow_per_s, None),
        restoring_per_s2=ParameterEstimate(numbers.restoring_per_s2, None)
        if has_restoring
        else None,
        delay_s=ParameterEstimate(delay_s, 0.0),
        actuator_bias_deg=ParameterEstimate(math.degrees(bias_rad), None),
    )


def _coefficients_of_paper(
    before: Table1Column, after: Table1Column, free: Collection[str]
) -> dict[str, Coefficient]:
    """Return Table 1's coefficients; the fit determines none of the ``free`` ones uniquely."""
    return {
        name: Coefficient(
            value=getattr(after, name),
            sd=None,
            prior=getattr(before, name),
            prior_sd=0.0,
            posterior_to_prior_sd=None,
            status="unidentifiable" if name in free or name in INERTIAS else "prior",
            unit=str(getattr(UNITS, name)),
        )
        for name in Table1Column._fields
    }
