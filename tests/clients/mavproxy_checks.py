"""Check the use of the vehicle at MAVProxy's prompt; print one JSON object.

Usage: python -m tests.clients.mavproxy_checks FOLDER MASTER [--baud N] [--speed N] [--slow]
[--short]

FOLDER becomes MAVProxy's home: ``ground modes export-mavproxy`` has put the names of the
modes there.
"""

import argparse
import contextlib
import math
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from tests.clients.checklist import (
    RefutedError,
    close,
    equal,
    name_of,
    report,
    require,
    verdict,
)
from tests.clients.mavproxy_console import Console
from tests.clients.streams import BY_THEMSELVES, SENSES, check_rate, counting_s
from tests.clients.vehicle import DEFAULTS, FRAME_MISSION, Item, leg_items

MODES = ("MANUAL", "DEPTH", "STATION", "HOLD", "RTL", "SURFACE", "STABILIZE", "MISSION")
MISSION_MODE, STATION_MODE = 67_371_008, 196_608
MCAP_MAGIC = b"\x89MCAP0\r\n"
UPLOAD_S = 40.0
NOISY_UPLOADS, NOISY_UPLOADS_S = 6, 60.0
"""Attempts to upload on a noisy line, and their time limit.

MAVProxy does not repeat its last item, nor ask for the acknowledgement: with 10 % of the frames
lost, 38 of 52 uploads succeeded."""
LOG_ROW = r"Log (0) +numLogs \d+ lastLog \d+ size ([1-9]\d*)"
ITEMS = leg_items()


class Person:
    """MAVProxy at its prompt; on a noisy line a command is typed again."""

    def __init__(self, console: Console, *, speed: float, slow: bool) -> None:
        self.console, self.speed, self.slow = console, speed, slow
        self.counted: dict[str, tuple[int, dict[str, Any]]] = {}
        self.counted_s = self.counted_vehicle_s = 0.0
        self.before: dict[str, tuple[int, dict[str, Any]]] = {}

    def ask(self, line: str, pattern: str, within_s: float = 15.0) -> re.Match[str]:
        return self.console.ask(line, pattern, attempts=4 if self.slow else 1, within_s=within_s)

    def upload(self, plan: Path, pattern: str) -> None:
        """Load a plan into the vehicle."""
        attempts, within_s = (NOISY_UPLOADS, NOISY_UPLOADS_S) if self.slow else (1, UPLOAD_S)
        self.console.ask(f"wp load {plan}", pattern, attempts=attempts, within_s=within_s)

    def until(self, wanted: Callable[[], bool], what: str, within_s: float = 15.0) -> None:
        """Wait for a condition. Raises RefutedError with ``what`` after the time limit."""
        deadline_s = time.monotonic() + within_s
        while not wanted():
            require(time.monotonic() < deadline_s, what)

    def latest(self, name: str) -> dict[str, Any]:
        received = self.console.messages()
        require(name in received, f"{name} was never received")
        return received[name][1]


Check = Callable[[Person], None]


def write_plan(
    path: Path, items: Sequence[Item], *, frame: int = FRAME_MISSION, z: float = 0.0
) -> Path:
    """Return a QGC WPL 110 file, as waypoint editors write it."""
    lines = [
        f"{n}\t{int(n == 0)}\t{frame}\t{command}\t{p1}\t{p2}\t{p3}\t{p4}\t0\t0\t{z}\t1"
        for n, (command, p1, p2, p3, p4) in enumerate(items)
    ]
    path.write_text("\n".join(["QGC WPL 110", *lines]) + "\n")
    return path


def read_plan(path: Path) -> tuple[Item, ...]:
    rows = [line.split("\t") for line in path.read_text().splitlines()[1:]]
    return tuple(Item(int(row[3]), *map(float, row[4:8])) for row in rows)


def detects_the_vehicle(p: Person) -> None:
    p.console.wait_for("Detected vehicle 1:1 on link 0", 30.0)


