"""Design model of a vehicle: its linear planes, their lags and the identified disturbance."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.vehicle.config import VehicleConfig
from sysid.control_analysis import loop_transfer
from sysid.control_analysis.loop_transfer import Gains, Lag, Responses
from sysid.control_analysis.margins import Analysis, Planes, analyse
from sysid.design.specification import OPERATING_DEPTH_M
from sysid.estimation.map import model_error
from sysid.estimation.map.steady_state import linear_plane
from sysid.models import noise, parameters, prediction
from sysid.models.greybox import Actuator
from sysid.models.linear_planes import LinearPlane, pitch_plane, yaw_plane
from sysid.models.model_file import IdentifiedModel, NoiseModel
from sysid.models.parameters import NAMES, CandidateVehicle, feasible_samples
from sysid.planes import PLANES, Plane
from sysid.reproduction.paper_tables import CARIBOU_TURN_PER_S2, Table1Column

Array = NDArray[np.float64]

DEFAULT_DISTURBANCE = NoiseModel(
    slow_accel_degps2=0.14,
    slow_time_s=3.0,
    wave_accel_degps2=0.28,
    wave_frequency_hz=0.15,
    wave_damping=0.1,
    rate_noise_degps=0.05,
    angle_noise_deg=0.1,
    depth_noise_m=0.005,
    force_noise_mps15=0.0,
)
"""Disturbance assumed for a model without a noise model.

It causes 0.3 deg/s rms of rate by the slow part and as much by waves.
"""
SEED = 2001
"""Seed of the samples of a model's posterior."""
UNMEASURED_DRIVE_SD = 0.4
"""Standard deviation of the logarithm of a drive's lag and damping without a bench test.

The lag stands for a drive whose form is unknown. Above its bandwidth a first-order servo has the
gain of a second-order lag with a natural frequency 1.5 times as high.
"""
MIN_FIRST_ORDER_DAMPING = 0.8
"""Damping ratio from which an identified second-order lag may stand for a first-order drive.

The two then differ by at most 0.3 dB and 2 degrees up to half the natural frequency of the lag.
"""
FAR_POLE = 20.0
"""Ratio of the two poles of a lag that represents a first-order drive."""
DRIVE = ("natural_frequency", "damping_ratio")
"""Parameters of the drive's lag."""
NOT_SCALED_BY_EFFECTIVENESS = (
    "DPT_P",
    "DPT_D",
    "DPT_I",
    "ACT_LEAD_W",
    "ACT_LEAD_Z",
    *(f"{prefix}_PEAK_{name}" for prefix in ("HDG", "PTCH") for name in ("W", "Z", "GAIN")),
)
"""Parameters that do not scale with control effectiveness: they map no error to a duct angle."""


class DesignModel(NamedTuple):
    """Linear planes, lags with the delay of sampling, disturbances and frequency responses."""

    planes: Planes
    yaw_lag: Lag
    pitch_lag: Lag
    disturbance: Mapping[Plane, NoiseModel]
    yaw: Responses
    pitch: Responses

    def responses(self, plane: Plane) -> Responses:
        """Return the frequency responses of a plane.

        Parameters
        ----------
        plane : Plane
            Plane.

        Returns
        -------
        Responses
            Responses on `GRID_RADPS`.
        """
        return (self.yaw, self.pitch)[PLANES[plane].index]


def build(
    planes: Planes, yaw_lag: Lag, pitch_lag: Lag, disturbance: Mapping[Plane, NoiseModel]
) -> DesignModel:
    """Return the design model of two planes.

    Parameters
    ----------
    planes : Planes
        Linear yaw and pitch plane, FRD axes.
    yaw_lag, pitch_lag : Lag
        Tailcone of each plane, with the delay of sampling.
    disturbance : Mapping
        Disturbance model of each plane.

    Returns
    -------
    DesignModel
        With the frequency responses of both planes.
    """
    return DesignModel(
        planes=planes,
        yaw_lag=yaw_lag,
        pitch_lag=pitch_lag,
        disturbance=disturbance,
        yaw=loop_transfer.responses(planes.yaw, yaw_lag),
        pitch=loop_transfer.responses(planes.pitch, pitch_lag),
    )


def outputs(plane: LinearPlane) -> Array:
    """Return the output matrix of what the autopilot measures, (outputs, states).

    Parameters
    ----------
    plane : LinearPlane
        Linear plane.

    Returns
    -------
    ndarray
        Rows r, psi in yaw; q, theta, depth, depth rate in pitch.
    """
    rows = np.eye(len(plane.B))[1:]
    return rows if "depth" not in plane.states else np.vstack([rows, plane.A[3]])


