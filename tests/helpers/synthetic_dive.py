"""Log of a made-up dive with known errors of heading and depth."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sysid.data import dataset as logs
from sysid.data.dataset import Log

Array = NDArray[np.float64]
FIRST_GAINS = {
    "ACT_TRAVEL_DEG": 15.0,
    "PTCH_P": 0.8,
    "TRIM_RUD_DEG": 0.0,
    "TRIM_ELE_DEG": 0.0,
    "TRIM_AUTO_S": 0.0,
}
EMPTY = np.empty(0)


def constant(value: float) -> Callable[[Array], Array]:
    return lambda t: np.full(t.size, value)


def dive(
    *,
    length_s: float = 200.0,
    heading_error_deg: Callable[[Array], Array] = np.zeros_like,
    depth_error_m: Callable[[Array], Array] = np.zeros_like,
    turn_degps: float = 0.0,
    rudder_deg: float = 0.0,
    elevator_deg: float = 0.0,
    pitch_deg: float = 0.0,
    parameters: dict[str, float] | None = None,
) -> Log:
    """Return the log of a leg at 20 deg, which may turn, and 3 m that begins at 0 s."""
    t = np.arange(0.0, length_s, 0.1)
    zero = np.zeros(t.size)
    setpoint_rad = np.radians(20.0 + turn_degps * t)
    return Log(
        name="made up",
        sha256="",
        attitude=logs.Attitude(
            time_s=t,
            roll_rad=zero,
            pitch_rad=np.full(t.size, math.radians(pitch_deg)),
            yaw_rad=setpoint_rad + np.radians(heading_error_deg(t)),
            p_radps=zero,
            q_radps=zero,
            r_radps=zero,
        ),
        actuators=logs.Actuators(
            time_s=t,
            rudder_rad=np.full(t.size, math.radians(rudder_deg)),
            elevator_rad=np.full(t.size, math.radians(elevator_deg)),
            thrust=np.full(t.size, 0.58),
        ),
        depth=logs.Depth(t, 3.0 + depth_error_m(t), zero),
        setpoints=logs.Setpoints(t, setpoint_rad, zero, t, np.full(t.size, 3.0)),
        events=(),
        parameters=FIRST_GAINS | (parameters or {}),
        duct=logs.DuctAngles(EMPTY, EMPTY, EMPTY),
    )


def swing(size: float, period_s: float = 8.0) -> Callable[[Array], Array]:
    return lambda t: size * np.sin(2.0 * math.pi * t / period_s)


def decay(size: float, time_s: float) -> Callable[[Array], Array]:
    return lambda t: size * np.exp(-t / time_s)