def receives_the_parameters(p: Person) -> None:
    """Check the parameter download, by file or by messages; repeat it on a noisy line."""
    p.ask("param fetch", f"Received {len(DEFAULTS)} parameters", 60.0)
    wrong = list(DEFAULTS)

    def right() -> bool:
        p.console.type_line("param show *")
        time.sleep(1.0)
        shown = dict(
            re.findall(r"^(?:\S*> )?([A-Z][A-Z0-9_]+) +(-?[\d.]+)", p.console.output, re.MULTILINE)
        )
        wrong[:] = [
            n
            for n, v in DEFAULTS.items()
            if not math.isclose(float(shown.get(n, "nan")), v, abs_tol=1e-6)
        ]
        return not wrong

    with contextlib.suppress(RefutedError):
        p.until(right, "", 30.0)
    equal(wrong, [], "parameters that are shown wrong")


def set_parameter(p: Person, name: str, value: float) -> None:
    """Set a parameter and fetch it until it is set: MAVProxy sets in the background."""
    p.console.type_line(f"param set {name} {value:g}")
    for _ in range(40):
        if float(p.ask(f"param fetch {name}", rf"{name} = ([\d.]+)")[1]) == value:
            return
    raise RefutedError(f"{name} is not {value:g}")


def sets_a_parameter(p: Person) -> None:
    set_parameter(p, "HDG_P", 0.75)
    p.console.type_line(f"param set HDG_P {DEFAULTS['HDG_P']}")


def parameter_out_of_range_is_refused(p: Person) -> None:
    p.ask("param set DPT_P 99999999", r"DPT_P = 1e\+08: must be|Failed to set DPT_P", 20.0)
    close(
        float(p.ask("param fetch DPT_P", r"DPT_P = ([\d.]+)")[1]), DEFAULTS["DPT_P"], 1e-6, "DPT_P"
    )


def unknown_parameter_is_reported(p: Person) -> None:
    def reported() -> bool:
        p.console.type_line("param fetch NO_SUCH")
        _, error = p.console.messages().get("PARAM_ERROR", (0, {}))
        return error.get("param_id") == "NO_SUCH"

    p.until(reported, "no PARAM_ERROR for it")


def lists_every_mode(p: Person) -> None:
    offered = p.ask("mode", "Available modes:  (.*)")[1].split(", ")
    require(set(MODES) | {"SYSID"} <= {name.strip() for name in offered}, f"modes are {offered}")


def sets_every_mode_by_name(p: Person) -> None:
    for mode in MODES:
        p.ask(f"mode {mode}", f"Mode {mode}")


def shows_every_mode_by_name(p: Person) -> None:
    require("Mode(" not in p.console.output, "a mode was shown as a number")
    p.ask("mode HOLD", "Mode HOLD|HOLD>")


def unknown_mode_is_refused(p: Person) -> None:
    p.ask("mode 9", "DO_SET_MODE: (UNSUPPORTED|DENIED)")


def sends_the_mission(p: Person) -> None:
    plan = write_plan(p.console.folder / "leg.txt", ITEMS)
    p.upload(plan, rf"Sent all {len(ITEMS)} waypoints[\s\S]*MISSION_ACK: TYPE_MISSION: ACCEPTED")


def fetches_the_mission(p: Person) -> None:
    back = p.console.folder / "back.txt"
    p.ask(f"wp save {back}", f"Saved {len(ITEMS)} waypoints to {back}", 40.0)
    equal(read_plan(back), ITEMS, "mission")


def altitude_above_water_is_refused(p: Person) -> None:
    plan = write_plan(p.console.folder / "high.txt", [Item(16)], frame=3, z=5.0)
    p.upload(plan, "MISSION_ACK: TYPE_MISSION: INVALID_PARAM7")
    fetches_the_mission(p)


def unsupported_mission_command_is_refused(p: Person) -> None:
    plan = write_plan(p.console.folder / "takeoff.txt", [Item(22)])
    p.upload(plan, "MISSION_ACK: TYPE_MISSION: UNSUPPORTED")


