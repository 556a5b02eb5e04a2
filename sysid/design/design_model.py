"""Design model of a vehicle, and the response of its loops to the identified disturbance."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from sitl.vehicle.config import SHIPPED, VehicleConfig
from sysid.control_analysis import loop_transfer
from sysid.control_analysis.loop_transfer import GRID_RADPS, Gains, Lag, Responses
from sysid.control_analysis.margins import Analysis, Planes, analyse
from sysid.design.specification import OPERATING_DEPTH_M, Response
from sysid.estimation.map import model_error
from sysid.estimation.map.fit import linear_plane
from sysid.models import noise, prediction
from sysid.models.greybox import Actuator
from sysid.models.linear_planes import LinearPlane, pitch_plane, yaw_plane
from sysid.models.model_file import IdentifiedModel, NoiseModel
from sysid.models.parameters import NAMES, PARAMETERS, CandidateVehicle, feasible_samples
from sysid.planes import PLANES, Plane
from sysid.reproduction.paper_tables import CARIBOU_TURN_PER_S2, Table1Column

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

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
NOISE_STEP_S = 0.1
"""Sample interval (s) of a model's sensor noise; between samples it is taken as white."""
DEPTH_RATE_S = 0.7
"""Ratio of depth noise to depth rate noise (s), which results from the autopilot's depth filter."""
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