def scale_starts(
    starts: Sequence[Mapping[str, float]], plane: LinearPlane
) -> tuple[dict[str, float], ...]:
    """Scale the starting points of a search from Caribou to another vehicle.

    Parameters
    ----------
    starts : Sequence of Mapping
        Gains by name that suit Caribou.
    plane : LinearPlane
        Plane of the vehicle.

    Returns
    -------
    tuple of dict
        Gains divided by the ratio of control effectiveness (angular acceleration per radian of
        duct, 1/s^2): higher effectiveness needs smaller gains for the same loop.
    """
    ratio = CARIBOU_TURN_PER_S2 / abs(float(plane.B[1]))
    return tuple(
        {
            name: gain * (1.0 if name in NOT_SCALED_BY_EFFECTIVENESS else ratio)
            for name, gain in start.items()
        }
        for start in starts
    )


def from_model(
    model: IdentifiedModel,
    prior: VehicleConfig | None = None,
    depth_m: float = OPERATING_DEPTH_M,
) -> DesignModel:
    """Return the design model of an identified model: level flight if its vehicle file is known.

    Parameters
    ----------
    model : IdentifiedModel
        Content of a model file.
    prior : VehicleConfig, optional
        Vehicle file of the refit; by default the one in the model.
    depth_m : float
        Depth for which waves are predicted.

    Returns
    -------
    DesignModel
        Both planes with their actuator lags, which include the delay of the sampled control, and
        the identified disturbance.
    """
    if model.method == "map":
        return from_vehicle(prediction.vehicles(model, prior)[0], _disturbance_of(model, depth_m))
    coefficients = Table1Column(
        **{name: coefficient.value for name, coefficient in model.coefficients.items()}
    )
    planes = Planes(
        yaw_plane(coefficients, model.speed_mps, model.vehicle.mass_kg),
        pitch_plane(coefficients, model.speed_mps, model.vehicle.mass_kg),
    )

    def lag(plane: Plane) -> Lag:
        """Return the identified tailcone of a plane."""
        delay_s = model.planes[plane].delay_s.value + loop_transfer.SAMPLING_S
        return Lag(
            delay_s, model.vehicle.natural_frequency_radps.value, model.vehicle.damping_ratio.value
        )

    return build(planes, lag(Plane.YAW), lag(Plane.PITCH), _disturbance_of(model, depth_m))


def sample_models(
    model: IdentifiedModel,
    count: int,
    prior: VehicleConfig | None = None,
    drive_known: bool = True,
    depth_m: float = OPERATING_DEPTH_M,
) -> Iterator[DesignModel]:
    """Yield up to `count` vehicles drawn from a model's posterior of z.

    Parameters
    ----------
    model : IdentifiedModel
        Identified model with the mean and covariance of z.
    count : int
        Number of draws; physically impossible vehicles are skipped.
    prior : VehicleConfig, optional
        Vehicle file of the refit; by default the one in the model.
    drive_known : bool
        Whether the prior's knowledge of the drive counts; without, only tests and bench test do.
    depth_m : float
        Depth for which waves are predicted.

    Yields
    ------
    DesignModel
        Nothing is yielded for a model without covariance.
    """
    if not np.any(model.joint.covariance):
        return
    covariance = (
        np.array(model.joint.covariance)
        if drive_known
        else uncertain_drive_covariance(model, prediction.prior_vehicle(model, prior))
    )
    draws = np.random.default_rng(SEED).standard_normal((count, len(covariance)))
    for sample in feasible_samples(
        lambda z: prediction.perturb(model, z, prior), np.array(model.joint.z), covariance, draws
    ):
        yield from_vehicle(sample.vehicle, _disturbance_of(model, depth_m))


def drive_forms(vehicle: DesignModel) -> tuple[DesignModel, ...]:
    """Return a design model, and the same with a first-order drive if the tests allow for one.

    Parameters
    ----------
    vehicle : DesignModel
        Design model; its drive is a second-order lag.

    Returns
    -------
    tuple of DesignModel
        The second is missing if the drive has less damping than `MIN_FIRST_ORDER_DAMPING`.

    Notes
    -----
    Up to the second order in frequency, gain and phase of the lag (w0, zeta, delay T) are those of
    the poles a and b = `FAR_POLE` a with delay T'::

        1 / a^2 + 1 / b^2 = (4 zeta^2 - 2) / w0^2,    T' = T + 2 zeta / w0 - 1 / a - 1 / b

    At higher frequencies the first-order drive has more gain, and the actuator lead increases it.
    """
    lags = vehicle.yaw_lag, vehicle.pitch_lag
    if min(lag.damping_ratio for lag in lags) < MIN_FIRST_ORDER_DAMPING:
        return (vehicle,)
    yaw, pitch = map(_first_order, lags)
    return vehicle, build(vehicle.planes, yaw, pitch, vehicle.disturbance)


