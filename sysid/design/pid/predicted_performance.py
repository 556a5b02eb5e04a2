"""Predicted statistics of steady flight under designed gains: the baseline for monitoring.

For each measured quantity with two-sided density S(w) on the grid::

    variance          = (1 / pi) integral S dw                                  (Parseval)
    variance of means = (1 / pi) integral S sinc^2(w T / 2) dw,  T = AVERAGED_S
    correlation time  = integral S_b^2 dw / pi / (integral S_b dw / pi)^2

S_b = S (1 - sinc^2(w T / 2)) is the density about the mean of a window. Samples one correlation
time apart count as independent in an estimate of the variance.
"""

import importlib.metadata
import math
from typing import NamedTuple

import numpy as np
from msgspec.structs import asdict
from numpy.typing import NDArray

from sysid.control_analysis import loop_transfer
from sysid.control_analysis.loop_transfer import GRID_RADPS, Gains
from sysid.design.design_model import SEED, DesignModel
from sysid.design.disturbance_response import (
    NOISE_STEP_S,
    depth_responses,
    disturbances,
    heading_responses,
    loop_at_surface,
    noise_above_grid_rad,
    spectrum,
)
from sysid.design.specification import DesignRobustness, Spec
from sysid.models.model_file import IdentifiedModel, ParameterEstimate, sha256_of_model
from sysid.monitor.performance_spec import (
    AVERAGED_S,
    RESONANCE_BANDWIDTH,
    PerformanceBaseline,
    PredictedStatistic,
    Robustness,
)
from sysid.planes import Plane

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

RESONANCE_RANGE_RADPS = (0.3, 6.0)
"""Frequency range (rad/s) in which a loop of any vehicle can have its resonance.

Outside it the largest sensitivity is caused by the grid or the delay.
"""


class _MeasuredQuantity(NamedTuple):
    """One quantity as telemetry reports it."""

    density: Array
    """Two-sided power spectral density on the grid, in the quantity's unit squared per rad/s."""
    mean: float
    mean_sd: float
    variance_above_grid: float = 0.0
    """Variance at frequencies above those of the grid."""


def performance_baseline(
    model: IdentifiedModel,
    vehicle: DesignModel,
    gains: Gains,
    spec: Spec,
    robust: DesignRobustness | None,
) -> PerformanceBaseline:
    """Return the performance baseline of gains that were designed on a model.

    Parameters
    ----------
    model : IdentifiedModel
        Identified model with biases and level flight.
    vehicle : DesignModel
        Design model of it.
    gains : Gains
        Designed parameters by name.
    spec : Spec
        Specification of the design.
    robust : DesignRobustness or None
        Robustness of the design; None for a model without covariance.

    Returns
    -------
    PerformanceBaseline
        Predicted statistics by quantity (deg, m), and the resonance of each plane (rad/s).
    """
    resonances_radps = (
        _resonance_radps(vehicle, Plane.YAW, gains),
        _resonance_radps(vehicle, Plane.PITCH, gains),
    )
    quantities = {
        **_yaw_quantities(model, vehicle, gains, resonances_radps[0]),
        **_pitch_quantities(model, vehicle, gains, resonances_radps[1]),
    }
    return PerformanceBaseline(
        model_sha256=sha256_of_model(model),
        version=importlib.metadata.version("caribou-auv"),
        speed_mps=model.speed_mps,
        thrust=model.thrust_fraction,
        heading_resonance_radps=resonances_radps[0],
        pitch_resonance_radps=resonances_radps[1],
        specification=asdict(spec),
        predicted={name: _predict_statistic(quantity) for name, quantity in quantities.items()},
        robustness=None
        if robust is None
        else Robustness(
            specification=robust.specification,
            relaxed=robust.relaxed,
            vehicles=robust.vehicles,
            seed=SEED,
        ),
    )


def _band(radps: float) -> Array:
    """Return |H|^2 of a second-order resonance filter, one at its peak.

    |H|^2 = 1 / (1 + ((w / w0 - w0 / w) / B)^2) with B = `RESONANCE_BANDWIDTH`.
    """
    detuned = (GRID_RADPS / radps - radps / GRID_RADPS) / RESONANCE_BANDWIDTH
    return np.asarray(1.0 / (1.0 + detuned**2))


def _yaw_quantities(
    model: IdentifiedModel, vehicle: DesignModel, gains: Gains, resonance_radps: float
) -> dict[str, _MeasuredQuantity]:
    """Return heading, its resonance band and rudder."""
    heading, rudder = heading_responses(vehicle, gains)
    disturbance = spectrum(vehicle.disturbance[Plane.YAW])
    noise = vehicle.disturbance[Plane.YAW].angle_noise_deg
    psd = _psd_deg2(heading, disturbance) + _sampled_noise_psd(noise)
    bias = model.planes[Plane.YAW].actuator_bias_deg
    return {
        "heading_deg": _MeasuredQuantity(psd, 0.0, 0.0),
        "heading_resonance_deg": _MeasuredQuantity(psd * _band(resonance_radps), 0.0, 0.0),
        "rudder_deg": _MeasuredQuantity(
            _psd_deg2(rudder, disturbance) + _gyro_noise_psd(vehicle, Plane.YAW, gains),
            -bias.value,
            bias.sd or 0.0,
            math.degrees(noise_above_grid_rad(vehicle, Plane.YAW, gains)) ** 2,
        ),
    }


