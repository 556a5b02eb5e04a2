"""Check the use of the vehicle by a stock MAVSDK program; print one JSON object.

Usage: python -m tests.clients.mavsdk_checks ADDRESS [--speed N] [--slow] [--short]

``--slow`` expects the rates of a 57600 baud link, ``--short`` makes do with one check of each
service.
"""

import argparse
import asyncio
import contextlib
import math
import os
import tempfile
import time
from collections.abc import Awaitable, Callable
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

from mavsdk.exceptions import MavsdkError
from mavsdk.plugins.ftp.ftp import FtpError
from mavsdk.plugins.mission.mission import MissionItem as PlanItem
from mavsdk.plugins.mission.mission import MissionPlan
from mavsdk.plugins.mission_raw import MissionItem
from mavsdk.plugins.mission_raw.mission_raw import MissionRawError
from mavsdk.plugins.param.param import ParamError

from mavlink_io.dialect import by_name
from tests.clients.checklist import close, equal, name_of, report, require, verdict
from tests.clients.streams import BY_THEMSELVES, SENSES, SLOW_SHARE, check_rate, counting_s
from tests.clients.telemetry_recorder import REQUEST_MESSAGE, Client, Fields, connected, first
from tests.clients.vehicle import DEFAULTS, FRAME_MISSION, leg_items

ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED = range(5)
DO_SET_MODE, DO_SET_STANDARD_MODE, SET_INTERVAL, GET_INTERVAL = 176, 262, 511, 510
SET_HOME, MISSION_START, LOITER, REBOOT, TAKEOFF, CONTINUE = 179, 300, 17, 246, 22, 193
ARDUSUB_AUTO = 3
AVAILABLE_MODES, AUTOPILOT_VERSION, HOME_POSITION, ATTITUDE, NO_STREAM = 435, 148, 242, 30, 77
CAPABILITIES = 4 | 8 | 16 | 32 | 8192
"""Capabilities MISSION_INT, COMMAND_INT, PARAM_ENCODE_BYTEWISE, FTP, MAVLINK2."""
MODES = {
    "MANUAL": (1, 0, "MANUAL"),
    "DEPTH": (2, 0, "ALTCTL"),
    "STATION": (3, 0, "POSCTL"),
    "HOLD": (4, 3, "HOLD"),
    "RTL": (4, 5, "RETURN_TO_LAUNCH"),
    "SURFACE": (4, 6, "LAND"),
    "OFFBOARD": (6, 0, "OFFBOARD"),
    "STABILIZE": (7, 0, "STABILIZED"),
    "SYSID": (4, 11, "UNKNOWN"),
    "MISSION": (4, 4, "MISSION"),
}
"""Main and sub number of each mode in DO_SET_MODE, and MAVSDK's name for it."""
UNUSED = (None,) * 4
"""Value that MAVSDK gives unused parameters: NaN, which is null in its JSON."""
NOT_WHEN_MOORED = ("SYSID", "OFFBOARD")
"""Modes that require further messages or items."""
MCAP_MAGIC = b"\x89MCAP0\r\n"

NOISY_ATTEMPTS = 6
HOME_PERIOD_S = 1.0 / SENSES["HOME_POSITION"].rate_hz

T = TypeVar("T")
Check = Callable[[Client], Awaitable[None]]


def item(
    seq: int, command: int, *p: float, frame: int = FRAME_MISSION, z: float = 0.0, kind: int = 0
) -> MissionItem:
    p1, p2, p3, p4 = (*p, *(0.0,) * (4 - len(p)))
    return MissionItem(seq, frame, command, int(seq == 0), 1, p1, p2, p3, p4, 0, 0, z, kind)


def leg(depth_m: float = 4.0, seconds: float = 10_000.0) -> list[MissionItem]:
    """Return MAVSDK's items of the leg that all clients fly."""
    return [item(n, *row) for n, row in enumerate(leg_items(depth_m, seconds))]


def rows(items: list[MissionItem]) -> list[tuple[Any, ...]]:
    return [
        (i.seq, i.frame, i.command, i.param1, i.param2, i.param3, i.param4, i.x, i.y, i.z)
        for i in items
    ]


