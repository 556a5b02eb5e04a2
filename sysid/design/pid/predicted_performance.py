"""What gains should come to in steady flight: not one rms but what it takes to notice that it is no
longer so."""

import importlib.metadata
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis import loop_transfer
from sysid.control_analysis.loop_transfer import GRID_RADPS, Gains
from sysid.data.segments import Plane
from sysid.design.design_model import (
    NOISE_STEP_S,
    SEED,
    DesignModel,
    depth_responses,
    heading_responses,
    loop_at_surface,
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

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

RESONANCE_RANGE_RADPS = (0.3, 6.0)
"""Where a loop of any vehicle may swing: outside, the largest sensitivity is the grid's or the
delay's."""


class _MeasuredQuantity(NamedTuple):
    """One quantity as telemetry tells it."""

    density: Array
    """Two-sided, on the grid."""
    mean: float
    mean_sd: float


def performance_baseline(
    model: IdentifiedModel,
    vehicle: DesignModel,
    gains: Gains,
    spec: Spec,
    sure: DesignRobustness | None,
) -> PerformanceBaseline:
    """What a model says of gains that were designed on it."""
    swings = _resonance_radps(vehicle, "yaw", gains), _resonance_radps(vehicle, "pitch", gains)
    heard = {
        **_yaw_quantities(model, vehicle, gains, swings[0]),
        **_pitch_quantities(model, vehicle, gains, swings[1]),
    }
    return PerformanceBaseline(
        model_sha256=sha256_of_model(model),
        version=importlib.metadata.version("caribou-auv"),
        speed_mps=model.speed_mps,
        thrust=model.thrust_fraction,
        heading_swing_radps=swings[0],
        pitch_swing_radps=swings[1],
        specification=spec._asdict(),
        predicted={name: _predict_statistic(each) for name, each in heard.items()},
        kept=sure and Robustness(sure.specification, sure.relaxed, sure.vehicles, SEED),
    )


def _band(radps: float) -> Array:
    """Squared gain of the narrow band about a frequency: a resonance of ``RESONANCE_BANDWIDTH``,
    one at its peak."""
    detuned = (GRID_RADPS / radps - radps / GRID_RADPS) / RESONANCE_BANDWIDTH
    return np.asarray(1.0 / (1.0 + detuned**2))


def _yaw_quantities(
    model: IdentifiedModel, vehicle: DesignModel, gains: Gains, swing_radps: float
) -> dict[str, _MeasuredQuantity]:
    heading, rudder = heading_responses(vehicle, gains)
    sea, noise = spectrum(vehicle.sea["yaw"]), vehicle.sea["yaw"].angle_noise_deg
    told = _psd_deg2(heading, sea) + _sampled_noise_psd(noise)
    bias = model.planes["yaw"].actuator_bias_deg
    return {
        "heading_deg": _MeasuredQuantity(told, 0.0, 0.0),
        "heading_swing_deg": _MeasuredQuantity(told * _band(swing_radps), 0.0, 0.0),
        "rudder_deg": _MeasuredQuantity(
            _command_psd(vehicle, "yaw", rudder, gains), -bias.value, bias.sd or 0.0
        ),
    }


def _pitch_quantities(
    model: IdentifiedModel, vehicle: DesignModel, gains: Gains, swing_radps: float
) -> dict[str, _MeasuredQuantity]:
    pitch, depth, elevator = depth_responses(vehicle, gains)
    sea, noise = spectrum(vehicle.sea["pitch"]), vehicle.sea["pitch"]
    told = _psd_deg2(pitch, sea) + _sampled_noise_psd(noise.angle_noise_deg)
    bias, level = model.planes["pitch"].actuator_bias_deg, model.vehicle
    return {
        "pitch_deg": _MeasuredQuantity(
            told,
            level.level_pitch_deg,
            _buoyancy_uncertainty(level.net_buoyancy_n) * level.level_pitch_deg,
        ),
        "pitch_swing_deg": _MeasuredQuantity(told * _band(swing_radps), 0.0, 0.0),
        "depth_m": _MeasuredQuantity(
            np.abs(depth) ** 2 * sea + _sampled_noise_psd(noise.depth_noise_m), 0.0, 0.0
        ),
        "elevator_deg": _MeasuredQuantity(
            _command_psd(vehicle, "pitch", elevator, gains),
            level.level_elevator_deg - bias.value,
            bias.sd or 0.0,
        ),
    }


def _buoyancy_uncertainty(found: ParameterEstimate) -> float:
    """How unsure the net buoyancy is, on which level flight rests."""
    return abs((found.sd or 0.0) / found.value) if found.value else 0.0


def _psd_deg2(answer: ComplexArray, sea: Array) -> Array:
    return np.asarray(np.degrees(np.abs(answer)) ** 2 * sea)


def _sampled_noise_psd(sd: float) -> Array:
    """Sensor noise as samples ``NOISE_STEP_S`` apart have it."""
    within = math.pi / NOISE_STEP_S > GRID_RADPS
    return np.where(within, sd**2 * NOISE_STEP_S, 0.0)


def _command_psd(vehicle: DesignModel, plane: Plane, wanted: ComplexArray, gains: Gains) -> Array:
    """Of the surface's command: what the sea asks for, and the gyro's noise."""
    lead, sea = loop_transfer.lead_response(gains), vehicle.sea[plane]
    loop, gain = loop_at_surface(vehicle, plane, gains)
    noise = sea.rate_noise_degps**2 * NOISE_STEP_S
    return _psd_deg2(wanted * lead, spectrum(sea)) + np.abs(gain * lead / (1.0 + loop)) ** 2 * noise


def _predict_statistic(heard: _MeasuredQuantity) -> PredictedStatistic:
    variance = _integral(heard.density)
    averaged = np.sinc(GRID_RADPS * AVERAGED_S / (2.0 * math.pi)) ** 2
    about = heard.density * (1.0 - averaged)
    return PredictedStatistic(
        mean=heard.mean,
        mean_sd=abs(heard.mean_sd),
        rms=math.sqrt(variance),
        p95=1.96 * math.sqrt(variance),
        average_sd=math.sqrt(_integral(heard.density * averaged)),
        memory_s=_integral(about**2) / _integral(about) ** 2,
    )


def _integral(density: Array) -> float:
    return float(np.trapezoid(density, GRID_RADPS)) / math.pi


def _resonance_radps(vehicle: DesignModel, plane: Plane, gains: Gains) -> float:
    low, high = RESONANCE_RANGE_RADPS
    loop, _ = loop_at_surface(vehicle, plane, gains)
    sensitivity = np.where(
        (low <= GRID_RADPS) & (high >= GRID_RADPS), 1.0 / np.abs(1.0 + loop), 0.0
    )
    return float(GRID_RADPS[np.argmax(sensitivity)])
