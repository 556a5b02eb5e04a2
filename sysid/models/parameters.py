"""Parameters of the identification and their prior distribution.

Estimation works on z: the distance of each parameter from its prior mean, in prior standard
deviations. With s the ``prior_sd`` of a parameter:

    ratio:   value = prior value * exp(s z)   (log-normal; coefficients keep their sign)
    offset:  value = prior value + s z        (normal; delay, bias, buoyancy)

Coefficients are those of Table 1 in the paper's axes (x forward, y port, z up).
"""

import contextlib
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from typing import Literal, NamedTuple, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from sitl.vehicle import build_model
from sitl.vehicle.config import DuctGeometry, FinGeometry, VehicleConfig, VehicleFileError
from sitl.vehicle.model import VehicleModel
from sysid.models.greybox import Actuator
from sysid.planes import PLANES, Plane
from sysid.reproduction.paper_tables import Table1Column

Array = NDArray[np.float64]
Kind = Literal["ratio", "offset"]
Part = Literal["body", "tailcone", "sensors"]
Wing = TypeVar("Wing", DuctGeometry, FinGeometry)

MAX_DAMPING = 0.99
"""Maximum damping ratio of the actuator lag, which is simulated in its underdamped form.

The step response at 0.99 is practically that of an overdamped lag."""

MAX_DRAWS_PER_SAMPLE = 10
"""Maximum number of draws per requested vehicle; impossible vehicles are drawn again."""

ASYMMETRY = 0.07
"""Standard deviation of the log ratio of yaw and pitch coefficients of a body of revolution."""
CARIBOU_MASS_KG, CARIBOU_NET_BUOYANCY_N = 640.0, 22.24
"""Mass and net buoyancy of Caribou, for which `CARIBOU_NET_BUOYANCY_SD_N` holds."""
CARIBOU_NET_BUOYANCY_SD_N = 5.0
"""Prior standard deviation of Caribou's net buoyancy (N), see `net_buoyancy_sd_n`."""


class ModelParameter(NamedTuple):
    """One parameter of the identification."""

    name: str
    planes: tuple[Plane, ...]
    """Planes whose runs depend on the parameter."""
    kind: Kind
    prior_sd: float
    """Prior standard deviation: of the logarithm for a ratio, in SI units for an offset.

    The net buoyancy's is Caribou's; `net_buoyancy_sd_n` gives that of a vehicle."""
    twin: str = ""
    """Yaw coefficient that is equal by symmetry of revolution; empty for none."""
    part: Part = "body"
    """Part of the vehicle that it changes: forces on the body, actuator, or measured outputs."""


BENCH_TEST_SD = 0.05
"""Relative standard deviation of the tailcone's lag after a bench test."""
_YAW: tuple[Plane, ...] = (Plane.YAW,)
_PITCH: tuple[Plane, ...] = (Plane.PITCH,)
_BOTH: tuple[Plane, ...] = tuple(Plane)