async def refused(result: str, attempt: Awaitable[Any], kind: type[Exception]) -> None:
    try:
        await attempt
    except kind as error:
        equal(error.result.name, result, "result")  # type: ignore[attr-defined]
    else:
        require(False, f"was not refused with {result}")


async def patiently(c: Client, attempt: Callable[[], Awaitable[T]], *passing: str) -> T:
    """Repeat an attempt on a noisy line, as a user does, if its result is one of ``passing``."""
    for _ in range(NOISY_ATTEMPTS if c.slow else 0):
        try:
            return await attempt()
        except MavsdkError as error:
            if error.result.name not in passing:
                raise
    return await attempt()


async def upload(c: Client, items: list[MissionItem]) -> None:
    """Upload again on a lossy line.

    MAVSDK never repeats its last item; if the acknowledgement is lost it fails after 2.5 s. An
    item that was requested again is acknowledged twice; MAVSDK takes the second acknowledgement,
    when it comes during its next upload, for a PROTOCOL_ERROR of that one.
    """
    await patiently(c, lambda: c.missions.upload_mission(items), "TIMEOUT", "PROTOCOL_ERROR")


async def download(c: Client) -> list[MissionItem]:
    return await patiently(c, c.missions.download_mission, "TIMEOUT")


async def discovers_the_vehicle(c: Client) -> None:
    equal(await c.system.get_system_id(), 1, "system id")


async def reads_the_version(c: Client) -> None:
    version = await patiently(c, c.info.get_version, "INFORMATION_NOT_RECEIVED_YET")
    equal((version.flight_sw_major, version.flight_sw_minor), (0, 1), "version")


async def reads_the_capabilities(c: Client) -> None:
    reply = await c.request(AUTOPILOT_VERSION, "AUTOPILOT_VERSION")
    equal(reply["capabilities"] & CAPABILITIES, CAPABILITIES, "capabilities")


def _is_mode(index: int, fields: Fields) -> bool:
    return bool(fields["mode_index"] == index)


async def reads_available_modes(c: Client) -> None:
    offered: dict[int, dict[str, Any]] = {}
    total, index = 1, 1
    while index <= total:
        offered[index] = await c.request(
            AVAILABLE_MODES,
            "AVAILABLE_MODES",
            index,
            partial(_is_mode, index),
        )
        total, index = offered[index]["number_modes"], index + 1
    require(
        {m["standard_mode"] for m in offered.values()} <= {0, 5, 6, 7},
        "a standard mode that submarines lack",
    )
    numbers = {m["custom_mode"] for m in offered.values()}
    require(
        {main << 16 | sub << 24 for main, sub, _ in MODES.values()} <= numbers,
        f"modes are {numbers}",
    )
    require(
        await c.command(REQUEST_MESSAGE, AVAILABLE_MODES, total + 1) != ACCEPTED,
        "there is one mode too many",
    )


async def lists_parameters(c: Client) -> None:
    every = await c.params.get_all_params()
    equal(len(every.int_params), 0, "count of integer parameters")
    equal({p.name: p.value for p in every.float_params}, DEFAULTS, "list")


async def reads_a_parameter(c: Client) -> None:
    equal(await c.params.get_param_float("HDG_P"), DEFAULTS["HDG_P"], "HDG_P")


async def sets_a_parameter(c: Client) -> None:
    await c.params.set_param_float("HDG_P", 0.75)
    equal(await c.params.get_param_float("HDG_P"), 0.75, "HDG_P")
    await c.params.set_param_float("HDG_P", DEFAULTS["HDG_P"])


async def unknown_parameter_is_reported_at_once(c: Client) -> None:
    """Measure the time of the attempt that was answered: a noisy line may lose the others."""
    began_s = 0.0

    async def read() -> float:
        nonlocal began_s
        began_s = time.monotonic()
        return float(await c.params.get_param_float("NO_SUCH"))

    await refused("DOES_NOT_EXIST", patiently(c, read, "TIMEOUT"), ParamError)
    require(time.monotonic() - began_s < (3.0 if c.slow else 1.0), "took as long as silence")


