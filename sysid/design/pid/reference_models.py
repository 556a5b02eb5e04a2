"""Reference models of heading and depth: as quick as the tailcone's travel and a small overshoot
allow."""

import math
from collections.abc import Mapping

import numpy as np

from sysid.design.design_model import DesignModel
from sysid.design.pid import step_response
from sysid.design.specification import DesignInfeasibleError, Loads, Spec
from sysid.models.linear_planes import LinearPlane

BANDWIDTHS_RADPS = tuple(np.geomspace(1.6, 0.1, 13).round(3).tolist())
"""Tried from the quickest on."""
HEADING_S, DEPTH_S = 30.0, 60.0
TURN_SHARE, DESCENT_SHARE = 0.6, 0.25
"""Of the rate of turn that the free travel holds, and of the speed: no reference model asks for
more."""


def heading(
    vehicle: DesignModel, values: Mapping[str, float], loads: Loads, spec: Spec
) -> dict[str, float]:
    """HDG_REF_W and HDG_REF_RATE. Raises DesignRefused."""
    room = math.radians(spec.travel_deg) - loads.rudder_rad
    turn = -float(np.linalg.solve(vehicle.planes.yaw.A[:2, :2], vehicle.planes.yaw.B[:2])[1])
    fastest = TURN_SHARE * room * abs(turn)
    rate = {"HDG_REF_RATE": round(min(45.0, max(1.0, math.degrees(fastest))), 1)}
    step = math.radians(spec.heading_step_deg)
    for bandwidth in BANDWIDTHS_RADPS:
        way = {"HDG_REF_W": bandwidth, **rate}
        flown = step_response.heading_step(vehicle, {**values, **way}, step, HEADING_S, spec)
        if np.max(np.abs(flown.command_rad)) <= room:
            return way
    raise DesignInfeasibleError(
        f"a change of heading of {spec.heading_step_deg:g} deg takes more than the"
        f" {math.degrees(room):.1f} deg of rudder that the bias leaves; measure the bias by a trim"
        " flight, or straighten the duct"
    )


def depth(
    vehicle: DesignModel, values: Mapping[str, float], loads: Loads, spec: Spec
) -> dict[str, float]:
    """DPT_REF_W, DPT_REF_RATE and PTCH_FF. Raises DesignRefused."""
    speed_mps = -float(vehicle.planes.pitch.A[3, 2])
    known = {
        "DPT_REF_RATE": round(DESCENT_SHARE * speed_mps, 2),
        "PTCH_FF": max(0.0, _elevator_per_pitch(vehicle.planes.pitch)),
    }
    least = math.inf
    for bandwidth in BANDWIDTHS_RADPS:
        way = {"DPT_REF_W": bandwidth, **known}
        past = max(
            _overshoot({**values, **way}, vehicle, loads, spec, step) for step in (1.0, -1.0)
        )
        least = min(least, past)
        if past <= spec.depth_overshoot:
            return way
    raise DesignInfeasibleError(
        f"no gains meet the specification: a change of depth of {spec.depth_step_m:g} m overshoots"
        f" by {100 * least:.0f} %, at most {100 * spec.depth_overshoot:.0f}"
    )


def _elevator_per_pitch(plane: LinearPlane) -> float:
    """Elevator per pitch of a steady climb: with w free, neither heave nor pitch is accelerated."""
    free = np.column_stack([plane.A[:2, 0], plane.B[:2]])
    return float(np.linalg.solve(free, -plane.A[:2, 2])[1])


def _overshoot(
    values: Mapping[str, float], vehicle: DesignModel, loads: Loads, spec: Spec, way: float
) -> float:
    """By how much of itself a change of depth overshoots, ``way`` 1 down and -1 up."""
    step_m = way * spec.depth_step_m
    flown = step_response.depth_step(vehicle, values, step_m, DEPTH_S, spec, loads.level_pitch_rad)
    return float(np.max(way * flown.value)) / spec.depth_step_m - 1.0