PARAMETERS: tuple[ModelParameter, ...] = (
    ModelParameter(name="Y_v", planes=_YAW, kind="ratio", prior_sd=0.20),
    ModelParameter(name="N_v", planes=_YAW, kind="ratio", prior_sd=0.40),
    ModelParameter(name="Y_r", planes=_YAW, kind="ratio", prior_sd=0.40),
    ModelParameter(name="N_r", planes=_YAW, kind="ratio", prior_sd=0.20),
    ModelParameter(name="Y_dr", planes=_YAW, kind="ratio", prior_sd=0.20),
    ModelParameter(name="N_dr", planes=_YAW, kind="ratio", prior_sd=0.25),
    ModelParameter(name="Y_vdot", planes=_YAW, kind="ratio", prior_sd=0.08),
    ModelParameter(name="I_zz", planes=_YAW, kind="ratio", prior_sd=0.20),
    ModelParameter(name="delay_yaw", planes=_YAW, kind="offset", prior_sd=0.1, part="tailcone"),
    ModelParameter(
        name="bias_rudder", planes=_YAW, kind="offset", prior_sd=math.radians(1.0), part="tailcone"
    ),
    ModelParameter(name="Z_w", planes=_PITCH, kind="ratio", prior_sd=0.20, twin="Y_v"),
    ModelParameter(name="M_w", planes=_PITCH, kind="ratio", prior_sd=0.40, twin="N_v"),
    ModelParameter(name="Z_q", planes=_PITCH, kind="ratio", prior_sd=0.40, twin="Y_r"),
    ModelParameter(name="M_q", planes=_PITCH, kind="ratio", prior_sd=0.20, twin="N_r"),
    ModelParameter(name="Z_de", planes=_PITCH, kind="ratio", prior_sd=0.20, twin="Y_dr"),
    ModelParameter(name="M_de", planes=_PITCH, kind="ratio", prior_sd=0.25, twin="N_dr"),
    ModelParameter(name="Z_wdot", planes=_PITCH, kind="ratio", prior_sd=0.08, twin="Y_vdot"),
    ModelParameter(name="I_yy", planes=_PITCH, kind="ratio", prior_sd=0.20, twin="I_zz"),
    ModelParameter(name="z_CM", planes=_PITCH, kind="ratio", prior_sd=0.30),
    ModelParameter(name="delay_pitch", planes=_PITCH, kind="offset", prior_sd=0.1, part="tailcone"),
    ModelParameter(
        name="bias_elevator",
        planes=_PITCH,
        kind="offset",
        prior_sd=math.radians(1.0),
        part="tailcone",
    ),
    ModelParameter(
        name="net_buoyancy", planes=_PITCH, kind="offset", prior_sd=CARIBOU_NET_BUOYANCY_SD_N
    ),
    ModelParameter(name="crossflow_cd", planes=_BOTH, kind="ratio", prior_sd=0.25),
    ModelParameter(name="crossflow_slope", planes=_BOTH, kind="offset", prior_sd=0.5),
    ModelParameter(name="crossflow_ends", planes=_BOTH, kind="offset", prior_sd=0.5),
    ModelParameter(
        name="natural_frequency",
        planes=_BOTH,
        kind="ratio",
        prior_sd=BENCH_TEST_SD,
        part="tailcone",
    ),
    ModelParameter(
        name="damping_ratio", planes=_BOTH, kind="ratio", prior_sd=BENCH_TEST_SD, part="tailcone"
    ),
    ModelParameter(
        name="elevator_frequency", planes=_PITCH, kind="ratio", prior_sd=0.1, part="tailcone"
    ),
    ModelParameter(name="rate_limit", planes=_BOTH, kind="ratio", prior_sd=0.25, part="tailcone"),
    ModelParameter(name="backlash", planes=_BOTH, kind="ratio", prior_sd=1.0, part="tailcone"),
    ModelParameter(name="axial_drag", planes=_BOTH, kind="ratio", prior_sd=0.2),
    ModelParameter(name="lift_quadratic", planes=_BOTH, kind="offset", prior_sd=0.3),
    ModelParameter(name="stall_angle", planes=_BOTH, kind="ratio", prior_sd=0.15),
    ModelParameter(name="angle_lag", planes=_BOTH, kind="offset", prior_sd=0.05, part="sensors"),
    ModelParameter(name="depth_lag", planes=_PITCH, kind="offset", prior_sd=0.15, part="sensors"),
    ModelParameter(name="crossflow_uncoupled", planes=_BOTH, kind="offset", prior_sd=0.5),
    ModelParameter(
        name="elevator_damping", planes=_PITCH, kind="ratio", prior_sd=0.1, part="tailcone"
    ),
)
"""All parameters, in the order of z, with prior standard deviations.

The accuracy of strip and duct theory sets those of the coefficients, the bench test those of the
actuator lag. The drag of a slender hull with its appendages is known to 20 %; with the thrust that
balances it, it sets the loss of speed in a turn. The lift of a small wing differs from a straight
line by a few per cent at ten degrees, upwards by crossflow at the edges or downwards by the
boundary layer (Hoerner 1975, Fluid-Dynamic Lift, ch. 3), so ``lift_quadratic``, as a fraction of
the slope per radian, is 0 +- 0.3. The stall angle is known to 15 %. The rate limit is that of a
drive under load: known to 25 %, because a drive that sticks looks slower. The elevator's drive is
that of the rudder to 10 % in natural frequency and in damping ratio. Drift damps rotation as in
strip theory (0) or not at all (1): ``crossflow_uncoupled`` is 0 +- 0.5."""
ELEVATOR_RATIOS = {
    "natural_frequency": "elevator_frequency",
    "damping_ratio": "elevator_damping",
}
"""Parameter of the rudder's drive, and the ratio of the elevator's to it."""
ASSUMED_BACKLASH_DEG = 0.2
"""Backlash (full width) of a tailcone without a measurement; known within a factor of e."""

