"""Check every command of MAVProxy's ``help``, one by one; print one JSON object.

Usage: python -m tests.clients.mavproxy_commands FOLDER MASTER

FOLDER becomes MAVProxy's home, with the names of the modes. The vehicle must be moored and
disarmed. `COMMANDS` has the commands in the order in which they are typed.
"""

import argparse
import json
import re
import time
from pathlib import Path
from typing import NamedTuple

from tests.clients.checklist import require
from tests.clients.mavproxy_checks import Person, write_plan
from tests.clients.mavproxy_console import END, Console
from tests.clients.vehicle import leg_items

ACCEPTED, REFUSED, NO_EFFECT, LOCAL = "works", "refused", "no effect", "local"
PLACE = "42.35 -71.0"
REALLY = "IREALLYMEANIT"
"""Argument without which MAVProxy does not send a command that stops an autopilot."""


class Typed(NamedTuple):
    """One command as it is typed, and the expected output."""

    name: str
    line: str = ""
    """Line to type; the name without arguments if empty."""
    pattern: str = ""
    """Regular expression of the output; empty if the vehicle does not answer."""
    result: str = ACCEPTED
    before: str = ""
    """Line that is typed first, without a check."""


def _ack(name: str, line: str, command: str, result: str = "ACCEPTED", before: str = "") -> Typed:
    """Return a command whose answer is a COMMAND_ACK."""
    kind = ACCEPTED if result == "ACCEPTED" else REFUSED
    return Typed(name, line, f"{command}: {result}", kind, before)


def _refused(name: str, line: str, command: str) -> Typed:
    """Return a command that the vehicle does not support."""
    return _ack(name, line, command, "UNSUPPORTED")


def _calibration(line: str) -> Typed:
    """Return a calibration that the vehicle does by itself."""
    return Typed(line, line, r"PREFLIGHT_CALIBRATION: DENIED|Calibration response \(2\)", REFUSED)


def _nasty(name: str) -> Typed:
    """Return a command for tests of ArduPilot's watchdog."""
    return _refused(name, f"{name} {REALLY}", "PREFLIGHT_REBOOT_SHUTDOWN")


