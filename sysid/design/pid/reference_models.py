"""Reference models of heading and depth: as fast as travel and overshoot allow.

The autopilot's reference model is a critically damped second-order filter with a rate limit.
"""

import math
from collections.abc import Callable, Mapping
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.control_analysis import loop_transfer
from sysid.control_analysis.loop_transfer import GRID_RADPS
from sysid.design.design_model import DesignModel
from sysid.design.pid import step_response
from sysid.design.specification import DesignInfeasibleError, Loads, Spec
from sysid.estimation.map.steady_state import SteadyTurn
from sysid.models.linear_planes import LinearPlane

Array = NDArray[np.float64]

BANDWIDTHS_RADPS = tuple(np.geomspace(1.6, 0.1, 13).round(3).tolist())
"""Bandwidths that are tried, fastest first."""
LEAD_SHARES = (1.0, 0.95, 0.9, 0.85, 0.8, 0.75, 0.7, 0.6, 0.5)
"""Leads that are tried, as shares of the delay from the pitch command to the depth rate."""
SETTLED_SHARE = 0.01
"""Error, as a share of `depth_step_m`, within which a change of depth has settled."""
DEPTH_STEPS = (1.0, -1.0, 2.0, -2.0)
"""Simulated changes of depth as multiples of `depth_step_m`, positive down."""
HEADING_S, DEPTH_S = 30.0, 60.0
"""Length of the simulated change of heading and of depth (s)."""
TURN_SHARE, DESCENT_SHARE = 0.8, 0.25
"""Maximum reference rates: share of the fastest turn that the free travel controls, and of the
speed."""
REASONS = {
    "HDG_REF_RATE": "share of the fastest turn that the free travel controls",
    "DPT_REF_RATE": "share of the speed",
    "DPT_REF_LEAD": (
        "share of the delay from the pitch command to the depth rate with which changes of depth"
        " settle soonest"
    ),
    "PTCH_FF": "elevator per pitch of a steady climb, against the righting moment",
}
"""Reason for each parameter of the reference models, by name, whatever the specification."""


def heading(
    vehicle: DesignModel,
    values: Mapping[str, float],
    loads: Loads,
    spec: Spec,
    turn: Callable[[float], SteadyTurn],
) -> dict[str, float]:
    """Return HDG_REF_W (rad/s) and HDG_REF_RATE (deg/s).

    Parameters
    ----------
    vehicle : DesignModel
        Nominal model.
    values : Mapping
        Parameters by name.
    loads : Loads
        Constant loads; the rudder bias reduces the travel.
    spec : Spec
        `heading_step_deg` and `travel_deg`.
    turn : Callable
        Return the steady turn with a rudder angle (rad). In a turn the hull loses speed and
        crossflow damps it, so that it is slower than that of the linear model.

    Returns
    -------
    dict
        The fastest reference model whose step needs no more rudder than the free travel.

    Raises
    ------
    DesignInfeasibleError
        No bandwidth meets the limit.
    """
    free_travel_rad = math.radians(spec.travel_deg) - loads.rudder_rad
    max_rate_degps = math.degrees(TURN_SHARE * turn(free_travel_rad).reference_radps)
    rate = {"HDG_REF_RATE": round(min(45.0, max(0.1, max_rate_degps)), 1)}
    step = math.radians(spec.heading_step_deg)
    for bandwidth in BANDWIDTHS_RADPS:
        reference = {"HDG_REF_W": bandwidth, **rate}
        response = step_response.heading_step(
            vehicle, {**values, **reference}, step, HEADING_S, spec
        )
        if np.max(np.abs(response.command_rad)) <= free_travel_rad:
            return reference
    raise DesignInfeasibleError(
        f"a change of heading of {spec.heading_step_deg:g} deg needs more than the"
        f" {math.degrees(free_travel_rad):.1f} deg of rudder that the bias leaves; measure the bias"
        " by a trim flight, or straighten the duct"
    )