def needs_vehicle_file(model: IdentifiedModel) -> bool:
    """Return whether a model means a vehicle file that is not shipped.

    Parameters
    ----------
    model : IdentifiedModel
        The model.

    Returns
    -------
    bool
        Whether level flight of the model can only be computed from that file.
    """
    return model.method == "map" and model.vehicle.prior not in SHIPPED


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
        Vehicle file of the refit; needed if that file is not shipped.
    depth_m : float
        Depth for which waves are predicted.

    Returns
    -------
    DesignModel
        Both planes with their actuator lags, which include the delay of the sampled control, and
        the identified disturbance.
    """
    if model.method == "map" and (prior is not None or not needs_vehicle_file(model)):
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
        Vehicle file of the refit; needed if that file is not shipped.
    drive_known : bool
        Whether the prior's knowledge of the drive counts; without, only tests and bench test do.
    depth_m : float
        Depth for which waves are predicted.

    Yields
    ------
    DesignModel
        Nothing is yielded for a model without covariance, nor without its vehicle file.
    """
    if not np.any(model.joint.covariance) or (prior is None and model.vehicle.prior not in SHIPPED):
        return
    covariance = (
        np.array(model.joint.covariance) if drive_known else uncertain_drive_covariance(model)
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


def uncertain_drive_covariance(model: IdentifiedModel) -> Array:
    """Return the posterior covariance of z without the prior's knowledge of the drive.

    Parameters
    ----------
    model : IdentifiedModel
        Identified model with the covariance of z.

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
    for name in DRIVE:
        i = NAMES.index(name)
        precision[i, i] -= 1.0 - (PARAMETERS[i].prior_sd / UNMEASURED_DRIVE_SD) ** 2
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


def assume_waves(vehicle: DesignModel, wave_depth_m: float) -> DesignModel:
    """Return a design model with at least this pressure of waves (rms of measured depth, m)."""
    pitch = vehicle.disturbance[Plane.PITCH]
    in_waves = replace(pitch, wave_depth_m=max(pitch.wave_depth_m, wave_depth_m))
    return vehicle._replace(disturbance={**vehicle.disturbance, Plane.PITCH: in_waves})


def analyse_loops(vehicle: DesignModel, gains: Gains) -> Analysis:
    """Return poles and margins with the delay of each plane."""
    return analyse(vehicle.planes, gains, vehicle.yaw_lag, vehicle.pitch_lag)


def spectrum(disturbance: NoiseModel) -> Array:
    """Return the two-sided power spectral density of the disturbing angular acceleration.

    Parameters
    ----------
    disturbance : NoiseModel
        Identified disturbance of one plane.

    Returns
    -------
    ndarray
        Density on `GRID_RADPS`, (rad/s^2)^2 per rad/s over 2 pi.

    Notes
    -----
    First-order slow part (standard deviation s, time constant tau) and second-order wave part
    (standard deviation a, frequency w0, damping zeta)::

        S(w) = 2 s^2 tau / (1 + (w tau)^2)
             + 4 zeta w0^3 a^2 / ((w0^2 - w^2)^2 + (2 zeta w0 w)^2)
    """
    slow = (
        2.0
        * math.radians(disturbance.slow_accel_degps2) ** 2
        * disturbance.slow_time_s
        / (1.0 + (GRID_RADPS * disturbance.slow_time_s) ** 2)
    )
    return slow + _wave_spectrum(disturbance, math.radians(disturbance.wave_accel_degps2))


def _wave_spectrum(disturbance: NoiseModel, sd: float) -> Array:
    """Return the density of a signal in the band of the waves: the second part of `spectrum`."""
    w, wave_radps = GRID_RADPS, 2.0 * math.pi * disturbance.wave_frequency_hz
    band = (wave_radps**2 - w**2) ** 2 + (2.0 * disturbance.wave_damping * wave_radps * w) ** 2
    return np.asarray(4.0 * disturbance.wave_damping * wave_radps**3 * sd**2 / band)


class DisturbanceSource(NamedTuple):
    """A disturbance of one plane."""

    states: ComplexArray
    """States, as measured, per unit of it without control, (frequencies, states)."""
    density: Array
    """Two-sided power spectral density on `GRID_RADPS`."""


def disturbances(vehicle: DesignModel, plane: Plane) -> tuple[DisturbanceSource, ...]:
    """Return the disturbing moment and, in pitch where the model has it, the pressure of waves.

    Parameters
    ----------
    vehicle : DesignModel
        Design model.
    plane : Plane
        Plane.

    Returns
    -------
    tuple of DisturbanceSource
        The pressure of waves (m) moves the measured depth only.
    """
    disturbance = vehicle.disturbance[plane]
    responses = (vehicle.yaw, vehicle.pitch)[PLANES[plane].index]
    moment = DisturbanceSource(responses.moment, spectrum(disturbance))
    if PLANES[plane].is_yaw or not disturbance.wave_depth_m:
        return (moment,)
    measured = np.zeros_like(moment.states)
    measured[:, 3] = 1.0
    return moment, DisturbanceSource(
        measured, _wave_spectrum(disturbance, disturbance.wave_depth_m)
    )


def predict_response(vehicle: DesignModel, gains: Gains) -> Response:
    """Return the standard deviations in closed loop, by the model's disturbance and gyro noise.

    Parameters
    ----------
    vehicle : DesignModel
        Design model.
    gains : Gains
        Parameters of the loops by name.

    Returns
    -------
    Response
        Angles in deg, depth in m.

    Notes
    -----
    Parseval's theorem: sigma^2 = (1 / pi) integral of |G(jw)|^2 S(w) dw over w > 0.
    """
    heading, rudder = heading_rms(vehicle, gains)
    pitch, depth, elevator = depth_rms(vehicle, gains)
    yaw_noise, pitch_noise = (noise_rms(vehicle, plane, gains) for plane in Plane)
    rudder_noise, elevator_noise = (command_noise_rad(vehicle, plane, gains) for plane in Plane)
    return Response(
        heading_deg=math.degrees(math.hypot(heading, yaw_noise[2])),
        pitch_deg=math.degrees(math.hypot(pitch, pitch_noise[2])),
        depth_m=math.hypot(depth, pitch_noise[3]),
        rudder_deg=math.degrees(math.hypot(rudder, rudder_noise)),
        elevator_deg=math.degrees(math.hypot(elevator, elevator_noise)),
    )


def heading_rms(vehicle: DesignModel, gains: Gains) -> tuple[float, float]:
    """Return the rms of heading and commanded rudder (rad)."""
    density = spectrum(vehicle.disturbance[Plane.YAW])
    heading, rudder = heading_responses(vehicle, gains)
    return _rms(heading, density), _rms(rudder, density)


def heading_responses(vehicle: DesignModel, gains: Gains) -> tuple[ComplexArray, ComplexArray]:
    """Return heading and commanded rudder per unit of disturbing angular acceleration.

    Notes
    -----
    With S = 1 / (1 + L_rudder) and the responses r_m, psi_m to the moment: psi = S psi_m and
    rudder = S F (HDG_D r_m + (HDG_P + HDG_I / s) psi_m), F the filters of the command.
    """
    s = 1j * GRID_RADPS
    sensitivity = 1.0 / (1.0 + loop_transfer.heading_loops(vehicle.yaw, gains)["rudder"])
    r, psi = vehicle.yaw.moment[:, 1], vehicle.yaw.moment[:, 2]
    rudder = gains["HDG_D"] * r + (gains["HDG_P"] + gains["HDG_I"] / s) * psi
    filters = loop_transfer.filter_response(loop_transfer.command_filters(Plane.YAW, gains))
    return psi * sensitivity, rudder * filters * sensitivity


def depth_rms(vehicle: DesignModel, gains: Gains) -> tuple[float, float, float]:
    """Return the rms of pitch (rad), measured depth (m) and commanded elevator (rad)."""
    deviations = [
        [_rms(signal, source.density) for signal in depth_responses(vehicle, gains, source.states)]
        for source in disturbances(vehicle, Plane.PITCH)
    ]
    pitch, depth, elevator = (math.hypot(*each) for each in zip(*deviations, strict=True))
    return pitch, depth, elevator


def depth_responses(
    vehicle: DesignModel, gains: Gains, disturbed: ComplexArray
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Return pitch, measured depth and commanded elevator per unit of a disturbance.

    Parameters
    ----------
    vehicle : DesignModel
        Design model.
    gains : Gains
        Parameters of the loops by name.
    disturbed : ndarray
        States per unit of the disturbance without control, (frequencies, states).

    Returns
    -------
    tuple of ndarray
        Responses on `GRID_RADPS`.

    Notes
    -----
    As `heading_responses`. States respond to the disturbance and to the elevator that the loop
    commands.
    """
    s = 1j * GRID_RADPS
    sensitivity = 1.0 / (1.0 + loop_transfer.depth_loops(vehicle.pitch, gains)["elevator"])
    q, theta = disturbed[:, 1], disturbed[:, 2]
    forward = gains["PTCH_P"] + gains["PTCH_I"] / s
    elevator = gains["PTCH_D"] * q + forward * (
        theta - loop_transfer.pitch_command(disturbed, gains)
    )
    filters = loop_transfer.filter_response(loop_transfer.command_filters(Plane.PITCH, gains))
    command = elevator * filters * sensitivity
    states = disturbed - vehicle.pitch.command * command[:, None]
    return states[:, 2], states[:, 3], command


def command_noise_rad(vehicle: DesignModel, plane: Plane, gains: Gains) -> float:
    """Return the standard deviation of the surface command caused by gyro noise (rad).

    Parameters
    ----------
    vehicle : DesignModel
        Design model.
    plane : str
        yaw or pitch.
    gains : Gains
        Parameters of the loops by name.

    Returns
    -------
    float
        Standard deviation (rad).

    Notes
    -----
    sigma^2 = (n^2 / pi) integral of |K F / (1 + L)|^2 dw with the gyro's density n^2, the rate
    gain K and the command's filters F. Above the grid, up to half the sample rate, L is taken as
    zero.
    """
    density, shaped, closed = _noise_command(vehicle, plane, gains)
    on_grid = float(np.trapezoid(np.abs(closed) ** 2, GRID_RADPS))
    above_grid = abs(shaped[-1]) ** 2 * (math.pi / loop_transfer.TICK_S - GRID_RADPS[-1])
    return math.sqrt(density * (on_grid + above_grid) / math.pi)


def noise_rms(vehicle: DesignModel, plane: Plane, gains: Gains) -> Array:
    """Return the standard deviations of the states of a plane caused by gyro noise (rad, m, s).

    As `command_noise_rad`, with the response of the states to the command; none above the grid.
    """
    density, _, closed = _noise_command(vehicle, plane, gains)
    states = (vehicle.yaw, vehicle.pitch)[PLANES[plane].index].command * closed[:, None]
    powers = np.trapezoid(np.abs(states) ** 2, GRID_RADPS, axis=0)
    return np.asarray(np.sqrt(density * powers / math.pi))


def _noise_command(
    vehicle: DesignModel, plane: Plane, gains: Gains
) -> tuple[float, ComplexArray, ComplexArray]:
    """Return the gyro's density, and its responses to the command: K F, and K F / (1 + L)."""
    density = math.radians(vehicle.disturbance[plane].rate_noise_degps) ** 2 * NOISE_STEP_S
    loop, gain = loop_at_surface(vehicle, plane, gains)
    shaped = gain * loop_transfer.filter_response(loop_transfer.command_filters(plane, gains))
    return density, shaped, shaped / (1.0 + loop)


def loop_at_surface(vehicle: DesignModel, plane: Plane, gains: Gains) -> tuple[ComplexArray, float]:
    """Return the loop opened at the surface, and the gain from gyro to command."""
    traits = PLANES[plane]
    responses = (vehicle.yaw, vehicle.pitch)[traits.index]
    loop = loop_transfer.surface_loop(plane, responses, gains)
    return loop, gains[f"{traits.gain_prefix}_D"]


def _rms(transfer: ComplexArray, density: Array) -> float:
    """Return the standard deviation of an output with this response to noise of this density."""
    return math.sqrt(float(np.trapezoid(np.abs(transfer) ** 2 * density, GRID_RADPS)) / math.pi)