def fence_and_rally_lists_are_empty(p: Person) -> None:
    p.ask("fence list", "Requesting 0 fence items|Saved 0|Loaded 0|0 fence")
    p.ask("rally list", "Requesting 0 rally items|Saved 0|Loaded 0|0 rally")


def arms_and_disarms(p: Person) -> None:
    p.ask("mode HOLD", "HOLD")
    p.ask("arm throttle", "^(?:.*> )?ARMED")
    p.ask("disarm", "DISARMED")


def arms_by_force_against_a_broken_rule(p: Person) -> None:
    """Check ``arm throttle force``: RTL_DEPTH_M must be at most FS_DEPTH_M."""
    set_parameter(p, "RTL_DEPTH_M", 5999.0)
    p.ask("arm throttle", "RTL_DEPTH_M = 5999: must be at most FS_DEPTH_M")
    p.ask("arm throttle force", "^(?:.*> )?ARMED")
    p.ask("disarm force", "DISARMED")
    set_parameter(p, "RTL_DEPTH_M", DEFAULTS["RTL_DEPTH_M"])


def starts_the_mission(p: Person) -> None:
    p.ask("arm throttle", "^(?:.*> )?ARMED")
    p.ask("long MISSION_START 0 0", "MISSION_START: ACCEPTED")
    p.until(
        lambda: p.latest("HEARTBEAT")["custom_mode"] == MISSION_MODE,
        "no heartbeat reported MISSION",
    )


def dives(p: Person) -> None:
    """Count streams during the dive; request the messages that are not streamed."""
    p.ask("module load messagerate", "Loaded module messagerate|already loaded")
    for name, sense in SENSES.items():
        if sense.must_be_requested(slow=p.slow):
            p.ask(f"messagerate set {name} 1", "SET_MESSAGE_INTERVAL: ACCEPTED")
    p.before, began_s = p.console.messages(), time.monotonic()
    deadline_s = began_s + 60.0 * max(1.0, 1.0 / p.speed)
    while p.latest("GLOBAL_POSITION_INT")["relative_alt"] > -1500:
        require(time.monotonic() < deadline_s, "is never 1.5 m down")
    time.sleep(max(0.0, began_s + counting_s(slow=p.slow) - time.monotonic()))
    p.counted, p.counted_s = p.console.messages(), time.monotonic() - began_s
    then_ms, now_ms = (
        received["ATTITUDE"][1]["time_boot_ms"] for received in (p.before, p.counted)
    )
    p.counted_vehicle_s = (now_ms - then_ms) / 1e3


def stream(name: str) -> Check:
    """Check the rate of a message and its values."""

    def check(p: Person) -> None:
        require(name in p.counted, "was never received")
        received = {key: fields for key, (_, fields) in p.counted.items()}
        span_s = p.counted_s if name == "HEARTBEAT" else p.counted_vehicle_s
        # The Doppler log sends its own ODOMETRY, and MAVProxy counts both as one.
        two_senders = name == "ODOMETRY"
        if not two_senders:
            count = p.counted[name][0] - p.before.get(name, (0, {}))[0]
            check_rate(name, count, span_s, slow=p.slow)
        if not (two_senders and math.isnan(received[name]["x"])):
            SENSES[name].check(received[name], received)

    check.__name__ = f"stream_{name}"
    return check


def receives_every_stream(p: Person) -> None:
    """Check without a dive, which takes minutes at a low speed of vehicle time."""
    deadline_s = time.monotonic() + 10.0 * max(1.0, 1.0 / p.speed)
    while missing := BY_THEMSELVES - set(p.console.messages()):
        require(time.monotonic() < deadline_s, f"never received {sorted(missing)}")


def sets_a_rate(p: Person) -> None:
    p.ask("messagerate set ATTITUDE 4", "SET_MESSAGE_INTERVAL: ACCEPTED")
    equal(
        float(p.ask("messagerate get ATTITUDE", r"Msg:ATTITUDE +rate:([\d.]+)Hz")[1]), 4.0, "rate"
    )
    p.ask("messagerate set ATTITUDE 0", "SET_MESSAGE_INTERVAL: ACCEPTED")


