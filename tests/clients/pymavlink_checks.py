"""Check the use of the vehicle by pymavlink: its connection, and its programs; print JSON.

Usage: python -m tests.clients.pymavlink_checks FOLDER ADDRESS [--slow]

FOLDER is the home directory: ``ground modes export-mavproxy`` has put the names of the modes there.
The programs read the telemetry log that the connection records; ``mavftp`` uses the link itself.
"""

import argparse
import contextlib
import json
import os
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from pymavlink import mavparm, mavutil, mavwp

from tests.clients.checklist import (
    RefutedError,
    close,
    equal,
    name_of,
    report,
    require,
    verdict,
)
from tests.clients.vehicle import DEFAULTS, FRAME_MISSION, leg_items

MODES = ("MANUAL", "DEPTH", "STATION", "HOLD", "SURFACE", "STABILIZE", "MISSION")
TIMEOUT_S, RETRY_S, ATTEMPTS = 60.0, 1.5, 10
ACCEPTED, DENIED, UNSUPPORTED = 0, 2, 3
BAUD = 57_600
TOOL_S = 120.0
LAST_ITEM_S = 5.0
"""Time without a request after which the last item is sent again; the vehicle's is 1.5 s."""
FTP_ATTEMPTS = 4
LOG, MIN_LOG_BYTES = "flight.tlog", 20_000
ITEMS = leg_items()


class Session:
    """A connection of pymavlink, its home directory, and what the checks share."""

    def __init__(self, folder: Path, address: str, *, slow: bool) -> None:
        self.folder, self.address, self.slow = folder, address, slow
        self.link: Any = mavutil.mavlink_connection(address, baud=BAUD, source_system=250)
        self._log = (folder / LOG).open("wb")
        self._count = self.link.post_message
        self.link.post_message = self._record
        self.parameters = mavparm.MAVParmDict()
        self.texts: list[str] = []
        self._beat_s = 0.0

    def receive(self, name: str | None = None, timeout_s: float = 0.2, **options: Any) -> Any:
        """Return the next message, of a name if given, or None; send a heartbeat every second."""
        if time.monotonic() - self._beat_s > 1.0:
            self._beat_s = time.monotonic()
            self.link.mav.heartbeat_send(6, 8, 0, 0, 4)
        message = self.link.recv_match(blocking=True, timeout=timeout_s, **options)
        if message is not None and message.get_type() == "STATUSTEXT":
            self.texts.append(message.text)
        return message if name is None or message is None or message.get_type() == name else None

    def _record(self, message: Any) -> None:
        """Write each received message to a telemetry log; over UDP ``setup_logfile`` does not."""
        self._count(message)
        if message.get_type() != "BAD_DATA":
            stamp = struct.pack(">Q", round(message._timestamp * 1e6))
            self._log.write(stamp + message.get_msgbuf())

    def close(self) -> None:
        """Close the link and the log."""
        self.link.close()
        self._log.close()

    def until(self, wanted: Callable[[], object], what: str) -> None:
        """Receive until a condition is met. Raises RefutedError with ``what`` after a time."""
        deadline_s = time.monotonic() + TIMEOUT_S
        while not wanted():
            require(time.monotonic() < deadline_s, what)
            self.receive()

    def ask(
        self, send: Callable[[], None], name: str, wanted: Callable[[Any], bool] = lambda m: True
    ) -> Any:
        """Send a request until one of its answers arrives."""
        for _ in range(ATTEMPTS):
            send()
            deadline_s = time.monotonic() + RETRY_S
            while time.monotonic() < deadline_s:
                answer = self.receive(name)
                if answer is not None and wanted(answer):
                    return answer
        raise TimeoutError(f"no {name} after {ATTEMPTS} requests")

    def result(self, number: int, send: Callable[[], None]) -> int:
        """Return the result of the command that a method of pymavlink sends."""
        return int(self.ask(send, "COMMAND_ACK", lambda ack: ack.command == number).result)

    def command(self, number: int, *parameters: float) -> int:
        filled = (*parameters, *(0.0,) * (7 - len(parameters)))
        return self.result(
            number, lambda: self.link.mav.command_long_send(1, 1, number, 0, *filled)
        )


Check = Callable[[Session], None]


def waits_for_the_heartbeat(s: Session) -> None:
    beat = s.link.wait_heartbeat(timeout=TIMEOUT_S)
    require(beat is not None, "wait_heartbeat returned nothing")
    equal((s.link.target_system, beat.type, beat.autopilot), (1, 12, 0), "system and type")