NAMES = tuple(parameter.name for parameter in PARAMETERS)
"""Names of the parameters, in the order of z."""
INERTIAS = {"I_zz": "N_rdot", "I_yy": "M_qdot"}
"""Inertias and their added inertias. Motion shows only the sum; the ratio applies to the sum."""
MIN_BODY_SHARE = 0.3
"""Smallest share of its inertia that is left to the body; the added inertia takes the rest.

The added inertia of a slender hull is 0.6 of the sum, so that a vehicle would be impossible below
0.64 times the sum, two prior standard deviations from the prior.
"""


def prior_covariance() -> Array:
    """Return the prior covariance of z, with correlated yaw and pitch coefficients.

    Returns
    -------
    ndarray, shape (n, n)
        Unit diagonal; order of ``NAMES``.

    Notes
    -----
    With log-normal prior sd s of both twins and ASYMMETRY a, the correlation is
    max(0, 1 - (a / s)^2).
    """
    covariance = np.eye(len(PARAMETERS))
    for i, parameter in enumerate(PARAMETERS):
        if parameter.twin:
            j = NAMES.index(parameter.twin)
            correlation = max(0.0, 1.0 - (ASYMMETRY / parameter.prior_sd) ** 2)
            covariance[i, j] = covariance[j, i] = correlation
    return covariance


class CandidateVehicle(NamedTuple):
    """A vehicle at some z: everything that the simulation of a run needs."""

    config: VehicleConfig
    """Vehicle file with the changed coefficients; its ``tailcone`` is that of the prior."""
    model: VehicleModel
    """Numeric model of ``config``."""
    actuators: dict[Plane, Actuator]
    """Rudder ("yaw") and elevator ("pitch") axis of the tailcone."""
    sensor_lags_s: tuple[float, float] = (0.0, 0.0)
    """Lag of angle and of depth behind the rate."""


def candidate_vehicle(
    prior: VehicleConfig, biases_rad: dict[Plane, float], z: Array
) -> CandidateVehicle:
    """Return the vehicle at z.

    Parameters
    ----------
    prior : VehicleConfig
        The prior vehicle.
    biases_rad : dict
        Prior mean of the actuator bias, rad, by plane.
    z : ndarray, shape (n,)
        Distance from the prior mean in prior standard deviations, in the order of ``NAMES``.

    Returns
    -------
    CandidateVehicle
        Vehicle file, numeric model and actuators.

    Raises
    ------
    VehicleFileError
        The coefficients are physically impossible.
    """
    config = _changed_config(prior, z)
    return CandidateVehicle(
        config, _body(config, z), actuators(prior, biases_rad, z), sensor_lags_s(z)
    )


def sensor_lags_s(z: Array) -> tuple[float, float]:
    """Return the lags of angle and of depth behind the rate at z, s."""
    angle, depth = (PARAMETERS[i].prior_sd * float(z[i]) for i in _SENSOR_LAGS)
    return angle, depth


def net_buoyancy_sd_n(prior: VehicleConfig) -> float:
    """Return the prior standard deviation of the net buoyancy (N).

    Caribou's, in proportion to the mass or to the net buoyancy, whichever gives more: ballast is
    weighed to a share of either.

    Parameters
    ----------
    prior : VehicleConfig
        The prior vehicle.

    Returns
    -------
    float
        Standard deviation (N).
    """
    mass_ratio = prior.ballast.mass_kg / CARIBOU_MASS_KG
    buoyancy_ratio = abs(prior.ballast.net_buoyancy_n) / CARIBOU_NET_BUOYANCY_N
    return CARIBOU_NET_BUOYANCY_SD_N * max(mass_ratio, buoyancy_ratio)


def prior_sd(prior: VehicleConfig, name: str) -> float:
    """Return the prior standard deviation of a parameter for a vehicle.

    Parameters
    ----------
    prior : VehicleConfig
        The prior vehicle.
    name : str
        Name of the parameter.

    Returns
    -------
    float
        That of the vehicle file for the lag of the tailcone, else that of ``PARAMETERS``.
    """
    return prior.tailcone.lag_relative_sd if name in ELEVATOR_RATIOS else _PRIOR_SDS[name]


def delays_of_zero(prior: VehicleConfig) -> dict[int, float]:
    """Return the z of each delay at which it is zero, by index; below, nothing changes.

    Parameters
    ----------
    prior : VehicleConfig
        The prior vehicle.

    Returns
    -------
    dict of int to float
        -delay / prior standard deviation.
    """
    return {
        i: -prior.tailcone.delay_s / PARAMETERS[i].prior_sd
        for i, name in enumerate(NAMES)
        if name.startswith("delay_")
    }


