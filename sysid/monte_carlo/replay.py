"""A recorded dive again, with other parameters and the disturbance that its log shows.

The model's vehicle is driven with the recorded commands. Its innovations, recorded minus predicted
motion, give the disturbing wrench of every tick. The wrenches then act on the closed loop of the
same vehicle and the autopilot's own tick. The recorded minus the predicted position is the drift by
current, sideslip and corrections of the navigation; it is added to the position of the replay.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from autopilot.control import lqg_file, params
from autopilot.control.lqg import LqgControllers
from autopilot.control.types import Home
from mavlink_io.frames import wrap_pi
from mavlink_io.mission_items import MissionItem
from mavlink_io.tick import TICK_S
from sitl.vehicle.water import drifting
from sysid.data import state_table
from sysid.data.dataset import Array, Log, LogError
from sysid.data.events import Armed, ModeChanged
from sysid.models.parameters import CandidateVehicle
from sysid.monte_carlo import dynamics, instruments
from sysid.monte_carlo import simulate as simulation
from sysid.monte_carlo.disturbance import BLOCK
from sysid.monte_carlo.dynamics import DEPTH, N_OBSERVED, RATES, SimulatedVehicleState
from sysid.monte_carlo.simulate import ComplexArray, NavigationRecord, SimulatedDive

RATE_GAIN = 0.5
"""Share of the innovation of a rate that is attributed to the disturbance of one tick."""
ANGLE_GAIN_PER_S = 1.0
"""Correction of an angle by the rate, so that the integrated rates follow the recorded angles."""
DEPTH_RATE_GAIN = 0.05
"""Share of the innovation of the depth rate per tick; the recorded rate is smoothed over 0.7 s."""
DEPTH_GAIN_PER_S = 0.5
"""Correction of the depth by its rate."""
MIN_DIVE_S = 10.0
"""Minimum duration of a dive that can be replayed (s)."""

_USED = (
    "depth_m",
    "depth_rate_mps",
    "pitch_rad",
    "heading_rad",
    "q_radps",
    "r_radps",
    "rudder_rad",
    "elevator_rad",
    "thrust_pct",
)


class Deviation(NamedTuple):
    """Root mean square difference of two dives from arming to the end of the mission."""

    heading_deg: float
    pitch_deg: float
    depth_m: float
    rudder_deg: float
    elevator_deg: float


class DivePlan(NamedTuple):
    """What the vehicle of a recorded dive flew."""

    items: tuple[MissionItem, ...]
    """Mission."""
    fence: tuple[MissionItem, ...] = ()
    """Geofence."""
    rally: tuple[MissionItem, ...] = ()
    """Rally points."""


class Replayed(NamedTuple):
    """Result of a replay."""

    recorded: Log
    """The recorded dive."""
    unchanged: SimulatedDive
    """Replay with the recorded parameters."""
    changed: SimulatedDive
    """Replay with the other parameters."""
    fidelity: Deviation
    """Difference of the unchanged replay and the recorded dive."""
    effect: Deviation
    """Difference of the changed and the unchanged replay."""


class Controllers(NamedTuple):
    """LQG controllers that replace the PID loops while LQG_ENABLE is 1; None: the PID loops."""

    recorded: LqgControllers | None = None
    """Controllers of the recorded dive."""
    changed: LqgControllers | None = None
    """Controllers of the other replay."""


PID_LOOPS = Controllers()
"""No LQG controllers."""


def load_controllers(recorded: Path | None, changed: Path | None) -> Controllers:
    """Load the LQG controllers of both replays.

    Parameters
    ----------
    recorded : Path or None
        File of those of the recorded dive; None for the PID loops.
    changed : Path or None
        File of those of the other replay; None for the recorded ones.

    Returns
    -------
    Controllers
        The controllers.

    Raises
    ------
    InputError
        A file cannot be used.
    """
    first = lqg_file.load(recorded) if recorded else None
    return Controllers(first, lqg_file.load(changed) if changed else first)


def replay(
    log: Log,
    vehicle: CandidateVehicle,
    plan: DivePlan,
    parameters: Mapping[str, float],
    controllers: Controllers = PID_LOOPS,
) -> Replayed:
    """Replay a dive with the recorded and with other parameters.

    Parameters
    ----------
    log : Log
        Recorded dive with its parameters.
    vehicle : CandidateVehicle
        Vehicle of a fitted model.
    plan : DivePlan
        Mission, geofence and rally points of the dive.
    parameters : mapping
        Parameters that replace recorded ones.
    controllers : Controllers
        LQG controllers of both replays; a log does not contain those of its dive.

    Returns
    -------
    Replayed
        Both replays, and their differences.

    Raises
    ------
    LogError
        The log has no dive from arming on, no parameters, or no position for a geofence.
    ParamError, MissionRejectedError
        The autopilot rejects a parameter or the mission.
    """
    if not log.parameters:
        raise LogError(f"{log.name}: has no parameters; replay a log of `ground fly`")
    own = dict(log.parameters)
    try:
        params.config(own)
    except params.ParamError as error:
        raise LogError(
            f"{log.name}: {error} in Caribou's autopilot; replay a log of `ground fly`"
        ) from None
    table = _at_ticks(log)
    wrenches, through_water_m = disturbance(vehicle, table)
    navigation = _navigation(log, table, through_water_m)
    if navigation:
        navigation = navigation._replace(fence=plan.fence, rally=plan.rally)
    if plan.fence and not (navigation and navigation.home.known):
        raise LogError(
            f"{log.name}: has no LOCAL_POSITION_NED or no HOME_POSITION; the replay of a dive with"
            " a geofence needs both"
        )

    def fly(values: Mapping[str, float], lqg: LqgControllers | None) -> SimulatedDive:
        config = replace(params.config(values), lqg_controllers=lqg)
        craft = _craft(vehicle, float(table["heading_rad"][0]), instruments.field_nwu(config))
        return simulation.fly_with(
            craft, _continued(wrenches), _no_errors(), plan.items, config, navigation
        )

    unchanged = fly(own, controllers.recorded)
    changed = fly({**own, **parameters}, controllers.changed)
    return Replayed(
        recorded=log,
        unchanged=unchanged,
        changed=changed,
        fidelity=_deviation(table, _of(unchanged)),
        effect=_deviation(_of(unchanged), _of(changed)),
    )


def disturbance(
    vehicle: CandidateVehicle, table: Mapping[str, Array]
) -> tuple[Array, ComplexArray]:
    """Return the disturbing wrench of every tick of a dive, and the path of the model's vehicle.

    Parameters
    ----------
    vehicle : CandidateVehicle
        Vehicle of a fitted model.
    table : mapping
        Columns of ``state_table`` at the ticks of the autopilot.

    Returns
    -------
    wrenches : ndarray, shape (n - 1, 6)
        Force and moment in FLU, N and N m.
    through_water_m : ndarray, shape (n,)
        Horizontal position of the vehicle with these wrenches in still water, north + i east (m).

    Notes
    -----
    Symbols, FRD and NED: q, r rates (rad/s), theta, psi angles (rad), z depth (m), T tick (s); ^ is
    the prediction of the tick without a disturbance, k the gains of this module. Per tick

        e_q = q + k_a (theta - theta^) - q^,    a_pitch = k_r e_q / T,
        e_r = r + k_a (psi - psi^) - r^,        a_yaw = k_r e_r / T,
        e_z = dz/dt + k_z (z - z^) - dz^/dt,    a_heave = k_d e_z / T,

    and the wrench is M a with the mass matrix M, added mass included. The vehicle is then advanced
    with the wrench (observer with constant gains; Jategaonkar 2015, ch. 5).
    """
    count = table["depth_m"].size
    craft = _craft(vehicle, float(table["heading_rad"][0]), (0.2, 0.0, -0.48))
    mass = vehicle.model.inertia.M
    wrenches = np.zeros((count - 1, 6))
    through_water_m = np.zeros(count, np.complex128)
    psi, depth_m = float(table["heading_rad"][0]), float(craft.observed[DEPTH])
    heading = np.unwrap(table["heading_rad"])
    still = np.zeros(6)
    for k in range(count - 1):
        command = (
            float(table["rudder_rad"][k]),
            float(table["elevator_rad"][k]),
            0.01 * float(table["thrust_pct"][k]),
        )
        before = [array.copy() for array in (craft.state, craft.rudder, craft.elevator)]
        observed = dynamics.advance(craft, *command, still)
        _, q, r = observed[RATES]
        rate_mps = (observed[DEPTH] - depth_m) / TICK_S
        pitch = _pitch_rad(craft)
        e_q = table["q_radps"][k + 1] + ANGLE_GAIN_PER_S * (table["pitch_rad"][k + 1] - pitch) - q
        e_r = table["r_radps"][k + 1] + ANGLE_GAIN_PER_S * (heading[k + 1] - psi) - r
        e_z = (
            table["depth_rate_mps"][k + 1]
            + DEPTH_GAIN_PER_S * (table["depth_m"][k + 1] - observed[DEPTH])
            - rate_mps
        )
        acceleration = np.zeros(6)
        acceleration[2] = -DEPTH_RATE_GAIN * e_z / TICK_S
        acceleration[4] = -RATE_GAIN * e_q / TICK_S
        acceleration[5] = -RATE_GAIN * e_r / TICK_S
        wrenches[k] = mass @ acceleration
        for array, saved in zip((craft.state, craft.rudder, craft.elevator), before, strict=True):
            array[:] = saved
        observed = dynamics.advance(craft, *command, wrenches[k])
        depth_m = float(observed[DEPTH])
        psi += wrap_pi(_heading_rad(craft) - psi)
        through_water_m[k + 1] = dynamics.horizontal_m(craft)
    return wrenches, through_water_m


def _navigation(
    log: Log, table: Mapping[str, Array], through_water_m: ComplexArray
) -> NavigationRecord | None:
    """Return the recorded navigation at the ticks of a dive; None without a recorded position."""
    time_s, position, current = table["time_s"] + _armed_s(log), log.position, log.current
    if not position.time_s.size:
        return None
    position_m = _interpolated(time_s, position.time_s, position.north_m, position.east_m)
    current_mps = np.zeros(time_s.size, np.complex128)
    if current.time_s.size:
        current_mps = _interpolated(time_s, current.time_s, current.north_mps, current.east_mps)
    home = Home(*log.home_deg, known=True) if log.home_deg else Home()
    return NavigationRecord(home, position_m - through_water_m, current_mps)


def _interpolated(time_s: Array, sample_s: Array, north: Array, east: Array) -> ComplexArray:
    """Return a horizontal vector, north + i east, at other times by linear interpolation."""
    return np.interp(time_s, sample_s, north) + 1j * np.interp(time_s, sample_s, east)


def _armed_s(log: Log) -> float:
    """Return the time of arming; raise LogError without it."""
    armed = [event.time_s for event in log.events if isinstance(event.value, Armed)]
    if not armed:
        raise LogError(f"{log.name}: the vehicle was not armed; replay the log of a dive")
    return armed[0]


def _at_ticks(log: Log) -> dict[str, Array]:
    """Return the state at the ticks from arming to the end of the mission."""
    start_s = _armed_s(log)
    ends = [
        event.time_s
        for event in log.events
        if isinstance(event.value, ModeChanged) and event.time_s > start_s
    ]
    table = state_table.state_table(log)
    stop_s = min([*ends, float(table["time_s"][-1])])
    if stop_s - start_s < MIN_DIVE_S:
        raise LogError(
            f"{log.name}: {stop_s - start_s:.1f} s from arming to the end of the mission; a replay"
            f" needs {MIN_DIVE_S:g} s"
        )
    ticks = np.arange(0.0, stop_s - start_s, TICK_S)
    columns = {"time_s": ticks}
    for name in _USED:
        values = np.unwrap(table[name]) if name == "heading_rad" else table[name]
        known = np.isfinite(values)
        if np.count_nonzero(known) < 2:
            raise LogError(f"{log.name}: has no {name}; a replay needs it throughout the dive")
        columns[name] = np.interp(ticks + start_s, table["time_s"][known], values[known])
    return columns


def _craft(
    vehicle: CandidateVehicle, heading_rad: float, field_nwu: tuple[float, float, float]
) -> SimulatedVehicleState:
    """Return the vehicle at the surface, at rest, on a heading."""
    craft = dynamics.initial_state(vehicle, drifting((0.0, 0.0, 0.0)), field_nwu)
    craft.state[3:7] = math.cos(heading_rad / 2), 0.0, 0.0, -math.sin(heading_rad / 2)
    dynamics.step(*craft, 0, 0.0, 0.0, 0.0, np.zeros(6))
    return craft


def _pitch_rad(craft: SimulatedVehicleState) -> float:
    """Return the pitch, nose up."""
    w, x, y, z = craft.state[3:7]
    return float(-math.asin(max(-1.0, min(1.0, 2 * (w * y - x * z)))))


def _heading_rad(craft: SimulatedVehicleState) -> float:
    """Return the heading, clockwise from north."""
    w, x, y, z = craft.state[3:7]
    return float(-math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))


def _continued(wrenches: Array) -> Iterator[Array]:
    """Yield the wrenches in blocks, and after their end their mean."""
    for start in range(0, len(wrenches), BLOCK):
        yield wrenches[start : start + BLOCK]
    while True:
        yield np.tile(wrenches.mean(axis=0), (BLOCK, 1))


def _no_errors() -> Iterator[Array]:
    """Yield measurement errors that only keep the last digit alive.

    The recorded motion contains the sensors' noise, so that the wrenches contain it too.
    """
    rng = np.random.default_rng(0)
    while True:
        yield instruments.LAST_DIGIT_NOISE * rng.standard_normal((BLOCK, N_OBSERVED))


def _of(dive: SimulatedDive) -> dict[str, Array]:
    """Return the state of a replay."""
    return state_table.state_table(dive.log)


def _deviation(first: Mapping[str, Array], second: Mapping[str, Array]) -> Deviation:
    """Return the rms differences over the time that both dives last."""
    time_s = first["time_s"][first["time_s"] <= min(first["time_s"][-1], second["time_s"][-1])]

    def rms(name: str) -> float:
        a, b = (np.interp(time_s, table["time_s"], table[name]) for table in (first, second))
        return float(np.sqrt(np.nanmean((a - b) ** 2)))

    def rms_deg(name: str) -> float:
        a, b = (
            np.interp(time_s, table["time_s"], np.unwrap(table[name])) for table in (first, second)
        )
        return math.degrees(np.sqrt(np.nanmean(np.angle(np.exp(1j * (a - b))) ** 2)))

    return Deviation(
        heading_deg=rms_deg("heading_rad"),
        pitch_deg=rms_deg("pitch_rad"),
        depth_m=rms("depth_m"),
        rudder_deg=rms_deg("rudder_rad"),
        elevator_deg=rms_deg("elevator_rad"),
    )
