"""A model as the designer sees it, and what the sea does to its loops."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.config import SHIPPED, VehicleConfig
from sysid.control_analysis import loop_transfer
from sysid.control_analysis.loop_transfer import GRID_RADPS, Gains, Lag, Responses
from sysid.control_analysis.margins import Analysis, Planes, analyse
from sysid.data.segments import Plane
from sysid.design.specification import Response
from sysid.estimation.map.fit import linear_plane
from sysid.models import prediction
from sysid.models.greybox import Actuator
from sysid.models.linear_planes import LinearPlane, pitch_plane, yaw_plane
from sysid.models.model_file import IdentifiedModel, NoiseModel
from sysid.models.parameters import CandidateVehicle, feasible_samples
from sysid.reproduction.paper_tables import CARIBOU_TURN_PER_S2, Table1Column

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

DEFAULT_DISTURBANCE = NoiseModel(0.14, 3.0, 0.28, 0.15, 0.1, 0.05, 0.1, 0.005, 0.0)
"""Disturbance assumed where a model carries none: 0.3 deg/s rms of rate from the slow part and as
much from waves."""
NOISE_STEP_S = 0.1
"""Samples of a model's sensor noise are so far apart; between them it is white."""
SEED = 2001
NOT_SCALED_BY_EFFECTIVENESS = ("DPT_P", "DPT_D", "DPT_I", "ACT_LEAD_W")
"""What does not turn an error into an angle of the duct."""


class DesignModel(NamedTuple):
    """Planes, tailcone lags with sampling, the sea, and the planes' responses with all of it."""

    planes: Planes
    yaw_lag: Lag
    pitch_lag: Lag
    sea: Mapping[Plane, NoiseModel]
    yaw: Responses
    pitch: Responses


def build(
    planes: Planes, yaw_lag: Lag, pitch_lag: Lag, sea: Mapping[Plane, NoiseModel]
) -> DesignModel:
    return DesignModel(
        planes,
        yaw_lag,
        pitch_lag,
        sea,
        loop_transfer.responses(planes.yaw, yaw_lag),
        loop_transfer.responses(planes.pitch, pitch_lag),
    )


def scale_starts(
    starts: Sequence[Mapping[str, float]], plane: LinearPlane
) -> tuple[dict[str, float], ...]:
    """Starts of a search, tried on Caribou: a livelier tail needs smaller gains for the same
    loop."""
    ratio = CARIBOU_TURN_PER_S2 / abs(float(plane.B[1]))
    return tuple(
        {
            name: gain * (1.0 if name in NOT_SCALED_BY_EFFECTIVENESS else ratio)
            for name, gain in start.items()
        }
        for start in starts
    )


def from_model(model: IdentifiedModel) -> DesignModel:
    coefficients = Table1Column(**{name: c.value for name, c in model.coefficients.items()})
    planes = Planes(
        yaw_plane(coefficients, model.speed_mps, model.vehicle.mass_kg),
        pitch_plane(coefficients, model.speed_mps, model.vehicle.mass_kg),
    )

    def lag(plane: Plane) -> Lag:
        delay = model.planes[plane].delay_s.value + loop_transfer.SAMPLING_S
        return Lag(
            delay, model.vehicle.natural_frequency_radps.value, model.vehicle.damping_ratio.value
        )

    return build(planes, lag("yaw"), lag("pitch"), _disturbance_of(model))


def sample_models(
    model: IdentifiedModel, count: int, prior: VehicleConfig | None = None
) -> Iterator[DesignModel]:
    """Up to ``count`` vehicles that a model allows for: draws from what it says of z, without those
    that cannot be.

    There are none where a model does not say, nor without ``prior`` where the file it was refitted
    from is not shipped."""
    covariance = np.array(model.joint.covariance)
    if not np.any(covariance) or (prior is None and model.vehicle.prior not in SHIPPED):
        return
    draws = np.random.default_rng(SEED).standard_normal((count, len(covariance)))
    for drawn in feasible_samples(
        lambda z: prediction.perturb(model, z, prior), np.array(model.joint.z), covariance, draws
    ):
        yield from_vehicle(drawn.vehicle, _disturbance_of(model))


def from_vehicle(vehicle: CandidateVehicle, sea: Mapping[Plane, NoiseModel]) -> DesignModel:
    """Any vehicle of which everything is known."""
    planes = Planes(linear_plane(vehicle, "yaw"), linear_plane(vehicle, "pitch"))
    return build(
        planes,
        lag_with_sampling(vehicle.actuators["yaw"]),
        lag_with_sampling(vehicle.actuators["pitch"]),
        sea,
    )


def lag_with_sampling(tail: Actuator) -> Lag:
    """A tailcone's lag, with what sampling adds to its delay."""
    return Lag(
        tail.delay_s + loop_transfer.SAMPLING_S, tail.natural_frequency_radps, tail.damping_ratio
    )


def _disturbance_of(model: IdentifiedModel) -> Mapping[Plane, NoiseModel]:
    return {plane: model.noise.get(plane, DEFAULT_DISTURBANCE) for plane in ("yaw", "pitch")}