async def parameter_out_of_range_is_refused(c: Client) -> None:
    await refused("VALUE_OUT_OF_RANGE", c.params.set_param_float("HDG_P", -1e6), ParamError)
    equal(await c.params.get_param_float("HDG_P"), DEFAULTS["HDG_P"], "HDG_P")


async def mission_round_trip(c: Client) -> None:
    await upload(c, leg())
    equal(rows(await download(c)), rows(leg()), "mission")


async def long_mission_round_trip(c: Client) -> None:
    count = 12 if c.slow else 100
    long = [item(n, 93, float(n), -1, -1) for n in range(count)]
    await upload(c, long)
    equal(rows(await download(c)), rows(long), "mission")


async def waypoint_plan_round_trip(c: Client) -> None:
    """Check the mission plugin, with depth as a negative altitude; it sends frame 3 and NaN."""
    nan = math.nan
    place = PlanItem(
        42.35,
        -71.05,
        -3.0,
        1.2,
        True,
        nan,
        nan,
        PlanItem.CameraAction.NONE,
        nan,
        nan,
        5.0,
        nan,
        nan,
        PlanItem.VehicleAction.NONE,
    )
    plan = MissionPlan([place])
    await patiently(c, lambda: c.plans.upload_mission(plan), "TIMEOUT", "PROTOCOL_ERROR")
    (back,) = (await c.plans.download_mission()).mission_items
    close(back.relative_altitude_m, -3.0, 1e-3, "relative_altitude_m")
    close(back.latitude_deg, 42.35, 1e-6, "latitude_deg")
    close(back.speed_m_s, 1.2, 1e-3, "speed_m_s")


async def altitude_above_water_is_refused(c: Client) -> None:
    await upload(c, leg())
    await refused("INVALID_ARGUMENT", upload(c, [item(0, 16, frame=3, z=5.0)]), MissionRawError)
    equal(rows(await download(c)), rows(leg()), "mission that was there before")


async def unsupported_mission_command_is_refused(c: Client) -> None:
    await refused("UNSUPPORTED", upload(c, [item(0, TAKEOFF)]), MissionRawError)
    equal(rows(await download(c)), rows(leg()), "mission that was there before")


async def geofence_is_written_and_read_back(c: Client) -> None:
    """A triangle of 100 km about home, which does not hinder the other checks."""
    corners = ((43.0, -71.0), (42.0, -72.0), (42.0, -70.0))
    fence = [
        MissionItem(
            n, 0, 5001, int(n == 0), 1, 3.0, 0, 0, 0, int(lat * 1e7), int(lon * 1e7), 0.0, 1
        )
        for n, (lat, lon) in enumerate(corners)
    ]
    await patiently(c, lambda: c.missions.upload_geofence(fence), "TIMEOUT")
    back = await c.missions.download_geofence()
    equal([(one.command, one.x, one.y) for one in back], [(5001, f.x, f.y) for f in fence], "fence")


async def impossible_geofence_is_refused(c: Client) -> None:
    wrong = [item(0, 5001, 3.0, frame=3, kind=1)]
    attempt = patiently(c, lambda: c.missions.upload_geofence(wrong), "TIMEOUT")
    await refused("INVALID_ARGUMENT", attempt, MissionRawError)


async def clears_the_mission(c: Client) -> None:
    await c.missions.clear_mission()
    try:
        equal(len(await download(c)), 0, "count of items")
    except MissionRawError as error:
        equal(error.result.name, "NO_MISSION_AVAILABLE", "result")


async def all_sensors_are_healthy(c: Client) -> None:
    require(
        await first(c.telemetry.subscribe_health_all_ok(), bool, 30.0 * c.stretch),
        "never all healthy",
    )
    health = await first(c.telemetry.subscribe_health())
    lacking = [
        name for name in vars(health) if name.startswith("is_") and not getattr(health, name)
    ]
    equal(lacking, [], "what is not healthy")


async def home_is_at_the_surface(c: Client) -> None:
    """Wait for several messages on a noisy line, which has one every 10 s and loses some."""
    within_s = NOISY_ATTEMPTS * HOME_PERIOD_S / SLOW_SHARE if c.slow else 3 * HOME_PERIOD_S
    home = await first(c.telemetry.subscribe_home(), within_s=within_s * c.stretch)
    equal((home.absolute_altitude_m, home.relative_altitude_m), (0.0, 0.0), "altitude")
    require(home.latitude_deg and home.longitude_deg, "home lies nowhere")