def depth(
    vehicle: DesignModel, values: Mapping[str, float], loads: Loads, spec: Spec
) -> dict[str, float]:
    """Return DPT_REF_W (rad/s), DPT_REF_RATE (m/s), DPT_REF_LEAD (s) and PTCH_FF.

    Parameters
    ----------
    vehicle : DesignModel
        Nominal model.
    values : Mapping
        Parameters by name.
    loads : Loads
        Constant loads; the integrator starts at the pitch of level flight.
    spec : Spec
        `depth_step_m` and `depth_overshoot`.

    Returns
    -------
    dict
        The reference model and lead whose simulated changes of depth, down and up, settle soonest
        and stay within the overshoot. The climb by two `depth_step_m` ends near the surface in the
        paper's figure 14.

    Raises
    ------
    DesignInfeasibleError
        No reference model meets the limit.
    """
    speed_mps = -float(vehicle.planes.pitch.A[3, 2])
    fixed = {
        "DPT_REF_RATE": round(DESCENT_SHARE * speed_mps, 2),
        "PTCH_FF": max(0.0, _elevator_per_pitch(vehicle.planes.pitch)),
    }
    delays_s = _depth_rate_delays_s(vehicle, {**values, **fixed})
    tried = []
    for bandwidth, share in product(BANDWIDTHS_RADPS, LEAD_SHARES):
        lead_s = share * float(np.interp(bandwidth, GRID_RADPS, delays_s))
        reference = {"DPT_REF_W": bandwidth, "DPT_REF_LEAD": round(lead_s, 2), **fixed}
        tried.append((_depth_changes(vehicle, {**values, **reference}, loads, spec), reference))
    allowed = [each for each in tried if each[0].overshoot <= spec.depth_overshoot]
    if not allowed:
        least = min(changes.overshoot for changes, _ in tried)
        raise DesignInfeasibleError(
            f"no gains meet the specification: a change of depth of {spec.depth_step_m:g} m"
            f" overshoots by {100 * least:.0f} %, at most {100 * spec.depth_overshoot:.0f}"
        )
    return min(allowed, key=lambda each: each[0].settling_s)[1]


class _DepthChanges(NamedTuple):
    """Simulated changes of depth with one reference model."""

    overshoot: float
    """Largest overshoot, as a share of `depth_step_m`."""
    settling_s: float
    """Mean time until the depth stays within `SETTLED_SHARE`."""


def _depth_changes(
    vehicle: DesignModel, values: Mapping[str, float], loads: Loads, spec: Spec
) -> _DepthChanges:
    """Simulate the changes of depth by `DEPTH_STEPS`."""
    overshoots, settling_s = [], []
    for steps in DEPTH_STEPS:
        step_m = steps * spec.depth_step_m
        response = step_response.depth_step(
            vehicle, values, step_m, DEPTH_S, spec, loads.level_pitch_rad
        )
        beyond = (response.value - step_m) * math.copysign(1.0, steps) / spec.depth_step_m
        overshoots.append(float(np.max(beyond)))
        unsettled = np.flatnonzero(np.abs(beyond) > SETTLED_SHARE)
        settling_s.append(float(response.time_s[unsettled[-1]]))
    return _DepthChanges(max(overshoots), float(np.mean(settling_s)))


def _depth_rate_delays_s(vehicle: DesignModel, values: Mapping[str, float]) -> Array:
    """Return the delay from the pitch command of the reference to the depth rate (s), on the grid.

    With the closed pitch loop, the feedforward K = PTCH_FF and the depth z per elevator::

        T(s) = (PTCH_P + K) s z / (1 + L_pitch)        delay = -arg(-T) / w
    """
    plant = loop_transfer.with_filters(vehicle.pitch, values).command
    pitch = loop_transfer.depth_loops(vehicle.pitch, values)["pitch"]
    rate = -1j * GRID_RADPS * plant[:, 3] / (1.0 + pitch)
    return np.maximum(0.0, -np.unwrap(np.angle(rate)) / GRID_RADPS)


def _elevator_per_pitch(plane: LinearPlane) -> float:
    """Return the elevator per pitch of a steady climb: no heave or pitch acceleration."""
    coefficients = np.column_stack([plane.A[:2, 0], plane.B[:2]])
    return float(np.linalg.solve(coefficients, -plane.A[:2, 2])[1])