def shows_the_flight_mode(s: Session) -> None:
    s.until(lambda: s.link.flightmode == "HOLD", f"flightmode is {s.link.flightmode}")


def lists_every_mode(s: Session) -> None:
    require(set(MODES) <= set(s.link.mode_mapping()), f"mode_mapping is {s.link.mode_mapping()}")


def sets_every_mode(s: Session) -> None:
    for mode in MODES:
        equal(s.result(176, partial(s.link.set_mode, mode)), ACCEPTED, f"result of {mode}")
        s.until(partial(_is_in_mode, s, mode), f"flightmode is never {mode}")


def _is_in_mode(s: Session, mode: str) -> bool:
    return bool(s.link.flightmode == mode)


def number_of_another_autopilot_is_refused(s: Session) -> None:
    """Check ``set_mode_manual``, which sends no custom mode."""
    equal(s.result(176, s.link.set_mode_manual), DENIED, "result")


def fetches_all_parameters(s: Session) -> None:
    s.link.param_fetch_all()
    deadline_s = time.monotonic() + TIMEOUT_S
    while len(s.link.params) < len(DEFAULTS) and time.monotonic() < deadline_s:
        quiet = s.receive("PARAM_VALUE", RETRY_S) is None
        for name in [n for n in DEFAULTS if n not in s.link.params][:5] if quiet and s.slow else []:
            s.link.param_fetch_one(name)
    equal({n: s.link.param(n) for n in DEFAULTS}, DEFAULTS, "parameters")


def sets_a_parameter(s: Session) -> None:
    """Check ``MAVParmDict.mavset``, which waits for PARAM_VALUE."""
    for value in (0.75, DEFAULTS["HDG_P"]):
        done = s.parameters.mavset(s.link, "HDG_P", value, retries=ATTEMPTS)
        require(done, "mavset returned False")
        close(s.link.param("HDG_P"), value, 1e-6, "HDG_P")


def saves_and_loads_parameters(s: Session) -> None:
    """Check a parameter file: ``save``, ``load`` into the vehicle, ``mavparmdiff.py``."""
    own, path = mavparm.MAVParmDict(), s.folder / "own.param"
    own.update({"STN_RADIUS_M": 25.0, "HDG_P": DEFAULTS["HDG_P"]})
    own.save(str(path))
    s.parameters.update({n: s.link.param(n) for n in ("STN_RADIUS_M", "HDG_P")})
    require(s.parameters.load(str(path), mav=s.link, check=False), "load returned False")
    value = s.ask(
        lambda: s.link.param_fetch_one("STN_RADIUS_M"),
        "PARAM_VALUE",
        lambda m: m.param_id == "STN_RADIUS_M",
    ).param_value
    equal(value, 25.0, "STN_RADIUS_M")
    s.parameters.mavset(s.link, "STN_RADIUS_M", DEFAULTS["STN_RADIUS_M"], retries=ATTEMPTS)


def unknown_parameter_is_reported(s: Session) -> None:
    answer = s.ask(
        lambda: s.link.param_fetch_one("NO_SUCH"), "PARAM_ERROR", lambda m: m.param_id == "NO_SUCH"
    )
    equal(answer.error, 1, "error")  # MAV_PARAM_ERROR_DOES_NOT_EXIST


def waits_for_a_satellite_fix(s: Session) -> None:
    s.link.wait_gps_fix()
    here = s.link.location(relative_alt=True)
    require(here.lat != 0 and here.lng != 0, "location lies nowhere")
    close(here.alt, 0.0, 1.0, "altitude at the surface")


def write_mission(s: Session, items: list[Any]) -> int:
    """Upload items as pymavlink's examples do; return the type of the MISSION_ACK."""

    def count() -> None:
        s.link.waypoint_count_send(len(items))

    request = s.ask(count, "MISSION_REQUEST_INT", lambda m: m.seq == 0)
    deadline_s = time.monotonic() + TIMEOUT_S
    while time.monotonic() < deadline_s:
        name = "" if request is None else request.get_type()
        if name == "MISSION_ACK":
            return int(request.type)
        if name == "MISSION_REQUEST_INT":
            item, sent_s = items[request.seq], time.monotonic()
            s.link.mav.send(item)
        elif time.monotonic() > sent_s + LAST_ITEM_S:  # the acknowledgement may be lost
            s.link.mav.send(item)
            sent_s = time.monotonic()
        request = s.receive(None)
    raise TimeoutError("no MISSION_ACK")