async def sets_each_mode_by_main_and_sub_number(c: Client) -> None:
    for name, (main, sub, seen) in MODES.items():
        if name not in NOT_WHEN_MOORED:
            equal(
                await c.command(DO_SET_MODE, 1, main, sub, *UNUSED), ACCEPTED, f"result of {name}"
            )
            await c.becomes(mode=seen)


async def sets_each_mode_by_its_whole_number(c: Client) -> None:
    for name, (main, sub, seen) in MODES.items():
        if name not in NOT_WHEN_MOORED:
            equal(
                await c.command(DO_SET_MODE, 1, float(main << 16 | sub << 24)),
                ACCEPTED,
                f"result of {name}",
            )
            await c.becomes(mode=seen)


async def sets_mode_by_set_mode_message(c: Client) -> None:
    """Check SET_MODE, which has no acknowledgement, by the next heartbeat and CURRENT_MODE."""
    acks = len(c.times["COMMAND_ACK"])
    depth = 2 << 16
    announced = asyncio.create_task(c.next("CURRENT_MODE", lambda m: m["custom_mode"] == depth))
    await c.ask(
        "HEARTBEAT",
        lambda m: m["custom_mode"] == depth,
        "SET_MODE",
        target_system=1,
        base_mode=1,
        custom_mode=depth,
    )
    await announced
    equal(len(c.times["COMMAND_ACK"]), acks, "count of acknowledgements")


async def sets_standard_modes(c: Client) -> None:
    for standard, seen in ((5, "RETURN_TO_LAUNCH"), (6, "MISSION"), (7, "LAND")):
        equal(await c.command(DO_SET_STANDARD_MODE, standard), ACCEPTED, f"result of {standard}")
        await c.becomes(mode=seen)
    for standard in (1, 2, 3, 4):
        equal(await c.command(DO_SET_STANDARD_MODE, standard), FAILED, f"result of {standard}")


async def unknown_modes_are_refused(c: Client) -> None:
    require(
        await c.command(DO_SET_MODE, 1, 9, 0) in (DENIED, UNSUPPORTED), "mode 9 was not refused"
    )
    equal(
        await c.command(DO_SET_MODE, 1, ARDUSUB_AUTO), DENIED, "result of ArduSub's number of AUTO"
    )
    equal(await c.command(DO_SET_MODE, 0, 1, 0), DENIED, "result without the custom mode flag")


async def holds(c: Client) -> None:
    await c.action.hold()
    await c.becomes(mode="HOLD")


async def returns(c: Client) -> None:
    await c.action.return_to_launch()
    await c.becomes(mode="RETURN_TO_LAUNCH")


async def lands_at_the_surface(c: Client) -> None:
    await c.action.land()
    await c.becomes(mode="LAND")


async def arms_and_disarms(c: Client) -> None:
    await c.action.hold()
    await c.action.arm()
    await c.becomes(armed=True)
    await c.action.arm()
    await c.action.disarm()
    await c.becomes(armed=False)


async def takeoff_is_refused(c: Client) -> None:
    equal(await c.command(TAKEOFF), UNSUPPORTED, "result")


async def starts_the_mission(c: Client) -> None:
    await upload(c, leg())
    await c.action.arm()
    await c.missions.start_mission()
    await c.becomes(mode="MISSION")
    await first(c.telemetry.subscribe_in_air(), bool)


async def receives_every_stream(c: Client) -> None:
    """Check without a dive, which takes minutes at a low speed of vehicle time."""
    deadline_s = time.monotonic() + 10.0 * c.stretch
    while missing := BY_THEMSELVES - set(c.latest):
        require(time.monotonic() < deadline_s, f"never received {sorted(missing)}")
        await asyncio.sleep(0.1)


async def receives_mission_progress(c: Client) -> None:
    progress = await first(c.missions.subscribe_mission_progress(), lambda p: p.current >= 3)
    equal((progress.current, progress.total), (3, 4), "progress")