def rate_of_unknown_stream_is_refused(p: Person) -> None:
    p.ask("messagerate set COMMAND_ACK 1", "SET_MESSAGE_INTERVAL: UNSUPPORTED")


def repeated_stream_requests_keep_rates(p: Person) -> None:
    """Check that repeated REQUEST_DATA_STREAM, here at 50 Hz, keeps the rates of the table."""
    p.console.type_line("set streamrate 50")
    time.sleep(1.5)
    rate_hz = float(p.ask("messagerate get ATTITUDE", r"Msg:ATTITUDE +rate:([\d.]+)Hz")[1])
    require(rate_hz in (5.0, 10.0), f"ATTITUDE's rate became {rate_hz}")
    p.console.type_line("set streamrate 4")


def sets_current_mission_item(p: Person) -> None:
    p.ask("wp set 1", "DO_SET_MISSION_CURRENT: ACCEPTED|waypoint 1")


def requests_a_message(p: Person) -> None:
    def arrived() -> bool:
        p.console.type_line("long REQUEST_MESSAGE 148")
        return "AUTOPILOT_VERSION" in p.console.messages()

    p.until(arrived, "AUTOPILOT_VERSION never arrived")
    require(p.latest("AUTOPILOT_VERSION")["capabilities"] & 4, "capability MISSION_INT is missing")


def guided_goes_to_a_place(p: Person) -> None:
    """Check ``guided`` (DO_REPOSITION), and ``guided forward`` (a target in body axes)."""
    here = p.latest("GLOBAL_POSITION_INT")
    p.ask(f"guided {here['lat'] / 1e7 + 1e-3} {here['lon'] / 1e7} -3", "DO_REPOSITION: ACCEPTED")
    p.until(lambda: p.latest("HEARTBEAT")["custom_mode"] == STATION_MODE, "mode is not STATION")
    p.until(lambda: p.latest("POSITION_TARGET_LOCAL_NED")["z"] == 3.0, "the depth is not 3 m", 60.0)
    far_m = p.latest("POSITION_TARGET_LOCAL_NED")["x"]

    def nearer() -> bool:
        p.console.type_line("guided forward 30")
        time.sleep(1.0)
        return bool(abs(p.latest("POSITION_TARGET_LOCAL_NED")["x"] - far_m) > 10.0)

    p.until(nearer, "guided forward has no effect", 60.0)


def takeoff_is_refused(p: Person) -> None:
    p.ask("long NAV_TAKEOFF 0", "NAV_TAKEOFF: UNSUPPORTED")


def reboot_while_armed_is_refused(p: Person) -> None:
    p.ask("reboot", "PREFLIGHT_REBOOT_SHUTDOWN: TEMPORARILY_REJECTED")


def disarm_under_water_is_refused(p: Person) -> None:
    p.ask("disarm", "COMPONENT_ARM_DISARM: TEMPORARILY_REJECTED")


def receives_reason_of_refusal(p: Person) -> None:
    """Check the reason of a refusal, including one longer than one message."""
    p.ask("reboot", "AP: Reboot refused: armed")
    p.ask("disarm", "AP: Not disarmed: under water; use SURFACE, or force")


def timesync_follows_wall_clock(p: Person) -> None:
    p.ask("module load timesync", "Loaded module timesync|already loaded")
    first, then = [
        int(p.ask(f"timesync {n}", rf"TIMESYNC {{tc1 : (\d+), ts1 : {n}")[1]) for n in (4711, 4712)
    ]
    require(0 < then - first < 20e9, "tc1 does not go forward with the wall clock")


def lists_logs(p: Person) -> None:
    p.ask("log list", LOG_ROW, 20.0)