def mission_items() -> list[Any]:
    loader = mavwp.MAVWPLoader(1, 1)
    for n, (command, *p) in enumerate(ITEMS):
        item = mavutil.mavlink.MAVLink_mission_item_int_message(
            1, 1, n, FRAME_MISSION, command, int(n == 0), 1, *p, 0, 0, 0
        )
        loader.add(item)
    return list(loader.wpoints)


def sends_the_mission(s: Session) -> None:
    equal(write_mission(s, mission_items()), 0, "MISSION_ACK")


def _is_item(number: int, message: Any) -> bool:
    return bool(message.seq == number)


def fetches_the_mission(s: Session) -> None:
    """Check the download item by item into a ``MAVWPLoader``, and its file."""
    loader = mavwp.MAVWPLoader(1, 1)
    count = s.ask(s.link.waypoint_request_list_send, "MISSION_COUNT").count
    for n in range(count):
        item = s.ask(
            partial(s.link.mav.mission_request_int_send, 1, 1, n),
            "MISSION_ITEM_INT",
            partial(_is_item, n),
        )
        loader.add(item)
    s.link.mav.mission_ack_send(1, 1, 0)
    path = s.folder / "mission.txt"
    loader.save(str(path))
    again = mavwp.MAVWPLoader(1, 1)
    again.load(str(path))
    equal([w.command for w in again.wpoints], [row.command for row in ITEMS], "commands")
    equal(again.wp(2).param1, 40.0, "param1 of the heading")


def impossible_mission_is_refused(s: Session) -> None:
    high = mavutil.mavlink.MAVLink_mission_item_int_message(
        1, 1, 0, 3, 16, 1, 1, 0, 0, 0, 0, 0, 0, 5.0
    )
    equal(write_mission(s, [high]), mavutil.mavlink.MAV_MISSION_INVALID_PARAM7, "MISSION_ACK")


def calibrates_pressure(s: Session) -> None:
    equal(s.result(241, s.link.calibrate_pressure), ACCEPTED, "result")


def meaningless_commands_are_refused(s: Session) -> None:
    """Check ``set_relay``, ``set_servo`` and ``calibrate_level``."""
    equal(s.result(181, s.link.set_relay), UNSUPPORTED, "result of set_relay")
    equal(s.result(183, lambda: s.link.set_servo(1, 1500)), UNSUPPORTED, "result of set_servo")
    require(s.result(241, s.link.calibrate_level) != ACCEPTED, "calibrate_level is accepted")


def arms_and_disarms(s: Session) -> None:
    s.result(176, lambda: s.link.set_mode("HOLD"))
    equal(s.result(400, s.link.arducopter_arm), ACCEPTED, "result of arducopter_arm")
    s.link.motors_armed_wait()
    equal(s.result(400, s.link.arducopter_disarm), ACCEPTED, "result of arducopter_disarm")
    s.link.motors_disarmed_wait()


def starts_the_mission(s: Session) -> None:
    """Check ``set_mode_auto``, which sends MISSION_START."""
    equal(s.result(400, s.link.arducopter_arm), ACCEPTED, "result of arducopter_arm")
    equal(s.result(300, s.link.set_mode_auto), ACCEPTED, "result of set_mode_auto")
    s.until(lambda: s.link.flightmode == "MISSION", "flightmode is never MISSION")


def dives(s: Session) -> None:
    """Check conditions over fields, as pymavlink's scripts use them."""
    condition = "GLOBAL_POSITION_INT.relative_alt < -1500"
    deadline_s = time.monotonic() + TIMEOUT_S
    while s.receive("GLOBAL_POSITION_INT", 1.0, condition=condition) is None:
        require(time.monotonic() < deadline_s, "is never 1.5 m down")
    s.until(lambda: s.link.field("VFR_HUD", "alt", 0.0) < -1.0, "alt is not up")
    s.until(lambda: s.link.waypoint_current() == 3, "item 3 is never current")


def sets_current_mission_item(s: Session) -> None:
    s.ask(
        lambda: s.link.waypoint_set_current_send(1), "MISSION_CURRENT", lambda m: m.seq in (1, 2, 3)
    )


def pauses_and_returns(s: Session) -> None:
    """Check ``set_mode_loiter`` and ``set_mode_rtl``."""
    equal(s.result(17, s.link.set_mode_loiter), ACCEPTED, "result of set_mode_loiter")
    s.until(lambda: s.link.flightmode == "HOLD", "flightmode is never HOLD")
    equal(s.result(20, s.link.set_mode_rtl), ACCEPTED, "result of set_mode_rtl")
    s.until(lambda: s.link.flightmode == "RTL", "flightmode is never RTL")