async def mission_upload_during_mission_is_refused(c: Client) -> None:
    try:
        await upload(c, leg(depth_m=1.0))
    except MissionRawError:
        equal(rows(await download(c)), rows(leg()), "mission")
    else:
        require(False, "was not refused")


async def dives(c: Client) -> None:
    """Count streams during the dive; request the messages that are not streamed."""
    for name, sense in SENSES.items():
        if sense.must_be_requested(slow=c.slow):
            equal(
                await c.command(SET_INTERVAL, by_name(name).message_id, 1e6),
                ACCEPTED,
                f"result for {name}",
            )
    for times in c.times.values():
        times.clear()
    began_s, vehicle_began_s = time.monotonic(), c.vehicle_s
    await first(
        c.telemetry.subscribe_position(), lambda p: p.relative_altitude_m < -1.5, 60.0 * c.stretch
    )
    require(
        (await first(c.telemetry.subscribe_position_velocity_ned())).position.down_m > 1.0,
        "down is not positive",
    )
    await asyncio.sleep(max(0.0, began_s + counting_s(slow=c.slow) - time.monotonic()))
    c.counted_s, c.counted_vehicle_s = time.monotonic() - began_s, c.vehicle_s - vehicle_began_s
    c.counted = {name: len(times) for name, times in c.times.items()}


def stream(name: str) -> Check:
    """Check the rate of a message and its values."""

    async def check(c: Client) -> None:
        require(c.counted.get(name) or name in c.latest, "was never received")
        span_s = c.counted_s if name == "HEARTBEAT" else c.counted_vehicle_s
        check_rate(name, c.counted.get(name, 0), span_s, slow=c.slow)
        SENSES[name].check(c.latest[name], c.latest)

    check.__name__ = f"stream_{name}"
    return check


async def subscribes_to_all_telemetry(c: Client) -> None:
    t = c.telemetry
    streams = {
        "attitude_euler": t.subscribe_attitude_euler(),
        "attitude_quaternion": t.subscribe_attitude_quaternion(),
        "body rates": t.subscribe_attitude_angular_velocity_body(),
        "velocity_ned": t.subscribe_velocity_ned(),
        "position": t.subscribe_position(),
        "position_velocity_ned": t.subscribe_position_velocity_ned(),
        "heading": t.subscribe_heading(),
        "altitude": t.subscribe_altitude(),
        "battery": t.subscribe_battery(),
        "fixedwing_metrics": t.subscribe_fixedwing_metrics(),
        "imu": t.subscribe_imu(),
        "odometry": t.subscribe_odometry(),
        "distance_sensor": t.subscribe_distance_sensor(),
        "actuator_output_status": t.subscribe_actuator_output_status(),
        "raw_gps": t.subscribe_raw_gps(),
        "gps_info": t.subscribe_gps_info(),
        "landed_state": t.subscribe_landed_state(),
        "flight_mode": t.subscribe_flight_mode(),
        "armed": t.subscribe_armed(),
        "health": t.subscribe_health(),
    }
    results = await asyncio.gather(*(first(s) for s in streams.values()), return_exceptions=True)
    equal(
        [n for n, value in zip(streams, results, strict=True) if isinstance(value, Exception)],
        [],
        "silent streams",
    )
    seen = {
        name: value
        for name, value in zip(streams, results, strict=True)
        if not isinstance(value, BaseException)
    }
    close(
        seen["position"].relative_altitude_m, seen["altitude"].altitude_relative_m, 1.0, "altitude"
    )
    require(0.0 <= seen["heading"].heading_deg < 360.0, "heading")
    equal(seen["landed_state"].name, "IN_AIR", "landed_state")
    equal(seen["actuator_output_status"].active, 7, "active")


async def interval_of_attitude_us(c: Client) -> float:
    ask = {f"param{n}": 0.0 for n in range(2, 8)} | {
        "command": GET_INTERVAL,
        "confirmation": 0,
        "param1": ATTITUDE,
    }
    reply = await c.ask(
        "MESSAGE_INTERVAL",
        lambda m: True,
        "COMMAND_LONG",
        target_system=1,
        target_component=1,
        **ask,
    )
    return float(reply["interval_us"])


