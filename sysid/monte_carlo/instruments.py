"""What a rehearsed vehicle's instruments tell: her true motion with the sensor noise that the model
found.

The noise model knows what rates, angles and depth were off by in means over 0.1 s. It enters where
the instruments are, as white noise of the same density: rates at the gyro, angles as tilt of
gravity and field, depth at the pressure sensor. The estimator aboard then makes of it what it makes
at sea. She carries no satellite receiver and no Doppler log here: the model says nothing of either.
"""

import math
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from autopilot.control.params import Config
from mavlink_io.frames import STANDARD_GRAVITY_MPS2
from mavlink_io.records import SENSORS_ALL, SensorFrame
from sysid.control_analysis.loop_transfer import TICK_S
from sysid.data.segments import Plane
from sysid.models.noise import Noise
from sysid.monte_carlo.dynamics import DEPTH, FIELD, FORCE, N_OBSERVED, RATES

Array = NDArray[np.float64]

MEAN_S = 0.1
"""Over which the model's noise is a mean."""
HORIZONTAL_GAUSS, DOWN_GAUSS = 0.2, 0.48
"""The earth's field in middle latitudes."""
LAST_DIGIT_NOISE = 1e-7
"""Of every last digit: an instrument whose reading stands still is taken for broken."""
BLOCK = 1024
TEMPERATURE_DEGC = 10.0


def field_nwu(config: Config) -> tuple[float, float, float]:
    """A field of the declination that the autopilot reckons with, gauss."""
    declination = config.declination_rad
    return (
        HORIZONTAL_GAUSS * math.cos(declination),
        -HORIZONTAL_GAUSS * math.sin(declination),
        -DOWN_GAUSS,
    )


def deviations(levels: Mapping[Plane, Noise]) -> Array:
    """(SEEN,) standard deviation of one tick's reading; roll's are taken to be pitch's."""
    yaw, pitch = levels["yaw"], levels["pitch"]
    sd = np.empty(N_OBSERVED)
    sd[FORCE] = STANDARD_GRAVITY_MPS2 * pitch.angle_rad
    sd[RATES] = pitch.rate_radps, pitch.rate_radps, yaw.rate_radps
    sd[FIELD] = HORIZONTAL_GAUSS * yaw.angle_rad
    sd[DEPTH] = pitch.depth_m
    return np.maximum(math.sqrt(MEAN_S / TICK_S) * sd, LAST_DIGIT_NOISE)


def errors(levels: Mapping[Plane, Noise], rng: np.random.Generator) -> Iterator[Array]:
    """(SEEN,) for every tick."""
    sd = deviations(levels)
    while True:
        yield from sd * rng.standard_normal((BLOCK, N_OBSERVED))


def frame(time_us: int, reading: Array, config: Config) -> SensorFrame:
    """The sample that the tick takes in."""
    ax, ay, az, p, q, r, mx, my, mz, depth_m = reading.tolist()
    gauge_hpa = 0.01 * config.water_density_kgpm3 * STANDARD_GRAVITY_MPS2 * depth_m
    pressure_hpa = config.surface_pressure_hpa + gauge_hpa
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
        pressure_hpa,
        0.0,
        0.0,
        TEMPERATURE_DEGC,
        SENSORS_ALL,
        0,
    )