def analyse_loops(vehicle: DesignModel, gains: Gains) -> Analysis:
    """Poles and margins with each plane's own delay."""
    return analyse(vehicle.planes, gains, vehicle.yaw_lag, vehicle.pitch_lag)


def spectrum(sea: NoiseModel) -> Array:
    """Two-sided density of the disturbing angular acceleration on the grid, (rad/s^2)^2 per rad/s
    over 2 pi."""
    w, wave = GRID_RADPS, 2.0 * math.pi * sea.wave_frequency_hz
    slow = (
        2.0
        * math.radians(sea.slow_accel_degps2) ** 2
        * sea.slow_time_s
        / (1.0 + (w * sea.slow_time_s) ** 2)
    )
    band = (wave**2 - w**2) ** 2 + (2.0 * sea.wave_damping * wave * w) ** 2
    return np.asarray(
        slow + 4.0 * sea.wave_damping * wave**3 * math.radians(sea.wave_accel_degps2) ** 2 / band
    )


def predict_response(vehicle: DesignModel, gains: Gains) -> Response:
    """Standard deviations in closed loop under the sea of the model (Parseval)."""
    heading, rudder = heading_rms(vehicle, gains)
    pitch, depth, elevator = depth_rms(vehicle, gains)
    return Response(
        math.degrees(heading),
        math.degrees(pitch),
        depth,
        math.degrees(rudder),
        math.degrees(elevator),
    )


def heading_rms(vehicle: DesignModel, gains: Gains) -> tuple[float, float]:
    """(heading, rudder wanted), rad."""
    density = spectrum(vehicle.sea["yaw"])
    heading, rudder = heading_responses(vehicle, gains)
    return _rms(heading, density), _rms(rudder, density)


def heading_responses(vehicle: DesignModel, gains: Gains) -> tuple[ComplexArray, ComplexArray]:
    """(heading, rudder wanted) in closed loop to a unit of disturbing angular acceleration."""
    s = 1j * GRID_RADPS
    sensitivity = 1.0 / (1.0 + loop_transfer.heading_loops(vehicle.yaw, gains)["rudder"])
    r, psi = vehicle.yaw.moment[:, 1], vehicle.yaw.moment[:, 2]
    rudder = gains["HDG_D"] * r + (gains["HDG_P"] + gains["HDG_I"] / s) * psi
    return psi * sensitivity, rudder * sensitivity


def depth_rms(vehicle: DesignModel, gains: Gains) -> tuple[float, float, float]:
    """(pitch, depth, elevator wanted), rad, m, rad."""
    density = spectrum(vehicle.sea["pitch"])
    pitch, depth, elevator = depth_responses(vehicle, gains)
    return _rms(pitch, density), _rms(depth, density), _rms(elevator, density)


def depth_responses(
    vehicle: DesignModel, gains: Gains
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """(pitch, depth, elevator wanted) in closed loop to a unit of disturbing angular
    acceleration."""
    s = 1j * GRID_RADPS
    sensitivity = 1.0 / (1.0 + loop_transfer.depth_loops(vehicle.pitch, gains)["elevator"])
    q, theta = vehicle.pitch.moment[:, 1], vehicle.pitch.moment[:, 2]
    forward = gains["PTCH_P"] + gains["PTCH_I"] / s
    elevator = gains["PTCH_D"] * q + forward * (
        theta - loop_transfer.pitch_command(vehicle.pitch.moment, gains)
    )
    # Every state answers to the moment and to the elevator's reply to it.
    reply = (
        vehicle.pitch.moment
        - loop_transfer.with_lead(vehicle.pitch, gains).command * (elevator * sensitivity)[:, None]
    )
    return reply[:, 2], reply[:, 3], elevator * sensitivity


def command_noise_rad(vehicle: DesignModel, plane: Plane, gains: Gains) -> float:
    """What the gyro's noise moves the surface's command by, one standard deviation.

    Up to the grid's end in closed loop; beyond it, to half the tick's rate, no loop answers any
    more."""
    density = math.radians(vehicle.sea[plane].rate_noise_degps) ** 2 * NOISE_STEP_S
    loop, gain = loop_at_surface(vehicle, plane, gains)
    shaped = gain * loop_transfer.lead_response(gains)
    within = float(np.trapezoid(np.abs(shaped / (1.0 + loop)) ** 2, GRID_RADPS))
    beyond = abs(shaped[-1]) ** 2 * (math.pi / loop_transfer.TICK_S - GRID_RADPS[-1])
    return math.sqrt(density * (within + beyond) / math.pi)


def loop_at_surface(vehicle: DesignModel, plane: Plane, gains: Gains) -> tuple[ComplexArray, float]:
    """The loop opened at the surface, and the gain from gyro to what is wanted of it."""
    if plane == "yaw":
        return loop_transfer.heading_loops(vehicle.yaw, gains)["rudder"], gains["HDG_D"]
    return loop_transfer.depth_loops(vehicle.pitch, gains)["elevator"], gains["PTCH_D"]


def _rms(transfer: ComplexArray, density: Array) -> float:
    return math.sqrt(float(np.trapezoid(np.abs(transfer) ** 2 * density, GRID_RADPS)) / math.pi)
