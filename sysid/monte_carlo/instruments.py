"""Measurements of a simulated vehicle: true motion plus the identified sensor noise.

The noise model gives errors of rates, angles and depth as means over 0.1 s. They enter as white
noise of the same density at the sensors: rates at the gyro, angles as tilt of gravity and field,
depth at the pressure sensor, where the identified pressure of waves is added. The autopilot's
estimator then processes them as in the sea. There is no GNSS receiver and no DVL, because the model
has no information about them.
"""

import math
from collections.abc import Iterator, Mapping
from itertools import repeat

import numpy as np
from numpy.typing import NDArray

from autopilot.control.params import Config
from mavlink_io.frames import STANDARD_GRAVITY_MPS2
from mavlink_io.jit import numeric
from mavlink_io.records import SENSORS_ALL, SensorFrame
from mavlink_io.tick import TICK_S
from sysid.models.noise import Noise
from sysid.monte_carlo import disturbance
from sysid.monte_carlo.disturbance import BLOCK
from sysid.monte_carlo.dynamics import DEPTH, FIELD, FORCE, N_OBSERVED, RATES
from sysid.planes import Plane

Array = NDArray[np.float64]

MEAN_S = 0.1
"""Averaging time of the model's noise (s)."""
HORIZONTAL_GAUSS, DOWN_GAUSS = 0.2, 0.48
"""Horizontal and downward component of the earth's field at middle latitudes (gauss)."""
LAST_DIGIT_NOISE = 1e-7
"""Minimum noise of every measurement: a constant value is treated as a sensor fault."""
TEMPERATURE_DEGC = 10.0


def field_nwu(config: Config) -> tuple[float, float, float]:
    """Return a magnetic field (gauss, NWU) with the declination of the autopilot's parameters."""
    declination = config.declination_rad
    return (
        HORIZONTAL_GAUSS * math.cos(declination),
        -HORIZONTAL_GAUSS * math.sin(declination),
        -DOWN_GAUSS,
    )


def deviations(levels: Mapping[Plane, Noise]) -> Array:
    """Return the standard deviation of one tick's measurement, (N_OBSERVED,).

    White noise with density s^2 `MEAN_S` has the standard deviation s sqrt(MEAN_S / TICK_S) per
    tick. Roll errors are taken equal to pitch errors.
    """
    yaw, pitch = levels[Plane.YAW], levels[Plane.PITCH]
    sd = np.empty(N_OBSERVED)
    sd[FORCE] = STANDARD_GRAVITY_MPS2 * pitch.angle_rad
    sd[RATES] = pitch.rate_radps, pitch.rate_radps, yaw.rate_radps
    sd[FIELD] = HORIZONTAL_GAUSS * yaw.angle_rad
    sd[DEPTH] = pitch.depth_m
    return np.maximum(math.sqrt(MEAN_S / TICK_S) * sd, LAST_DIGIT_NOISE)


def errors(
    levels: Mapping[Plane, Noise], rng: np.random.Generator, times: float = 1.0
) -> Iterator[Array]:
    """Yield the measurement errors of `BLOCK` ticks at a time, (BLOCK, N_OBSERVED).

    ``times`` is the factor on the pressure of waves.
    """
    sd = deviations(levels)
    level = levels[Plane.PITCH]
    waves_m = (
        disturbance.wave_depths_m(level, rng) if level.wave_depth_m else repeat(np.zeros(BLOCK))
    )
    while True:
        block = sd * rng.standard_normal((BLOCK, N_OBSERVED))
        block[:, DEPTH] += times * next(waves_m)
        yield block


@numeric
def _at(observed: Array, error: Array, index: int) -> float:
    """Return one measurement."""
    return float(observed[index] + error[index])


@numeric
def frame(time_us: int, observed: Array, error: Array, config: Config) -> SensorFrame:
    """Return the sensor frame of one tick: ideal measurements and their errors, (N_OBSERVED,)."""
    ax, ay, az = _at(observed, error, 0), _at(observed, error, 1), _at(observed, error, 2)
    p, q, r = _at(observed, error, 3), _at(observed, error, 4), _at(observed, error, 5)
    mx, my, mz = _at(observed, error, 6), _at(observed, error, 7), _at(observed, error, 8)
    depth_m = _at(observed, error, DEPTH)
    gauge_hpa = 0.01 * config.water_density_kgpm3 * STANDARD_GRAVITY_MPS2 * depth_m
    return SensorFrame(
        time_us,
        ax,
        ay,
        az,
        p,
        q,
        r,
        mx,
        my,
        mz,
        config.surface_pressure_hpa + gauge_hpa,
        0.0,
        0.0,
        TEMPERATURE_DEGC,
        SENSORS_ALL,
        0,
    )