def reboot_while_armed_is_refused(s: Session) -> None:
    """Check ``reboot_autopilot``, and the reason of its refusal."""
    deadline_s = time.monotonic() + TIMEOUT_S
    while "Reboot refused: armed" not in " ".join(s.texts):
        require(s.result(246, s.link.reboot_autopilot) not in (ACCEPTED, UNSUPPORTED), "accepted")
        s.receive("STATUSTEXT", 1.0)
        require(time.monotonic() < deadline_s, f"texts are {s.texts}")


def disarms_by_force(s: Session) -> None:
    equal(s.command(400, 0, 21196), ACCEPTED, "result")
    s.link.motors_disarmed_wait()


def counts_lost_packets(s: Session) -> None:
    """Check ``packet_loss``: no sequence number of the vehicle is missing but for lost frames."""
    lost_percent = s.link.packet_loss()
    require(lost_percent < (20.0 if s.slow else 1.0), f"{lost_percent:.1f} % of packets lost")


def clears_the_mission(s: Session) -> None:
    equal(s.ask(s.link.waypoint_clear_all_send, "MISSION_ACK").type, 0, "MISSION_ACK")


def records_a_telemetry_log(s: Session) -> None:
    """Check that the log is complete when it is closed."""
    s.close()
    require((s.folder / LOG).stat().st_size > MIN_LOG_BYTES, "the log is nearly empty")


def tool(s: Session, program: str, *arguments: str) -> str:
    """Run a program of pymavlink; return what it prints."""
    environment = {**os.environ, "HOME": str(s.folder), "MPLBACKEND": "agg"}
    path = Path(sys.executable).with_name(program)
    command = [str(path)] if path.exists() else ["-m", f"pymavlink.{program}"]
    done = subprocess.run(
        [sys.executable, *command, *arguments],
        cwd=s.folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=TOOL_S,
        check=False,
    )
    require("Traceback" not in done.stderr, f"{program}: {done.stderr[-300:]}")
    equal(done.returncode, 0, f"{program}: {(done.stderr or done.stdout)[-300:]}: status")
    return done.stdout + done.stderr


def ftp(s: Session, *arguments: str, shows: tuple[str, ...] = ()) -> str:
    """Run ``mavftp``, which must show some texts; on a noisy line again, as a user would.

    It asks for a list once only, and calls a list without its last answer a success.
    """
    baud = ["--baudrate", str(BAUD)] if s.address.startswith("/") else []

    def attempt() -> str:
        shown = tool(s, "mavftp", "--device", s.address, *baud, *arguments)
        require(all(text in shown for text in shows), shown[-300:])
        return shown

    for _ in range(FTP_ATTEMPTS - 1 if s.slow else 0):
        with contextlib.suppress(RefutedError, subprocess.TimeoutExpired):
            return attempt()
    return attempt()


def mavftp_lists_files(s: Session) -> None:
    ftp(s, "list", "/", shows=("params", "logs"))


def mavftp_downloads_a_file(s: Session) -> None:
    path = s.folder / "current.param"
    ftp(s, "get", "/params/current.param", str(path))
    require("HDG_P" in path.read_text(), "the file has no HDG_P")


def mavftp_downloads_parameters(s: Session) -> None:
    """Check ``getparams``: the packed file @PARAM/param.pck."""
    path = s.folder / "all.param"
    ftp(s, "getparams", str(path))
    names = {line.replace(",", " ").split()[0] for line in path.read_text().splitlines() if line}
    equal(set(DEFAULTS) - names, set(), "missing parameters")


def mavlogdump_prints_messages(s: Session) -> None:
    shown = tool(s, "mavlogdump.py", "--types", "ATTITUDE,HEARTBEAT", LOG)
    require(shown.count("ATTITUDE {") > 20, f"few attitudes: {shown[-200:]}")


def mavlogdump_writes_json(s: Session) -> None:
    shown = tool(s, "mavlogdump.py", "--format", "json", "--types", "GLOBAL_POSITION_INT", LOG)
    rows = [json.loads(line) for line in shown.splitlines() if line.startswith("{")]
    require(min(row["data"]["relative_alt"] for row in rows) < -1500, "no depth")


def mavlogdump_writes_csv(s: Session) -> None:
    shown = tool(s, "mavlogdump.py", "--format", "csv", "--types", "VFR_HUD", LOG)
    require(shown.splitlines()[0].startswith("timestamp,"), shown[:100])
    require(len(shown.splitlines()) > 20, "few rows")


def mavlogdump_filters_by_condition(s: Session) -> None:
    shown = tool(s, "mavlogdump.py", "--condition", "HEARTBEAT.custom_mode==67371008", LOG)
    require("HEARTBEAT" in shown, "nothing in mode MISSION")