async def sets_rates(c: Client) -> None:
    """Check a requested rate in vehicle time: twice the table or a fifth of it (slow line).

    Of 20 messages a line that loses one in ten delivers 12 or more; of 6 it often delivers 3.
    """
    rate_hz = 2.0 if c.slow else 20.0
    await c.telemetry.set_rate_attitude_euler(rate_hz)
    close(await interval_of_attitude_us(c), 1e6 / rate_hz, 1, "interval_us")
    c.times["ATTITUDE"].clear()
    began_s = c.vehicle_s
    await asyncio.sleep(10.0 if c.slow else 3.0 * c.stretch)
    close(
        len(c.times["ATTITUDE"]) / (c.vehicle_s - began_s),
        rate_hz,
        0.4 * rate_hz,
        "rate of ATTITUDE",
    )


async def stops_and_restores_a_stream(c: Client) -> None:
    equal(await c.command(SET_INTERVAL, ATTITUDE, -1), ACCEPTED, "result of -1")
    await asyncio.sleep(1.0 if not c.slow else 2.0)
    c.times["ATTITUDE"].clear()
    await asyncio.sleep(1.0)
    equal(len(c.times["ATTITUDE"]), 0, "count of ATTITUDE when stopped")
    equal(await c.command(SET_INTERVAL, ATTITUDE, 0), ACCEPTED, "result of 0")
    await c.next("ATTITUDE")
    equal(
        await c.command(SET_INTERVAL, NO_STREAM, 1e6),
        UNSUPPORTED,
        "result for a message that is no stream",
    )


async def request_data_stream_keeps_rates(c: Client) -> None:
    for _ in range(5):
        await c.send(
            "REQUEST_DATA_STREAM",
            target_system=1,
            target_component=1,
            req_stream_id=0,
            req_message_rate=1,
            start_stop=1,
        )
    require(await interval_of_attitude_us(c) <= 400_000, "the rate of ATTITUDE was changed")


def _answers_time(sent_ns: int, fields: Fields) -> bool:
    return bool(fields["ts1"] == sent_ns and fields["tc1"])


async def timesync_follows_wall_clock(c: Client) -> None:
    own_ns = time.time_ns() & 0xFFFF_FFFF
    first_ns, then_ns = [
        (
            await c.ask(
                "TIMESYNC",
                partial(_answers_time, ts1),
                "TIMESYNC",
                tc1=0,
                ts1=ts1,
            )
        )["tc1"]
        for ts1 in (own_ns, own_ns + 1)
    ]
    require(0 < then_ns - first_ns < 20e9, "tc1 does not go forward with the wall clock")


async def pings(c: Client) -> None:
    """Check the PINGs that MAVSDK sends every five seconds."""
    answer = c.latest.get("PING") or await c.next("PING")
    equal((answer["target_system"], answer["target_component"]), (245, 190), "target")


async def acknowledgement_is_addressed(c: Client) -> None:
    acked = asyncio.create_task(c.next("COMMAND_ACK", lambda m: m["command"] == GET_INTERVAL))
    await c.command(GET_INTERVAL, ATTITUDE)
    ack = await acked
    equal((ack["target_system"], ack["target_component"]), (245, 190), "target")


async def answer_follows_acknowledgement(c: Client) -> None:
    c.order.clear()
    await c.request(AUTOPILOT_VERSION, "AUTOPILOT_VERSION")
    at = c.order.index("AUTOPILOT_VERSION")
    if not c.slow:  # a noisy line may lose the first of the two
        equal(c.order[max(0, at - 1)], "COMMAND_ACK", "what came before it")


async def omitted_parameters_are_accepted(c: Client) -> None:
    """Check that NaN means "not given" everywhere.

    JSON has no NaN, so that MAVSDK's own plugins are used, which fill with NaN.
    """
    await c.action.hold()
    require((await c.info.get_version()).flight_sw_major is not None, "no version")
    await c.missions.start_mission()


async def commands_by_command_int(c: Client) -> None:
    equal(await c.command_int(REQUEST_MESSAGE, AUTOPILOT_VERSION), ACCEPTED, "result")
    equal(await c.command_int(TAKEOFF), UNSUPPORTED, "result of a takeoff")