def downloads_a_log(p: Person) -> None:
    """Check the first log, of the short armed time before the dive."""
    size = int(p.ask("log list", LOG_ROW, 20.0)[2])
    path = p.console.folder / "log.mcap"
    p.console.type_line(f"log download 0 {path}")
    p.until(
        lambda: path.exists() and path.stat().st_size == size,
        f"the log of {size} bytes is not whole",
        200.0,
    )
    p.console.wait_for("Finished downloading", 60.0)
    log = path.read_bytes()
    equal((log[:8], log[-8:]), (MCAP_MAGIC, MCAP_MAGIC), "first and last bytes")


def missing_file_is_reported_at_once(p: Person) -> None:
    p.ask("ftp get /no/such/file", "ftp open failed")


def lists_files(p: Person) -> None:
    p.ask("ftp list /", r"D logs")


def disarms_by_force(p: Person) -> None:
    p.ask("disarm force", "DISARMED")


def clears_the_mission(p: Person) -> None:
    p.ask("wp clear", "MISSION_ACK: TYPE_MISSION: ACCEPTED")
    p.ask("wp list", "Requesting 0 waypoints|Have 0")


def reports_no_breach_or_lost_link(p: Person) -> None:
    texts = [
        words
        for words in ("fence breach", "link 1 down", "no link", "Time has wrapped", "Traceback")
        if words in p.console.output
    ]
    equal(texts, [], "texts that must not be printed")


def telemetry_log_is_read_by_pymavlink(p: Person) -> None:
    (log,) = p.console.folder.rglob("flight.tlog")
    tool = str(Path(sys.executable).with_name("mavlogdump.py"))
    command = [sys.executable, tool, "--types", "ATTITUDE,HEARTBEAT", str(log)]
    environment = {**os.environ, "HOME": str(p.console.folder)}
    reply = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    require(reply.stdout.count("ATTITUDE {") > 20, f"few attitudes: {reply.stderr[-200:]}")


EVERY: list[Check] = [
    detects_the_vehicle,
    receives_the_parameters,
    sets_a_parameter,
    unknown_parameter_is_reported,
    parameter_out_of_range_is_refused,
    lists_every_mode,
    sets_every_mode_by_name,
    shows_every_mode_by_name,
    unknown_mode_is_refused,
    sends_the_mission,
    fetches_the_mission,
    altitude_above_water_is_refused,
    unsupported_mission_command_is_refused,
    fence_and_rally_lists_are_empty,
    arms_and_disarms,
    arms_by_force_against_a_broken_rule,
    starts_the_mission,
    dives,
    *(stream(name) for name in SENSES),
    sets_a_rate,
    rate_of_unknown_stream_is_refused,
    repeated_stream_requests_keep_rates,
    sets_current_mission_item,
    requests_a_message,
    guided_goes_to_a_place,
    takeoff_is_refused,
    reboot_while_armed_is_refused,
    disarm_under_water_is_refused,
    receives_reason_of_refusal,
    timesync_follows_wall_clock,
    disarms_by_force,
    clears_the_mission,
    lists_logs,
    downloads_a_log,
    lists_files,
    missing_file_is_reported_at_once,
    reports_no_breach_or_lost_link,
    telemetry_log_is_read_by_pymavlink,
]


ARDUSUB_MODES = {
    "MANUAL": 19,
    "STABILIZE": 0,
    "ALT_HOLD": 2,
    "POSHOLD": 16,
    "SURFACE": 9,
    "GUIDED": 4,
    "AUTO": 3,
}


def downloads_every_parameter(p: Person) -> None:
    p.ask("param fetch", f"Received {len(DEFAULTS)} parameters", 60.0)


def _has_mode(p: Person, number: int) -> bool:
    return bool(p.latest("HEARTBEAT")["custom_mode"] == number)


def sets_ardusubs_modes_without_a_mode_map(p: Person) -> None:
    """Check the names of MAVProxy's own table, in the command and in HEARTBEAT."""
    for name, number in ARDUSUB_MODES.items():
        p.ask(f"mode {name}", f"Mode {name}")
        p.until(partial(_has_mode, p, number), f"HEARTBEAT never had mode {number}")
    require("Mode(" not in p.console.output, "a mode was shown as a number")


