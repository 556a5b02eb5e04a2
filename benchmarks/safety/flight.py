"""One dive of the safety benchmark, and the same dive flown by an oracle that knows the fault."""

import math
from functools import lru_cache
from typing import Any, NamedTuple

import msgspec
import numpy as np

from autopilot.control import core, modes, params, request_handler, requests
from autopilot.control.params import Config, ParamError
from autopilot.control.types import Event, Events, Inputs, Severity
from autopilot.pilot import Pilot
from autopilot.steady_ticks import is_compiled
from benchmarks.safety.cases import Case, vehicle_config
from mavlink_io import jit
from mavlink_io.frames import euler_from_quaternion
from mavlink_io.mission_items import MavCmd, MissionItem
from mavlink_io.records import ActuatorFrame
from mavlink_io.tick import TICK_S
from sitl import scenario
from sitl.core import plant
from sysid.design import initial

LIMIT_S = 1500.0
"""Vehicle time after which a dive that has not ended counts as endless."""
ORACLE_S = 400.0
"""Vehicle time for which the oracle is observed after the fault."""
SETTLE_S = 300.0
"""Longest time for which a disarmed vehicle is observed until it floats or lies on the floor."""
DEPTH_MARGIN_M = 0.5
"""Depth beyond FS_DEPTH_M that counts as noise of the depth measurement."""
AFLOAT_M = 1.0
"""Largest depth of the origin of a vehicle that floats, above waves."""
AFLOAT_S = 60.0
"""Time at the surface after which the oracle's vehicle counts as afloat: a heavy one sinks again
after its way has carried it up. A vehicle with way that surfaces once in this time is afloat."""
WAY_MPS = 0.8
"""Speed over ground, above that of current and waves, with which a vehicle at the surface may still
dive: it is observed for SETTLE_S."""
RESTING_MPS, RESTING_S = 0.01, 10.0
"""Speed and duration of a vehicle at rest."""
LOOK_TICKS = 5
LOOK_S = LOOK_TICKS * TICK_S
"""Interval at which the true motion is looked at."""
BEGIN_TICK = 2
"""Tick after which the mission is loaded and started."""
HEARTBEAT_S = 1.0
"""Interval of the ground station's heartbeats."""


class Outcome(NamedTuple):
    """Result of one dive."""

    name: str
    vehicle: str
    seed: int
    ending: str
    """"afloat", "on the floor", "submerged", "endless" or "refused"."""
    ended_s: float
    """Time of disarming."""
    safe_s: float
    """Time from the first fault to disarming at the surface; NaN if not reached."""
    deepest_m: float
    """Largest true depth of the origin."""
    contact_s: float
    """Time of the first contact with the floor; NaN for none."""
    avoidable: bool
    """Whether the vehicle touched the floor and the oracle does not."""
    depth_limit_m: float
    """FS_DEPTH_M."""
    reasons: str
    """Warnings and critical messages."""

    @property
    def failure(self) -> str:
        """Why the dive fails; empty if it does not."""
        if self.ending == "endless":
            return "endless"
        if self.avoidable:
            return "avoidable contact"
        if self.ending == "submerged":
            return "disarmed under water"
        if (
            self.name.startswith("parameter")
            and self.deepest_m > self.depth_limit_m + DEPTH_MARGIN_M
        ):
            return "beyond the depth limit"
        return ""


class Sea(NamedTuple):
    """A plant with its random streams."""

    parts: Any
    rng: Any


def fly(case: Case) -> Outcome:
    """Fly a dive, and the oracle's where the vehicle touches the floor.

    A contact before any fault is avoidable.
    """
    outcome = _fly(case)
    if not math.isnan(outcome.contact_s):
        avoidable = outcome.contact_s < first_fault_s(case) or math.isnan(oracle_contact_s(case))
        outcome = outcome._replace(avoidable=avoidable)
    return outcome