async def commands_component_zero(c: Client) -> None:
    equal(await c.command(REQUEST_MESSAGE, AUTOPILOT_VERSION, component=0), ACCEPTED, "result")


async def set_home_stays_at_the_surface(c: Client) -> None:
    home = await c.request(HOME_POSITION, "HOME_POSITION")
    announced = asyncio.create_task(c.next("HOME_POSITION", within_s=2.0))
    moved = {"x": home["latitude"] + 100, "y": home["longitude"], "z": 55.0}
    equal(await c.command_int(SET_HOME, 0, **moved), ACCEPTED, "result")
    with contextlib.suppress(*([TimeoutError] if c.slow else [])):
        equal((await announced)["altitude"], 0, "altitude of the announced home")
    home = await c.request(HOME_POSITION, "HOME_POSITION")
    equal((home["latitude"], home["altitude"]), (moved["x"], 0), "home")


async def reboot_while_armed_is_refused(c: Client) -> None:
    equal(await c.command(REBOOT, 1), TEMPORARILY_REJECTED, "result")


async def pauses_and_continues(c: Client) -> None:
    await c.missions.pause_mission()
    await c.becomes(mode="HOLD")
    equal(await c.command(CONTINUE, 1), ACCEPTED, "result of DO_PAUSE_CONTINUE")
    await c.becomes(mode="MISSION")
    equal(await c.command(LOITER), ACCEPTED, "result of NAV_LOITER_UNLIM")
    await c.becomes(mode="HOLD")
    equal(await c.command(MISSION_START, 0, 0), ACCEPTED, "result of MISSION_START")
    await c.becomes(mode="MISSION")


async def sets_current_mission_item(c: Client) -> None:
    await c.missions.set_current_mission_item(0)
    await first(c.missions.subscribe_mission_progress(), lambda p: p.total == 4)


async def receives_vehicle_texts(c: Client) -> None:
    require("Mode MISSION" in c.texts, f"texts are {c.texts}")
    require(any(len(text) > 50 for text in c.texts), "no long text was put together")


async def lists_logs(c: Client) -> None:
    entries = await patiently(c, c.logs.get_entries, "TIMEOUT")
    require(len(entries) >= 1, "there is no log of the last flight")


async def downloads_a_log(c: Client) -> None:
    """Check the first log, of the short armed time before the dive."""
    entries = await patiently(c, c.logs.get_entries, "TIMEOUT")
    entry = min(entries, key=lambda e: e.id)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.mcap"
        async for _ in c.logs.download_log_file(entry, str(path)):
            pass
        equal(path.stat().st_size, entry.size_bytes, "size")
        log = path.read_bytes()
        equal((log[:8], log[-8:]), (MCAP_MAGIC, MCAP_MAGIC), "first and last bytes")


async def lists_files(c: Client) -> None:
    results = await c.ftp.list_directory("/")
    require(
        "logs" in [entry.name for entry in results.entries],
        f"the root holds {[e.name for e in results.entries]}",
    )


async def downloads_a_file(c: Client) -> None:
    """Check a download in bursts by its checksum: a log, or on a slow line a smaller file."""
    where = "/params" if c.slow else "/logs"
    results = await c.ftp.list_directory(where)
    smallest = min((e for e in results.entries if e.size_bytes), key=lambda e: e.size_bytes)
    with tempfile.TemporaryDirectory() as folder:
        async for _ in c.ftp.download(f"{where}/{smallest.name}", folder, True):
            pass
        path = Path(folder) / smallest.name
        equal(path.stat().st_size, smallest.size_bytes, "size")
        require(
            await c.ftp.are_files_identical(str(path), f"{where}/{smallest.name}"),
            "checksums differ",
        )


async def missing_file_is_reported_at_once(c: Client) -> None:
    began_s = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:

        async def attempt() -> None:
            async for _ in c.ftp.download("/no/such/file", folder, True):
                pass

        await refused("FILE_DOES_NOT_EXIST", attempt(), FtpError)
    require(time.monotonic() - began_s < 5.0, "took as long as silence")


async def kills(c: Client) -> None:
    await c.action.kill()
    await c.becomes(armed=False)