def with_body_at(candidate: CandidateVehicle, prior: VehicleConfig, z: Array) -> CandidateVehicle:
    """Return a candidate with the body at z and its own actuators.

    Parameters
    ----------
    candidate : CandidateVehicle
        Vehicle whose actuators are kept.
    prior : VehicleConfig
        The prior vehicle.
    z : ndarray, shape (n,)
        Distance from the prior mean in prior standard deviations, in the order of ``NAMES``.

    Returns
    -------
    CandidateVehicle
        Vehicle file, numeric model and actuators.

    Raises
    ------
    VehicleFileError
        The coefficients are physically impossible.
    """
    config = _changed_config(prior, z)
    return candidate._replace(config=config, model=_body(config, z))


def _body(config: VehicleConfig, z: Array) -> VehicleModel:
    """Return the numeric model with the form of the crossflow drag at z.

    The drag of a station at x, xi = x over half the length, is multiplied by

        1 + a xi + b (3 xi^2 - 1) / 2,   not below zero,

    a and b from ``crossflow_slope`` and ``crossflow_ends``: Legendre polynomials, so that
    ``crossflow_cd`` keeps its meaning for a cylinder. Drift damps rotation in strip theory, and not
    in models with quadratic coefficients; ``crossflow_uncoupled`` is the share of the latter.
    """
    model = build_model.build(config)
    slope, ends, uncoupled = (PARAMETERS[i].prior_sd * float(z[i]) for i in _CROSSFLOW_SHAPE)
    stations = model.stations
    xi = stations.x_m / np.max(np.abs(stations.x_m))
    factor = np.maximum(1.0 + slope * xi + ends * 0.5 * (3.0 * xi**2 - 1.0), 0.0)
    stations = stations._replace(drag_kgpm=stations.drag_kgpm * factor, uncoupled=uncoupled)
    return model._replace(stations=stations)


def _changed_config(prior: VehicleConfig, z: Array) -> VehicleConfig:
    """Return the vehicle file with the coefficients of the body at z."""
    ratios, offsets = _ratios_and_offsets(prior, z)
    return msgspec.structs.replace(
        prior,
        linear=_coefficients(prior, ratios),
        damping=msgspec.structs.replace(
            prior.damping, crossflow_cd=prior.damping.crossflow_cd * ratios["crossflow_cd"]
        ),
        ballast=msgspec.structs.replace(
            prior.ballast,
            net_buoyancy_n=prior.ballast.net_buoyancy_n
            + net_buoyancy_sd_n(prior) * float(z[_NET_BUOYANCY]),
        ),
        operating_point=msgspec.structs.replace(
            prior.operating_point, thrust_n=prior.operating_point.thrust_n * ratios["axial_drag"]
        ),
        duct=prior.duct and _wing(prior.duct, ratios, offsets),
        fins=prior.fins and _wing(prior.fins, ratios, offsets),
    )


class SampledVehicle(NamedTuple):
    """A vehicle at a random z."""

    number: int
    """Index of the sample; impossible vehicles are counted too."""
    z: Array
    vehicle: CandidateVehicle


def feasible_samples(
    build: Callable[[Array], CandidateVehicle],
    mean: Array,
    covariance: Array,
    normals: Iterable[Array],
) -> Iterator[SampledVehicle]:
    """Yield vehicles at samples of a normal distribution of z, without impossible ones.

    Parameters
    ----------
    build : callable
        Makes the vehicle at z; raises VehicleFileError for an impossible one.
    mean : ndarray, shape (n,)
        Mean of z.
    covariance : ndarray, shape (n, n)
        Covariance of z.
    normals : iterable of ndarray, shape (n,)
        Standard normal samples, one per vehicle.

    Yields
    ------
    SampledVehicle
        Index, z and vehicle.
    """
    spread = np.linalg.cholesky(covariance + 1e-12 * np.eye(len(covariance)))
    for number, normal in enumerate(normals):
        z = mean + spread @ normal
        with contextlib.suppress(VehicleFileError):
            yield SampledVehicle(number, z, build(z))