def _fly(case: Case) -> Outcome:
    """Fly a dive with the autopilot, until it ends and the vehicle has settled."""
    try:
        config = configuration(case)
    except ParamError as error:
        return _refused(case, str(error))
    sea = build(case)
    hull = sea.parts.vessel.model.hydrostatics
    body, reading = plant.initial_state(sea.parts, sea.rng)
    link = np.random.default_rng((4, case.seed))
    pilot, warnings = new_pilot(), list[str]()
    fault_s = first_fault_s(case)
    contact_s, deepest_m, ended_s, resting_s = math.nan, 0.0, math.nan, 0.0
    heard_s, surface_s, now_s = 0.0, -math.inf, 0.0
    for tick in range(round((LIMIT_S + SETTLE_S) / TICK_S)):
        now_s = tick * TICK_S
        if now_s % HEARTBEAT_S < TICK_S and link.random() >= case.link_loss:
            heard_s = now_s
        frame, events = step_pilot(pilot, inputs_of(reading, now_s - heard_s), config)
        warnings += [
            event.text
            for event in events
            if isinstance(event, Event) and event.severity <= Severity.WARNING
        ]
        if tick == BEGIN_TICK and (reason := begin(case, pilot, config)):
            return _refused(case, reason)
        body, reading = plant.step(sea.parts, body, frame, sea.rng)
        if tick % LOOK_TICKS:
            continue
        truth = body.truth
        deepest_m = max(deepest_m, truth.position_ned_m[2])
        if math.isnan(contact_s) and touches(truth, hull, case.floor_m):
            contact_s = now_s
        if tick > BEGIN_TICK and not pilot.armed:
            ended_s = now_s if math.isnan(ended_s) else ended_s
            at_surface = truth.position_ned_m[2] < AFLOAT_M or breaks_surface(truth, hull)
            if at_surface:
                surface_s = now_s
            speed_mps = math.hypot(*truth.velocity_ned_mps)
            afloat = at_surface and now_s > ended_s + RESTING_S and speed_mps < WAY_MPS
            resting_s = resting_s + LOOK_S if speed_mps < RESTING_MPS else 0.0
            if afloat or resting_s > RESTING_S or now_s > ended_s + SETTLE_S:
                break
        elif now_s > LIMIT_S:
            break
    ending = _ending(pilot.armed, body.truth, hull, case)
    if ending == "submerged" and now_s - surface_s < AFLOAT_S:
        ending = "afloat"
    return Outcome(
        name=case.name,
        vehicle=case.vehicle,
        seed=case.seed,
        ending=ending,
        ended_s=ended_s,
        safe_s=ended_s - fault_s if ending == "afloat" and fault_s < math.inf else math.nan,
        deepest_m=deepest_m,
        contact_s=contact_s,
        avoidable=False,
        depth_limit_m=config.fs_depth_m,
        reasons="; ".join(warnings),
    )


def compile_ticks() -> None:
    """Compile the steady ticks, if that is possible and not done yet: this takes a minute."""
    Pilot(compiled=jit.COMPILED)


def new_pilot() -> Pilot:
    """Return an autopilot before its first tick; its steady ticks are compiled if possible."""
    return Pilot(compiled=is_compiled())


def step_pilot(pilot: Pilot, inputs: Inputs, config: Config) -> tuple[ActuatorFrame, Events]:
    """Advance the autopilot by one tick; return its actuator frame and events."""
    if pilot.advance(inputs, config):
        return core.armed_frame(pilot.time_us, pilot.trace, config), ()
    events = pilot.tick(inputs, config)
    return core.actuator_frame(pilot.state, pilot.trace, config), events


def begin(case: Case, pilot: Pilot, config: Config) -> str:
    """Load the mission, select its mode and arm; return the reason of a refusal."""
    for request in (
        requests.LoadMission(items(case)),
        requests.SetMode(modes.MISSION.number),
        requests.Arm(),
    ):
        pilot.state, answer, _ = request_handler.handle_request(pilot.state, request, config)
        if answer.result:
            return answer.text
    return ""


def oracle_contact_s(case: Case) -> float:
    """Return the time of contact if the propeller stops when the fault begins; NaN for none.

    The fins go to neutral and the drop weight, if fitted, is released in the same tick. What is
    stuck stays stuck.
    """
    config, sea = configuration(case), build(case)
    hull, fault_s = sea.parts.vessel.model.hydrostatics, first_fault_s(case)
    body, reading = plant.initial_state(sea.parts, sea.rng)
    pilot, afloat_s = new_pilot(), 0.0
    for tick in range(round((fault_s + ORACLE_S) / TICK_S)):
        now_s = tick * TICK_S
        if now_s < fault_s:
            frame, _ = step_pilot(pilot, inputs_of(reading, 0.0), config)
            if tick == BEGIN_TICK:
                begin(case, pilot, config)
        else:
            neutral = (0.0, 0.0, 0.0, 1.0, *(0.0,) * 12)
            frame = ActuatorFrame(body.time_us, 0, neutral, 0)
        body, reading = plant.step(sea.parts, body, frame, sea.rng)
        if now_s < fault_s or tick % LOOK_TICKS:
            continue
        if touches(body.truth, hull, case.floor_m):
            return now_s
        is_afloat = now_s > fault_s + 30.0 and body.truth.position_ned_m[2] < AFLOAT_M
        afloat_s = afloat_s + LOOK_S if is_afloat else 0.0
        if afloat_s > AFLOAT_S:
            break
    return math.nan


