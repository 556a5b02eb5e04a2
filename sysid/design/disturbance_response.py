"""Response of the loops of a design model to the identified disturbance and to gyro noise."""

import math
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from mavlink_io.tick import TICK_S
from sysid.control_analysis import loop_transfer
from sysid.control_analysis.loop_transfer import GRID_RADPS, Gains
from sysid.design.design_model import DesignModel
from sysid.design.specification import Response, Spec
from sysid.models.model_file import NoiseModel
from sysid.planes import PLANES, Plane

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

NOISE_STEP_S = 0.1
"""Sample interval (s) of a model's sensor noise; between samples it is taken as white."""
DEPTH_RATE_S = 0.7
"""Ratio of depth noise to depth rate noise (s), which results from the autopilot's depth filter."""


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
    moment = DisturbanceSource(vehicle.responses(plane).moment, spectrum(disturbance))
    if PLANES[plane].is_yaw or not disturbance.wave_depth_m:
        return (moment,)
    measured = np.zeros_like(moment.states)
    measured[:, 3] = 1.0
    return moment, DisturbanceSource(
        measured, _wave_spectrum(disturbance, disturbance.wave_depth_m)
    )


def assume_waves(vehicle: DesignModel, initial: Gains, spec: Spec) -> DesignModel:
    """Return a design model with at least the pressure of waves that `spec` assumes.

    Parameters
    ----------
    vehicle : DesignModel
        Design model.
    initial : Gains
        Initial gains.
    spec : Spec
        `assumed_wave_depth_m` and `assumed_wave_ratio`.

    Returns
    -------
    DesignModel
        The model with the largest pressure of these two and the tests.
    """
    pitch, (_, depth_m, _) = vehicle.disturbance[Plane.PITCH], depth_rms(vehicle, initial)
    assumed_m = max(spec.assumed_wave_depth_m, spec.assumed_wave_ratio * depth_m)
    in_waves = replace(pitch, wave_depth_m=max(pitch.wave_depth_m, assumed_m))
    return vehicle._replace(disturbance={**vehicle.disturbance, Plane.PITCH: in_waves})


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
    plane : Plane
        Plane.
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
    return math.sqrt(density * (on_grid + _above_grid(shaped)) / math.pi)


def noise_above_grid_rad(vehicle: DesignModel, plane: Plane, gains: Gains) -> float:
    """Return the part of `command_noise_rad` above the frequencies of the grid (rad)."""
    density, shaped, _ = _noise_command(vehicle, plane, gains)
    return math.sqrt(density * _above_grid(shaped) / math.pi)


def _above_grid(shaped: ComplexArray) -> float:
    """Return the integral of |K F|^2 from the end of the grid up to half the sample rate."""
    return float(abs(shaped[-1]) ** 2 * (math.pi / TICK_S - GRID_RADPS[-1]))


def noise_rms(vehicle: DesignModel, plane: Plane, gains: Gains) -> Array:
    """Return the standard deviations of the states of a plane caused by gyro noise (rad, m, s).

    As `command_noise_rad`, with the response of the states to the command; none above the grid.
    """
    density, _, closed = _noise_command(vehicle, plane, gains)
    states = vehicle.responses(plane).command * closed[:, None]
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
    loop = loop_transfer.surface_loop(plane, vehicle.responses(plane), gains)
    return loop, gains[f"{PLANES[plane].gain_prefix}_D"]


def _rms(transfer: ComplexArray, density: Array) -> float:
    """Return the standard deviation of an output with this response to noise of this density."""
    return math.sqrt(float(np.trapezoid(np.abs(transfer) ** 2 * density, GRID_RADPS)) / math.pi)