def mavsummarize_reports_distance(s: Session) -> None:
    shown = tool(s, "mavsummarize.py", LOG)
    require("Total distance" in shown or "distance" in shown.lower(), shown[-300:])


def mavflightmodes_names_the_modes(s: Session) -> None:
    shown = tool(s, "mavflightmodes.py", LOG)
    require("MISSION" in shown and "HOLD" in shown, shown[-300:])


def mavparms_lists_parameters(s: Session) -> None:
    shown = tool(s, "mavparms.py", LOG)
    equal([n for n in DEFAULTS if n not in shown], [], "missing parameters")


def mavparmdiff_compares_files(s: Session) -> None:
    shown = tool(s, "mavparmdiff.py", "own.param", "all.param")
    require("STN_RADIUS_M" in shown, shown[-300:])


def mavmission_extracts_the_mission(s: Session) -> None:
    tool(s, "mavmission.py", "--output", "from_log.txt", LOG)
    loader = mavwp.MAVWPLoader()
    loader.load(str(s.folder / "from_log.txt"))
    require(93 in [w.command for w in loader.wpoints], "no NAV_DELAY")


def mavkml_and_mavtogpx_draw_the_track(s: Session) -> None:
    tool(s, "mavtogpx.py", LOG)
    require("<trkpt" in (s.folder / "flight.tlog.gpx").read_text(), "no points in the GPX file")


def mavloss_counts_lost_packets(s: Session) -> None:
    shown = tool(s, "mavloss.py", LOG)
    require("packets" in shown, shown[-300:])


def mavgpslock_finds_the_fix(s: Session) -> None:
    require("GPS" in tool(s, "mavgpslock.py", LOG), "no line about GPS")


def mavflighttime_counts_the_dive(s: Session) -> None:
    require("Total" in tool(s, "mavflighttime.py", LOG), "no total")


def mavsearch_finds_a_field(s: Session) -> None:
    shown = tool(s, "mavsearch.py", "--types", "VFR_HUD", "--condition", "VFR_HUD.alt<-1", LOG)
    require("VFR_HUD" in shown, shown[-300:])


def mavextract_cuts_the_log(s: Session) -> None:
    tool(s, "mavextract.py", "--mode", "mission", LOG)
    require(any(s.folder.glob("*MISSION*")), "no piece of the log")


LIVE: list[Check] = [
    waits_for_the_heartbeat,
    shows_the_flight_mode,
    lists_every_mode,
    fetches_all_parameters,
    sets_a_parameter,
    saves_and_loads_parameters,
    unknown_parameter_is_reported,
    sets_every_mode,
    number_of_another_autopilot_is_refused,
    waits_for_a_satellite_fix,
    sends_the_mission,
    fetches_the_mission,
    impossible_mission_is_refused,
    calibrates_pressure,
    meaningless_commands_are_refused,
    arms_and_disarms,
    starts_the_mission,
    dives,
    sets_current_mission_item,
    pauses_and_returns,
    reboot_while_armed_is_refused,
    disarms_by_force,
    counts_lost_packets,
    clears_the_mission,
    records_a_telemetry_log,
]
PROGRAMS: list[Check] = [
    mavftp_lists_files,
    mavftp_downloads_a_file,
    mavftp_downloads_parameters,
    mavlogdump_prints_messages,
    mavlogdump_writes_json,
    mavlogdump_writes_csv,
    mavlogdump_filters_by_condition,
    mavsummarize_reports_distance,
    mavflightmodes_names_the_modes,
    mavparms_lists_parameters,
    mavparmdiff_compares_files,
    mavmission_extracts_the_mission,
    mavkml_and_mavtogpx_draw_the_track,
    mavloss_counts_lost_packets,
    mavgpslock_finds_the_fix,
    mavflighttime_counts_the_dive,
    mavsearch_finds_a_field,
    mavextract_cuts_the_log,
]
EVERY = [*LIVE, *PROGRAMS]


def main(folder: Path, address: str, *, slow: bool) -> None:
    session, verdicts = Session(folder, address, slow=slow), {}
    for check in EVERY:
        began_s, problem = time.monotonic(), None
        try:
            check(session)
        except Exception as error:
            problem = error
        verdicts[name_of(check)] = verdict(problem, began_s)
    print(report(verdicts), flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("address")
    parser.add_argument("--slow", action="store_true")
    options = parser.parse_args()
    mavutil.set_dialect("all")
    main(options.folder, options.address, slow=options.slow)