DISARMED = (
    Typed("mode", "mode DEPTH", "Mode DEPTH"),
    Typed("param", "param fetch HDG_P", r"HDG_P = [\d.]+"),
    Typed("wp", "wp load leg.txt", "MISSION_ACK: TYPE_MISSION: ACCEPTED"),
    Typed("fence", "fence list", "Requesting 0 fence items|Saved 0|Loaded 0|0 fence"),
    Typed("rally", "rally list", "Requesting 0 rally items|Saved 0|Loaded 0|0 rally"),
    Typed("ftp", "ftp list /", "D logs"),
    *(
        Typed(name, "status AUTOPILOT_VERSION", "AUTOPILOT_VERSION {", before=line)
        for name, line in (
            ("version", "version"),
            ("capabilities", "capabilities"),
            ("long", "long REQUEST_MESSAGE 148"),
            ("command_int", "command_int GLOBAL REQUEST_MESSAGE 0 0 148 0 0 0 0 0 0"),
        )
    ),
    Typed("gethome", "status HOME_POSITION", "HOME_POSITION {", before="gethome"),
    Typed("ping", pattern="ping response"),
    Typed("setorigin", f"setorigin {PLACE} 0", "GPS_GLOBAL_ORIGIN|Setting origin"),
    Typed("alt", pattern="Altitude: "),
    Typed("bat", pattern="Flight battery|No battery information"),
    Typed("time", pattern=r"No SYSTEM_TIME|\d\d:\d\d:\d\d"),
    Typed("status", "status HEARTBEAT", "HEARTBEAT {"),
    Typed("calpress", pattern="PREFLIGHT_CALIBRATION: ACCEPTED|Calibrated"),
    _ack("wipe_parameters", "wipe_parameters", "PREFLIGHT_STORAGE"),
    *map(_calibration, ("accelcal", "accelcalsimple", "ahrstrim", "gyrocal")),
    _calibration("compassmot"),
    Typed(
        "forcecal",
        "forcecal accel",
        r"PREFLIGHT_CALIBRATION: DENIED|Calibration response \(2\)",
        REFUSED,
    ),
    _refused("magcal", "magcal start", "DO_START_MAG_CAL"),
    _refused("motortest", "motortest 1 0 10 1", "DO_MOTOR_TEST"),
    _refused("servo", "servo set 1 1500", "DO_SET_SERVO"),
    _refused("relay", "relay set 0 1", "DO_SET_RELAY"),
    _refused("batreset", "batreset", "BATTERY_RESET"),
    _refused("parachute", "parachute release", "DO_PARACHUTE"),
    _refused("engine", "engine start", "DO_ENGINE_CONTROL"),
    _refused("gear", "gear up", "AIRFRAME_CONFIGURATION"),
    # MAVProxy does not show the acknowledgement of these two
    Typed("cammsg", pattern="Sent DIGICAM_CONTROL", result=REFUSED),
    Typed("canforward", "canforward 1", result=REFUSED),
    _refused("camctrlmsg", "camctrlmsg", "DO_DIGICAM_CONFIGURE"),
    _refused("rcbind", "rcbind 0", "START_RX_PAIR"),
    _refused("scripting", "scripting stop", "SCRIPTING"),
    _refused("formatsdcard", "formatsdcard", "STORAGE_FORMAT"),
    _refused("flashbootloader", "flashbootloader", "FLASH_BOOTLOADER"),
    *map(
        _nasty,
        (
            *("lockup_autopilot", "corrupt_params", "hardfault_autopilot", "panic_autopilot"),
            *("longloop_autopilot", "configerror_autopilot", "internalerror_autopilot"),
            *("dfu_boot", "deadlock", "nullptr_read", "nullptr_write"),
        ),
    ),
    Typed("rc", "rc 4 1600", result=NO_EFFECT),
    Typed("switch", "switch 1", result=NO_EFFECT),
    Typed("led", "led 1 2 3", result=NO_EFFECT),
    Typed("oreoled", "oreoled 1 2 3 4", result=NO_EFFECT),
    Typed("playtune", "playtune AB", result=NO_EFFECT),
    Typed("cammsg_old", "cammsg_old", result=NO_EFFECT),
    Typed("namedvaluefloat", "namedvaluefloat a 1", result=NO_EFFECT),
)
"""Commands that are typed while the vehicle is moored."""
ARMED = (
    Typed("arm", "arm throttle", "^(?:.*> )?ARMED", before="mode HOLD"),
    _ack("setspeed", "setspeed 1.0", "DO_CHANGE_SPEED"),
    _ack("setyaw", "setyaw 90 5 0", "CONDITION_YAW"),
    _ack("changealt", "changealt -3", "DO_CHANGE_ALTITUDE"),
    _ack("changealt_abs", "changealt_abs -3", "DO_CHANGE_ALTITUDE"),
    _ack("guided", f"guided {PLACE} -3", "DO_REPOSITION"),
    Typed("velocity", "mode OFFBOARD", "Mode OFFBOARD", before="velocity 1 0 0"),
    Typed("attitude", "mode OFFBOARD", "Mode OFFBOARD|OFFBOARD>", before="attitude 1 0 0 0 0.5"),
    Typed("posvel", "mode OFFBOARD", "Mode OFFBOARD|OFFBOARD>", before="posvel 1 0 0"),
    _ack("pause", "pause", "DO_PAUSE_CONTINUE"),
    _ack("resume", "resume", "DO_PAUSE_CONTINUE"),
    _refused("takeoff", "takeoff 2", "NAV_TAKEOFF"),
    Typed("position", "mode STATION", "Mode STATION|STATION>", before="position 0 0 1"),
    _ack("land", "land", "DO_LAND_START"),
    Typed("disarm", "disarm force", "DISARMED"),
    Typed("log", "log list", r"Log \d+ +numLogs|No logs"),
    _ack("reboot", "reboot", "PREFLIGHT_REBOOT_SHUTDOWN"),
)
"""Commands of the armed vehicle; at the end it is disarmed and restarted."""
COMMANDS = (*DISARMED, *ARMED)
OF_MAVPROXY = frozenset(
    (
        *("adsb", "alias", "alllinks", "clear", "click", "confirm", "layout", "link", "module"),
        *("output", "repeat", "reset", "script", "set", "setup", "shell", "terrain", "vehicle"),
        *("watch", "devid", "auxopt", "tuneopt", "up", "magresetofs", "magsetfield", "signing"),
        *("notes", "ground", "level"),
    )
)
"""Commands about MAVProxy itself or parameters of ArduPilot; `ground` and `level` of 1.8.75 send
nothing."""


def run(person: Person, typed: Typed) -> dict[str, str]:
    """Type a command; return the result, and the difference from the expected one ("" for none)."""
    try:
        if typed.before:
            person.console.type_line(typed.before)
        line = typed.line or typed.name
        if line.startswith("status "):  # of a message that may not have arrived yet
            person.console.ask(line, typed.pattern, attempts=5)
        elif typed.pattern:
            person.ask(line, typed.pattern)
        else:
            person.console.type_line(line)
            person.ask(END, f"Unknown command '{END}'")
    except Exception as error:
        return {"result": "failed", "why": f"{type(error).__name__}: {error}"[:500]}
    return {"result": typed.result, "why": ""}


def commands_of_help(person: Person) -> set[str]:
    """Return the names of the commands that MAVProxy lists."""
    person.console.type_line("help")
    time.sleep(1.0)
    person.ask(END, f"Unknown command '{END}'")
    return set(re.findall(r"^(?:\S*> )?([a-z_]+) +: ", person.console.output, re.MULTILINE))


def main(folder: Path, master: str) -> None:
    write_plan(folder / "leg.txt", leg_items())
    console = Console(folder, master, None)
    try:
        person = Person(console, speed=1.0, slow=False)
        console.wait_for("Detected vehicle 1:1 on link 0", 60.0)
        listed = commands_of_help(person)
        results = {name: {"result": "", "why": "not tried"} for name in listed}
        results |= {name: {"result": LOCAL, "why": ""} for name in listed & OF_MAVPROXY}
        results |= {typed.name: run(person, typed) for typed in COMMANDS}
        require("Traceback" not in console.output, "MAVProxy had an error of its own")
    finally:
        console.close()
        (folder / "said.txt").write_text(console.output)
    print(json.dumps(dict(sorted(results.items()))), flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("master")
    options = parser.parse_args()
    main(options.folder, options.master)