def actuators(
    prior: VehicleConfig, biases_rad: dict[Plane, float], z: Array
) -> dict[Plane, Actuator]:
    """Return the two actuator axes at z; arguments as for ``candidate_vehicle``."""
    ratios, offsets = _ratios_and_offsets(prior, z)
    tailcone = prior.tailcone

    def actuator(plane: Plane) -> Actuator:
        """Return the actuator of a plane."""
        to_rudder = {
            name: 1.0 if PLANES[plane].is_yaw else ratios[ratio]
            for name, ratio in ELEVATOR_RATIOS.items()
        }
        return Actuator(
            delay_s=max(0.0, tailcone.delay_s + offsets[f"delay_{plane}"]),
            natural_frequency_radps=tailcone.natural_frequency_radps
            * ratios["natural_frequency"]
            * to_rudder["natural_frequency"],
            damping_ratio=min(
                tailcone.damping_ratio * ratios["damping_ratio"] * to_rudder["damping_ratio"],
                MAX_DAMPING,
            ),
            bias_rad=biases_rad[plane] + offsets[f"bias_{PLANES[plane].surface}"],
            travel_rad=math.radians(tailcone.travel_deg),
            rate_radps=math.radians(tailcone.rate_degps) * ratios["rate_limit"],
            backlash_rad=math.radians(backlash_deg(prior)) * ratios["backlash"],
        )

    return {plane: actuator(plane) for plane in Plane}


def backlash_deg(prior: VehicleConfig) -> float:
    """Return the prior median of the backlash (deg, full width).

    A backlash of 0 in the vehicle file counts as not measured.
    """
    return prior.tailcone.backlash_deg or ASSUMED_BACKLASH_DEG


_CROSSFLOW_SHAPE = tuple(
    NAMES.index(name) for name in ("crossflow_slope", "crossflow_ends", "crossflow_uncoupled")
)
_NET_BUOYANCY = NAMES.index("net_buoyancy")
_PRIOR_SDS = {parameter.name: parameter.prior_sd for parameter in PARAMETERS}
_SENSOR_LAGS = tuple(NAMES.index(name) for name in ("angle_lag", "depth_lag"))
_RATIOS, _OFFSETS = (
    tuple((i, p.name) for i, p in enumerate(PARAMETERS) if p.kind == kind)
    for kind in ("ratio", "offset")
)
"""Index and name of the parameters of each kind."""


def _ratios_and_offsets(
    prior: VehicleConfig, z: Array
) -> tuple[dict[str, float], dict[str, float]]:
    """Return (ratios, offsets in SI units) by name."""
    values = z.tolist()
    return (
        {name: math.exp(prior_sd(prior, name) * values[i]) for i, name in _RATIOS},
        {name: prior_sd(prior, name) * values[i] for i, name in _OFFSETS},
    )


def _wing(wing: Wing, ratios: dict[str, float], offsets: dict[str, float]) -> Wing:
    """Return duct or fins with changed quadratic lift and stall angle."""
    stall = ratios["stall_angle"]
    quadratic_lift = offsets["lift_quadratic"] * wing.lift_slope_per_rad
    return msgspec.structs.replace(
        wing,
        lift_quadratic_per_rad2=wing.lift_quadratic_per_rad2 + quadratic_lift,
        stall_deg=wing.stall_deg * stall,
        separated_deg=wing.separated_deg * stall,
    )


def _coefficients(prior: VehicleConfig, ratios: dict[str, float]) -> msgspec.Struct:
    """Return the linear coefficients times their ratios; see ``INERTIAS`` for inertias."""
    linear = prior.linear
    column, changed = to_table_1_column(linear), dict[str, float]()
    fields = {symbol(field): field for field in linear.__struct_fields__}
    for name, field in fields.items():
        value = getattr(linear, field)
        if name in INERTIAS:
            added = getattr(column, INERTIAS[name])
            total = (value - added) * ratios[name]
            body = total + added
            if body < MIN_BODY_SHARE * value:
                body = MIN_BODY_SHARE * value
                changed[fields[INERTIAS[name]]] = body - total
            changed[field] = body
        elif name in ratios:
            changed[field] = value * ratios[name]
    return msgspec.structs.replace(linear, **changed)


@cache
def symbol(field: str) -> str:
    """Return the symbol of a key of the vehicle file: ``Y_v_kgps`` is ``Y_v``."""
    return field.rpartition("_")[0]


def to_table_1_column(linear: msgspec.Struct) -> Table1Column:
    """Return the ``linear`` table of a vehicle file under Table 1's symbols.

    Parameters
    ----------
    linear : Struct
        ``VehicleConfig.linear``; SI units and radians.

    Returns
    -------
    Table1Column
        The same numbers.
    """
    return Table1Column(
        **{symbol(field): getattr(linear, field) for field in linear.__struct_fields__}
    )


def parameters_of_planes(planes: Sequence[Plane]) -> list[int]:
    """Return the indices of the parameters on which runs in ``planes`` depend."""
    return [i for i, parameter in enumerate(PARAMETERS) if set(parameter.planes) & set(planes)]