def loads_a_plan_with_home_first(p: Person) -> None:
    """Check a file as Mission Planner writes it: line 0 is home and is not flown."""
    plan = write_plan(p.console.folder / "home.txt", [Item(16), *ITEMS])
    p.upload(
        plan, rf"Sent all {len(ITEMS) + 1} waypoints[\s\S]*MISSION_ACK: TYPE_MISSION: ACCEPTED"
    )


def overrides_a_channel(p: Person) -> None:
    """Check RC_CHANNELS_OVERRIDE: the vehicle reports the channel back."""
    p.console.type_line("rc 4 1600")

    def reported() -> bool:
        _, channels = p.console.messages().get("RC_CHANNELS", (0, {}))
        return bool(channels.get("chan4_raw") == 1600)

    p.until(reported, "RC_CHANNELS never had the value")
    p.console.type_line("rc all 0")


def stream_requests_set_rates(p: Person) -> None:
    """Check REQUEST_DATA_STREAM, which MAVProxy repeats with its stream rate."""
    p.ask("module load messagerate", "Loaded module messagerate|already loaded")
    p.console.type_line("set streamrate 2")

    def is_set() -> bool:
        rate = p.ask("messagerate get ATTITUDE", r"Msg:ATTITUDE +rate:([\d.]+)Hz")[1]
        return float(rate) == 2.0

    p.until(is_set, "the rate of ATTITUDE never became 2 Hz", 60.0)


def arms_in_guided(p: Person) -> None:
    p.ask("mode GUIDED", "Mode GUIDED")
    p.ask("arm throttle", "^(?:.*> )?ARMED")
    p.ask("disarm", "DISARMED")


def flies_in_auto(p: Person) -> None:
    p.ask("mode AUTO", "Mode AUTO")
    p.ask("arm throttle", "^(?:.*> )?ARMED")
    p.until(lambda: p.latest("VFR_HUD")["groundspeed"] > 0.3, "the vehicle does not move", 60.0)
    p.ask("disarm force", "DISARMED")


ARDUSUB: list[Check] = [
    detects_the_vehicle,
    downloads_every_parameter,
    sets_a_parameter,
    unknown_parameter_is_reported,
    sets_ardusubs_modes_without_a_mode_map,
    loads_a_plan_with_home_first,
    overrides_a_channel,
    stream_requests_set_rates,
    arms_in_guided,
    flies_in_auto,
    reports_no_breach_or_lost_link,
    telemetry_log_is_read_by_pymavlink,
]
SHORT: list[Check] = [
    detects_the_vehicle,
    receives_the_parameters,
    sets_a_parameter,
    lists_every_mode,
    sets_every_mode_by_name,
    sends_the_mission,
    fetches_the_mission,
    arms_and_disarms,
    starts_the_mission,
    receives_every_stream,
    timesync_follows_wall_clock,
    disarms_by_force,
    lists_logs,
    downloads_a_log,
    reports_no_breach_or_lost_link,
]


def carry_out(checks: list[Check], person: Person) -> dict[str, dict[str, Any]]:
    verdicts = {}
    for check in checks:
        began_s, problem = time.monotonic(), None
        try:
            check(person)
        except Exception as error:
            problem = error
        verdicts[name_of(check)] = verdict(problem, began_s)
    return verdicts


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("master")
    parser.add_argument("--baud", type=int)
    parser.add_argument("--speed", type=float, default=1.0)
    parser.add_argument("--slow", action="store_true")
    parser.add_argument("--short", action="store_true")
    parser.add_argument("--ardusub", action="store_true")
    options = parser.parse_args()
    console = Console(options.folder, options.master, options.baud)
    try:
        results = carry_out(
            ARDUSUB if options.ardusub else SHORT if options.short else EVERY,
            Person(console, speed=options.speed, slow=options.slow),
        )
    finally:
        console.close()
    (options.folder / "said.txt").write_text(console.output)
    print(report(results), flush=True)