def _pitch_quantities(
    model: IdentifiedModel, vehicle: DesignModel, gains: Gains, resonance_radps: float
) -> dict[str, _MeasuredQuantity]:
    """Return pitch, its resonance band, depth and elevator."""
    noise = vehicle.disturbance[Plane.PITCH]
    psd, depth_psd = map(_sampled_noise_psd, (noise.angle_noise_deg, noise.depth_noise_m))
    elevator_psd = _gyro_noise_psd(vehicle, Plane.PITCH, gains)
    for source in disturbances(vehicle, Plane.PITCH):
        pitch, depth, elevator = depth_responses(vehicle, gains, source.states)
        psd = psd + _psd_deg2(pitch, source.density)
        depth_psd = depth_psd + np.abs(depth) ** 2 * source.density
        elevator_psd = elevator_psd + _psd_deg2(elevator, source.density)
    bias, level = model.planes[Plane.PITCH].actuator_bias_deg, model.vehicle
    return {
        "pitch_deg": _MeasuredQuantity(
            psd,
            level.level_pitch_deg,
            _buoyancy_uncertainty(level.net_buoyancy_n) * level.level_pitch_deg,
        ),
        "pitch_resonance_deg": _MeasuredQuantity(psd * _band(resonance_radps), 0.0, 0.0),
        "depth_m": _MeasuredQuantity(depth_psd, 0.0, 0.0),
        "elevator_deg": _MeasuredQuantity(
            elevator_psd,
            level.level_elevator_deg - bias.value,
            bias.sd or 0.0,
            math.degrees(noise_above_grid_rad(vehicle, Plane.PITCH, gains)) ** 2,
        ),
    }


def _buoyancy_uncertainty(net_buoyancy: ParameterEstimate) -> float:
    """Return the relative standard deviation of the net buoyancy, which determines level flight."""
    return abs((net_buoyancy.sd or 0.0) / net_buoyancy.value) if net_buoyancy.value else 0.0


def _psd_deg2(response: ComplexArray, disturbance: Array) -> Array:
    """Return the density of an angle (deg^2 per rad/s) under a disturbance."""
    return np.asarray(np.degrees(np.abs(response)) ** 2 * disturbance)


def _sampled_noise_psd(sd: float) -> Array:
    """Return the density of sensor noise sampled every `NOISE_STEP_S`, zero above Nyquist."""
    within = math.pi / NOISE_STEP_S > GRID_RADPS
    return np.where(within, sd**2 * NOISE_STEP_S, 0.0)


def _gyro_noise_psd(vehicle: DesignModel, plane: Plane, gains: Gains) -> Array:
    """Return the density of the surface command (deg^2 per rad/s) by the gyro's noise."""
    filters = loop_transfer.filter_response(loop_transfer.command_filters(plane, gains))
    loop, gain = loop_at_surface(vehicle, plane, gains)
    noise = vehicle.disturbance[plane].rate_noise_degps ** 2 * NOISE_STEP_S
    return np.asarray(np.abs(gain * filters / (1.0 + loop)) ** 2 * noise)


def _predict_statistic(quantity: _MeasuredQuantity) -> PredictedStatistic:
    """Return mean, rms, standard deviation of means and correlation time of a quantity."""
    variance = _integral(quantity.density) + quantity.variance_above_grid
    averaging_gain = np.sinc(GRID_RADPS * AVERAGED_S / (2.0 * math.pi)) ** 2
    density_about_mean = quantity.density * (1.0 - averaging_gain)
    return PredictedStatistic(
        mean=quantity.mean,
        mean_sd=abs(quantity.mean_sd),
        rms=math.sqrt(variance),
        p95=1.96 * math.sqrt(variance),
        mean_sd_20s=math.sqrt(_integral(quantity.density * averaging_gain)),
        correlation_time_s=_integral(density_about_mean**2) / _integral(density_about_mean) ** 2,
    )


def _integral(density: Array) -> float:
    """Integrate a two-sided density over positive frequencies."""
    return float(np.trapezoid(density, GRID_RADPS)) / math.pi


def _resonance_radps(vehicle: DesignModel, plane: Plane, gains: Gains) -> float:
    """Return the frequency of the largest sensitivity within `RESONANCE_RANGE_RADPS`."""
    low, high = RESONANCE_RANGE_RADPS
    loop, _ = loop_at_surface(vehicle, plane, gains)
    sensitivity = np.where(
        (low <= GRID_RADPS) & (high >= GRID_RADPS), 1.0 / np.abs(1.0 + loop), 0.0
    )
    return float(GRID_RADPS[np.argmax(sensitivity)])