def build(case: Case) -> Sea:
    """Return the simulated vehicle at the surface of its sea."""
    base = scenario.load("disturbed")
    factor, current_mps, height_m = case.sea
    levels = base.disturbance
    replace = msgspec.structs.replace
    levels = replace(
        levels,
        slow=replace(
            levels.slow,
            yaw_rms_nm=factor * levels.slow.yaw_rms_nm * scale(case.vehicle),
            pitch_rms_nm=factor * levels.slow.pitch_rms_nm * scale(case.vehicle),
        ),
        waves=replace(
            levels.waves,
            yaw_rms_nm=factor * levels.waves.yaw_rms_nm * scale(case.vehicle),
            pitch_rms_nm=factor * levels.waves.pitch_rms_nm * scale(case.vehicle),
        ),
    )
    sea = replace(
        base,
        disturbance=levels,
        floor=replace(base.floor, depth_m=case.floor_m),
        current=replace(base.current, speed_mps=current_mps, towards_deg=90.0),
        waves=replace(base.waves, significant_height_m=height_m, peak_period_s=6.0),
        fault=case.faults,
    )
    parts = plant.build(vehicle_config(case.vehicle), sea)
    return Sea(parts, plant.random_streams(case.seed))


@lru_cache
def scale(vehicle: str) -> float:
    """Return the factor from Caribou's disturbance moments to those of a vehicle.

    Moments of the same sea scale with displaced mass times length.
    """
    own, caribou = (vehicle_config(name) for name in (vehicle, "caribou_nominal"))
    return (
        own.ballast.mass_kg
        * own.hull.diameter_m
        / (caribou.ballast.mass_kg * caribou.hull.diameter_m)
    )


@lru_cache
def vehicle_parameters(vehicle: str) -> dict[str, float]:
    """Return the parameters of a vehicle's first dive: Caribou's are the defaults."""
    if vehicle.startswith("caribou"):
        return {}
    return initial.design_initial_gains(vehicle).parameters


def configuration(case: Case) -> Config:
    """Return the autopilot's parameters for a dive.

    Raises ParamError.
    """
    return params.config({**vehicle_parameters(case.vehicle), **dict(case.values)})


def items(case: Case) -> tuple[MissionItem, ...]:
    """Return the mission items of the legs."""
    rows: list[MissionItem] = []
    for leg in case.legs:
        percent = {"p2": -1.0, "p3": leg.thrust_pct} if leg.thrust_pct else {"p2": -2.0, "p3": -1.0}
        for command, fields in (
            (MavCmd.DO_CHANGE_SPEED, {"p1": 1.0, **percent}),
            (MavCmd.DO_CHANGE_ALTITUDE, {"p1": -leg.depth_m, "p2": 3.0}),
            (MavCmd.CONDITION_YAW, {"p1": leg.heading_deg}),
            (MavCmd.NAV_DELAY, {"p1": leg.duration_s}),
        ):
            rows.append(MissionItem(len(rows), 2, command, **fields))  # type: ignore[arg-type]
    return tuple(rows)


def first_fault_s(case: Case) -> float:
    """Return the time of the first fault; infinity without one."""
    return min((float(row["at_s"]) for row in case.faults), default=math.inf)


def touches(truth: Any, hull: Any, floor_m: float) -> bool:
    """Return whether nose or tail touch a flat floor."""
    return bool(truth.position_ned_m[2] + vertical_reach_m(truth, hull) > floor_m)


def breaks_surface(truth: Any, hull: Any) -> bool:
    """Return whether nose or tail are out of calm water.

    A hull that floats on end has its origin as deep as half its length.
    """
    return bool(truth.position_ned_m[2] < vertical_reach_m(truth, hull))


def vertical_reach_m(truth: Any, hull: Any) -> float:
    """Return how far nose and tail reach above and below the origin: spheres of the radius."""
    _, pitch, _ = euler_from_quaternion(*truth.attitude_q)
    arm_m = hull.half_length_m - hull.radius_m
    return float(arm_m * abs(math.sin(pitch)) + hull.radius_m)


def inputs_of(reading: Any, silent_s: float) -> Inputs:
    """Return the inputs of a tick from the sensor readings and the age of the last heartbeat."""
    devices = reading.dvl, reading.battery, reading.leak, reading.duct
    return Inputs(reading.frame, reading.gps, reading.altimeter, silent_s, None, *devices)


def _ending(armed: bool, truth: Any, hull: Any, case: Case) -> str:
    """Return where the vehicle is at the end."""
    if armed:
        return "endless"
    if truth.position_ned_m[2] < AFLOAT_M + hull.radius_m + case.sea[2]:
        return "afloat"
    return "on the floor" if touches(truth, hull, case.floor_m - 0.2) else "submerged"


def _refused(case: Case, reason: str) -> Outcome:
    """Return the outcome of a dive that the autopilot refuses."""
    return Outcome(
        name=case.name,
        vehicle=case.vehicle,
        seed=case.seed,
        ending="refused",
        ended_s=0.0,
        safe_s=math.nan,
        deepest_m=0.0,
        contact_s=math.nan,
        avoidable=False,
        depth_limit_m=math.inf,
        reasons=reason,
    )