async def receives_heartbeat_every_second(c: Client) -> None:
    """Check the heartbeat rate on the wall clock at any speed; a noisy line loses some."""
    times = c.times["HEARTBEAT"]
    share = (len(times) - 1) / (times[-1] - times[0])
    require(share > (0.7 if c.slow else 0.9), f"{share:.2f} a second")
    longest_s = max(after - before for before, after in pairwise(times))
    require(c.slow or longest_s < 2.0, f"the longest gap was {longest_s:.1f} s")


BEFORE_THE_DIVE: list[Check] = [
    discovers_the_vehicle,
    reads_the_version,
    reads_the_capabilities,
    reads_available_modes,
    lists_parameters,
    reads_a_parameter,
    sets_a_parameter,
    unknown_parameter_is_reported_at_once,
    parameter_out_of_range_is_refused,
    all_sensors_are_healthy,
    home_is_at_the_surface,
    mission_round_trip,
    waypoint_plan_round_trip,
    altitude_above_water_is_refused,
    unsupported_mission_command_is_refused,
    geofence_is_written_and_read_back,
    impossible_geofence_is_refused,
    sets_each_mode_by_main_and_sub_number,
    sets_each_mode_by_its_whole_number,
    sets_mode_by_set_mode_message,
    sets_standard_modes,
    unknown_modes_are_refused,
    holds,
    returns,
    lands_at_the_surface,
    takeoff_is_refused,
    arms_and_disarms,
]
UNDER_WATER: list[Check] = [
    starts_the_mission,
    dives,
    *(stream(name) for name in SENSES),
    subscribes_to_all_telemetry,
    receives_mission_progress,
    mission_upload_during_mission_is_refused,
    sets_rates,
    stops_and_restores_a_stream,
    request_data_stream_keeps_rates,
    timesync_follows_wall_clock,
    pings,
    acknowledgement_is_addressed,
    answer_follows_acknowledgement,
    omitted_parameters_are_accepted,
    commands_by_command_int,
    commands_component_zero,
    set_home_stays_at_the_surface,
    reboot_while_armed_is_refused,
    pauses_and_continues,
    sets_current_mission_item,
    receives_vehicle_texts,
]
AFTER_THE_DIVE: list[Check] = [
    kills,
    long_mission_round_trip,
    clears_the_mission,
    lists_logs,
    downloads_a_log,
    lists_files,
    downloads_a_file,
    missing_file_is_reported_at_once,
    receives_heartbeat_every_second,
]
EVERY = [*BEFORE_THE_DIVE, *UNDER_WATER, *AFTER_THE_DIVE]
SHORT: list[Check] = [
    discovers_the_vehicle,
    reads_the_version,
    reads_available_modes,
    lists_parameters,
    reads_a_parameter,
    sets_a_parameter,
    mission_round_trip,
    sets_each_mode_by_main_and_sub_number,
    arms_and_disarms,
    starts_the_mission,
    receives_mission_progress,
    receives_every_stream,
    timesync_follows_wall_clock,
    pauses_and_continues,
    kills,
    lists_logs,
    downloads_a_log,
    receives_heartbeat_every_second,
]


async def carry_out(
    checks: list[Check], address: str, *, speed: float, slow: bool
) -> dict[str, dict[str, Any]]:
    began_s = time.monotonic()
    try:
        client = await connected(address, speed=speed, slow=slow)
    except TimeoutError as error:
        return {"connects": verdict(error, began_s)}
    verdicts = {"connects": verdict(None, began_s)}
    for check in checks:
        began_s, problem = time.monotonic(), None
        try:
            await asyncio.wait_for(check(client), 90.0 * client.stretch)
        except Exception as error:
            problem = error
        verdicts[name_of(check)] = verdict(problem, began_s)
    return verdicts


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("address")
    parser.add_argument("--speed", type=float, default=1.0)
    parser.add_argument("--slow", action="store_true")
    parser.add_argument("--short", action="store_true")
    options = parser.parse_args()
    results = asyncio.run(
        carry_out(
            SHORT if options.short else EVERY,
            options.address,
            speed=options.speed,
            slow=options.slow,
        )
    )
    print(report(results), flush=True)
    os._exit(0)  # MAVSDK's own threads need not be waited for
