"""What identification may change about the first-principles vehicle, and what is believed before
the first dive.

Estimation runs on z, the number of prior standard deviations from the prior mean. Coefficients are
positive ratios to the prior vehicle (log-normal), delay, bias and buoyancy are offsets (normal).
"""

import contextlib
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Literal, NamedTuple, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from sitl.vehicle import build_model
from sitl.vehicle.config import DuctGeometry, FinGeometry, VehicleConfig, VehicleFileError
from sitl.vehicle.model import VehicleModel
from sysid.data.segments import Plane
from sysid.models.greybox import Actuator
from sysid.reproduction.paper_tables import Table1Column

Array = NDArray[np.float64]
Kind = Literal["ratio", "offset"]
Wing = TypeVar("Wing", DuctGeometry, FinGeometry)

MAX_DAMPING = 0.99
"""The lag is simulated as an oscillation; one that creeps looks no different from here."""

ASYMMETRY = 0.07
"""How far yaw and pitch coefficients of a body of revolution may differ from their mean (log ratio,
1 sd)."""


class ModelParameter(NamedTuple):
    name: str
    planes: tuple[Plane, ...]
    kind: Kind
    prior_sd: float
    """Relative for a ratio, in the parameter's SI unit for an offset."""
    twin: str = ""
    """The yaw coefficient that is the same physical quantity turned by a quarter about x."""
    part: Literal["body", "tailcone"] = "body"
    """Which of a candidate's two halves it changes: forces on the vehicle, or how the duct follows
    its command."""


_YAW: tuple[Plane, ...] = ("yaw",)
_PITCH: tuple[Plane, ...] = ("pitch",)
_BOTH: tuple[Plane, ...] = ("yaw", "pitch")

PARAMETERS: tuple[ModelParameter, ...] = (
    ModelParameter("Y_v", _YAW, "ratio", 0.20),
    ModelParameter("N_v", _YAW, "ratio", 0.40),
    ModelParameter("Y_r", _YAW, "ratio", 0.40),
    ModelParameter("N_r", _YAW, "ratio", 0.20),
    ModelParameter("Y_dr", _YAW, "ratio", 0.20),
    ModelParameter("N_dr", _YAW, "ratio", 0.25),
    ModelParameter("Y_vdot", _YAW, "ratio", 0.08),
    ModelParameter("I_zz", _YAW, "ratio", 0.20),
    ModelParameter("delay_yaw", _YAW, "offset", 0.1, part="tailcone"),
    ModelParameter("bias_rudder", _YAW, "offset", math.radians(1.0), part="tailcone"),
    ModelParameter("Z_w", _PITCH, "ratio", 0.20, "Y_v"),
    ModelParameter("M_w", _PITCH, "ratio", 0.40, "N_v"),
    ModelParameter("Z_q", _PITCH, "ratio", 0.40, "Y_r"),
    ModelParameter("M_q", _PITCH, "ratio", 0.20, "N_r"),
    ModelParameter("Z_de", _PITCH, "ratio", 0.20, "Y_dr"),
    ModelParameter("M_de", _PITCH, "ratio", 0.25, "N_dr"),
    ModelParameter("Z_wdot", _PITCH, "ratio", 0.08, "Y_vdot"),
    ModelParameter("I_yy", _PITCH, "ratio", 0.20, "I_zz"),
    ModelParameter("z_CM", _PITCH, "ratio", 0.30),
    ModelParameter("delay_pitch", _PITCH, "offset", 0.1, part="tailcone"),
    ModelParameter("bias_elevator", _PITCH, "offset", math.radians(1.0), part="tailcone"),
    ModelParameter("net_buoyancy", _PITCH, "offset", 5.0),
    ModelParameter("crossflow_cd", _BOTH, "ratio", 0.25),
    ModelParameter("natural_frequency", _BOTH, "ratio", 0.05, part="tailcone"),
    ModelParameter("damping_ratio", _BOTH, "ratio", 0.05, part="tailcone"),
    ModelParameter("rate_limit", _BOTH, "ratio", 0.1, part="tailcone"),
    ModelParameter("backlash", _BOTH, "ratio", 1.0, part="tailcone"),
    ModelParameter("axial_drag", _BOTH, "ratio", 0.2),
    ModelParameter("lift_quadratic", _BOTH, "offset", 0.3),
    ModelParameter("stall_angle", _BOTH, "ratio", 0.15),
)
"""Prior standard deviations: strip and duct theory for the coefficients, the bench test for the
tailcone's lag.

Drag of a slender hull with everything that sticks out of it is known to a fifth; with the thrust
that balances it, it says how fast speed is lost in a turn and won back. Lift of a small wing leaves
its straight line by a few per cent in ten degrees, upwards by its edges (cross flow) or downwards
by its boundary layer (Hoerner 1975, Fluid-Dynamic Lift, ch. 3), so ``lift_quadratic``, in shares of
the slope per radian, is zero within 0.3; where it stalls is known to a seventh. """
ASSUMED_BACKLASH_DEG = 0.2
"""From flank to flank, of a tailcone that nobody has measured: within a factor of e."""

NAMES = tuple(parameter.name for parameter in PARAMETERS)
INERTIAS = {"I_zz": "N_rdot", "I_yy": "M_qdot"}
"""Inertia is identified with its added mass, which motion cannot tell apart: the ratio is that of
their sum."""


def prior_covariance() -> Array:
    """Of z, shape (n, n), unit diagonal: twins share what they have in common."""
    covariance = np.eye(len(PARAMETERS))
    for i, parameter in enumerate(PARAMETERS):
        if parameter.twin:
            j = NAMES.index(parameter.twin)
            shared = max(0.0, 1.0 - (ASYMMETRY / parameter.prior_sd) ** 2)
            covariance[i, j] = covariance[j, i] = shared
    return covariance