def _first_order(lag: Lag) -> Lag:
    """Return the lag with poles a and b of `drive_forms`."""
    w0, zeta = lag.natural_frequency_radps, lag.damping_ratio
    a = w0 * math.sqrt((1.0 + FAR_POLE**-2) / (4.0 * zeta**2 - 2.0))
    b = FAR_POLE * a
    return Lag(
        delay_s=lag.delay_s + 2.0 * zeta / w0 - 1.0 / a - 1.0 / b,
        natural_frequency_radps=math.sqrt(a * b),
        damping_ratio=0.5 * (a + b) / math.sqrt(a * b),
    )


def uncertain_drive_covariance(model: IdentifiedModel, prior: VehicleConfig | None = None) -> Array:
    """Return the posterior covariance of z without the prior's knowledge of the drive.

    Parameters
    ----------
    model : IdentifiedModel
        Identified model with the covariance of z.
    prior : VehicleConfig, optional
        Vehicle file of the refit; by default the one in the model.

    Returns
    -------
    ndarray, (p, p)
        Covariance in which tests and bench test inform natural frequency and damping ratio of the
        drive, and the prior gives them a standard deviation of `UNMEASURED_DRIVE_SD`.

    Notes
    -----
    Tests show the sum of lag and delay, but not the gain above the tested frequencies, where the
    loop has its gain margin. The vehicle file states one pair of numbers. With C the covariance,
    C_s its part by errors of the structure, s the prior standard deviation of the fit and S =
    `UNMEASURED_DRIVE_SD`, both parameters of the drive being independent of the others before::

        C' = ((C - C_s)^-1 - D)^-1 + C_s,    D_ii = 1 - (s_i / S)^2 for the drive, else 0
    """
    structure = model_error.structure_covariance(
        model.joint.run_scatter, model.joint.prior_conflict
    )
    precision = np.linalg.inv(np.array(model.joint.covariance) - structure)
    vehicle = prediction.prior_vehicle(model, prior)
    for name in DRIVE:
        i, sd = NAMES.index(name), parameters.prior_sd(vehicle, name)
        precision[i, i] -= max(0.0, 1.0 - (sd / UNMEASURED_DRIVE_SD) ** 2)
    return np.asarray(np.linalg.inv(precision) + structure)


def from_vehicle(vehicle: CandidateVehicle, disturbance: Mapping[Plane, NoiseModel]) -> DesignModel:
    """Return the design model of a fully known vehicle.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Vehicle configuration and actuators.
    disturbance : mapping of {'yaw', 'pitch'} to NoiseModel
        Disturbance of each plane.

    Returns
    -------
    DesignModel
        Both planes with their actuator lags, which include the delay of the sampled control.
    """
    planes = Planes(linear_plane(vehicle, Plane.YAW), linear_plane(vehicle, Plane.PITCH))
    return build(
        planes,
        lag_with_sampling(vehicle.actuators[Plane.YAW]),
        lag_with_sampling(vehicle.actuators[Plane.PITCH]),
        disturbance,
    )


def lag_with_sampling(tail: Actuator) -> Lag:
    """Return the lag of a tailcone with the delay of sampling added."""
    return Lag(
        tail.delay_s + loop_transfer.SAMPLING_S, tail.natural_frequency_radps, tail.damping_ratio
    )


def _disturbance_of(model: IdentifiedModel, depth_m: float) -> Mapping[Plane, NoiseModel]:
    """Return the disturbance model of each plane at a depth."""
    disturbance = {plane: model.noise.get(plane, DEFAULT_DISTURBANCE) for plane in Plane}
    if not disturbance[Plane.PITCH].wave_depth_m:
        return disturbance
    levels = {plane: noise.from_model(level) for plane, level in disturbance.items()}
    levels = noise.at_depth(levels, depth_m)
    return {plane: noise.to_model(level) for plane, level in levels.items()}


def analyse_loops(vehicle: DesignModel, gains: Gains) -> Analysis:
    """Return poles and margins with the delay of each plane."""
    return analyse(vehicle.planes, gains, vehicle.yaw_lag, vehicle.pitch_lag)