def ratio(parameter: ModelParameter, z: float) -> float:
    return math.exp(parameter.prior_sd * z)


class CandidateVehicle(NamedTuple):
    """A candidate: everything a run needs to be simulated."""

    config: VehicleConfig
    model: VehicleModel
    actuators: dict[Plane, Actuator]


def candidate_vehicle(
    prior: VehicleConfig, biases_rad: dict[Plane, float], z: Array
) -> CandidateVehicle:
    """The prior vehicle moved by z; ``biases_rad`` is the prior mean of the actuator bias in each
    plane."""
    ratios, offsets = _ratios_and_offsets(z)
    config = msgspec.structs.replace(
        prior,
        linear=_coefficients(prior, ratios),
        damping=msgspec.structs.replace(
            prior.damping, crossflow_cd=prior.damping.crossflow_cd * ratios["crossflow_cd"]
        ),
        ballast=msgspec.structs.replace(
            prior.ballast, net_buoyancy_n=prior.ballast.net_buoyancy_n + offsets["net_buoyancy"]
        ),
        operating_point=msgspec.structs.replace(
            prior.operating_point, thrust_n=prior.operating_point.thrust_n * ratios["axial_drag"]
        ),
        duct=prior.duct and _wing(prior.duct, ratios, offsets),
        fins=prior.fins and _wing(prior.fins, ratios, offsets),
    )
    return CandidateVehicle(config, build_model.build(config), actuators(prior, biases_rad, z))


class SampledVehicle(NamedTuple):
    """A candidate by chance."""

    number: int
    """Of the draw, those that cannot be counted too."""
    z: Array
    vehicle: CandidateVehicle


def feasible_samples(
    build: Callable[[Array], CandidateVehicle],
    mean: Array,
    covariance: Array,
    normals: Iterable[Array],
) -> Iterator[SampledVehicle]:
    """Candidates that ``build`` makes of draws from a belief about z, one of each of ``normals``,
    without those that cannot be."""
    spread = np.linalg.cholesky(covariance + 1e-12 * np.eye(len(covariance)))
    for number, normal in enumerate(normals):
        z = mean + spread @ normal
        with contextlib.suppress(VehicleFileError):
            yield SampledVehicle(number, z, build(z))


def actuators(
    prior: VehicleConfig, biases_rad: dict[Plane, float], z: Array
) -> dict[Plane, Actuator]:
    """The tailcone's two axes of the same candidate."""
    ratios, offsets = _ratios_and_offsets(z)
    tailcone = prior.tailcone

    def actuator(plane: Plane, surface: str) -> Actuator:
        return Actuator(
            delay_s=max(0.0, tailcone.delay_s + offsets[f"delay_{plane}"]),
            natural_frequency_radps=tailcone.natural_frequency_radps * ratios["natural_frequency"],
            damping_ratio=min(tailcone.damping_ratio * ratios["damping_ratio"], MAX_DAMPING),
            bias_rad=biases_rad[plane] + offsets[f"bias_{surface}"],
            travel_rad=math.radians(tailcone.travel_deg),
            rate_radps=math.radians(tailcone.rate_degps) * ratios["rate_limit"],
            backlash_rad=math.radians(backlash_deg(prior)) * ratios["backlash"],
        )

    return {"yaw": actuator("yaw", "rudder"), "pitch": actuator("pitch", "elevator")}


def backlash_deg(prior: VehicleConfig) -> float:
    """Median of what is believed of the tailcone's play; a file that gives none has not looked for
    it."""
    return prior.tailcone.backlash_deg or ASSUMED_BACKLASH_DEG


def _ratios_and_offsets(z: Array) -> tuple[dict[str, float], dict[str, float]]:
    """(ratios, offsets) by name."""
    values = dict(zip(NAMES, z.tolist(), strict=True))
    return (
        {p.name: ratio(p, values[p.name]) for p in PARAMETERS if p.kind == "ratio"},
        {p.name: p.prior_sd * values[p.name] for p in PARAMETERS if p.kind == "offset"},
    )


def _wing(wing: Wing, ratios: dict[str, float], offsets: dict[str, float]) -> Wing:
    """Duct or fins with another lift beyond their slope."""
    stall, curved = ratios["stall_angle"], offsets["lift_quadratic"] * wing.lift_slope_per_rad
    return msgspec.structs.replace(
        wing,
        lift_quadratic_per_rad2=wing.lift_quadratic_per_rad2 + curved,
        stall_deg=wing.stall_deg * stall,
        separated_deg=wing.separated_deg * stall,
    )


def _coefficients(prior: VehicleConfig, ratios: dict[str, float]) -> msgspec.Struct:
    linear = prior.linear
    changed: dict[str, float] = {}
    for field in linear.__struct_fields__:
        name, value = symbol(field), getattr(linear, field)
        if name in INERTIAS:
            added = getattr(to_table_1_column(linear), INERTIAS[name])
            changed[field] = (value - added) * ratios[name] + added
        elif name in ratios:
            changed[field] = value * ratios[name]
    return msgspec.structs.replace(linear, **changed)


def symbol(field: str) -> str:
    """The symbol of a vehicle file's key: ``Y_v_kgps`` is ``Y_v``."""
    return field.rpartition("_")[0]


def to_table_1_column(linear: msgspec.Struct) -> Table1Column:
    """A vehicle file's linear column under Table 1's symbols."""
    return Table1Column(
        **{symbol(field): getattr(linear, field) for field in linear.__struct_fields__}
    )


def parameters_of_planes(planes: Sequence[Plane]) -> list[int]:
    """Indices of the parameters that runs in ``planes`` depend on."""
    return [i for i, parameter in enumerate(PARAMETERS) if set(parameter.planes) & set(planes)]
