"""Check the use of the vehicle, as ``--autopilot-id ardupilot``, by DroneKit; print a JSON object.

Usage: python -m tests.clients.dronekit_checks ADDRESS [--slow]
"""

import argparse
import contextlib
import time
from collections.abc import Callable
from typing import Any

import dronekit
from pymavlink import mavutil

from autopilot.control.params import PARAMETERS
from tests.clients.checklist import close, equal, name_of, report, require, verdict

TIMEOUT_S = 60.0
REPEAT_S = 4.0
"""Time until a user repeats what DroneKit does not."""
BAUD = 57_600
MODES = ("ALT_HOLD", "STABILIZE", "POSHOLD", "SURFACE", "MANUAL", "GUIDED")
RELATIVE, WAYPOINT, DELAY = 3, 16, 93
Check = Callable[[Any], None]


def until(
    wanted: Callable[[], object], what: str, attempt: Callable[[], object] | None = None
) -> None:
    """Wait for a condition; repeat an attempt that DroneKit makes only once, as a user would.

    Raises RefutedError with ``what`` after the time limit.
    """
    deadline_s, repeat_s = time.monotonic() + TIMEOUT_S, 0.0
    while not wanted():
        require(time.monotonic() < deadline_s, what)
        if attempt is not None and time.monotonic() > repeat_s:
            attempt()
            repeat_s = time.monotonic() + REPEAT_S
        time.sleep(0.05)


def set_mode(v: Any, name: str) -> None:
    until(
        lambda: v.mode.name == name,
        f"mode {name} is not shown",
        lambda: setattr(v, "mode", dronekit.VehicleMode(name)),
    )


def arm(v: Any, armed: bool = True) -> None:
    until(lambda: v.armed == armed, f"armed is {v.armed}", lambda: setattr(v, "armed", armed))


def reads_every_parameter(v: Any) -> None:
    equal(len(v.parameters), len(PARAMETERS), "number of parameters")
    close(v.parameters["STN_RADIUS_M"], 20.0, 1e3, "STN_RADIUS_M")


def sets_a_parameter(v: Any) -> None:
    require(v.parameters.set("STN_RADIUS_M", 25.0), "set returns False")
    equal(v.parameters["STN_RADIUS_M"], 25.0, "STN_RADIUS_M")


def reads_mode_and_arming(v: Any) -> None:
    equal((v.mode.name, v.armed), ("GUIDED", False), "mode and armed")


def enters_every_mode_by_name(v: Any) -> None:
    for name in MODES:
        set_mode(v, name)


def reads_system_status(v: Any) -> None:
    equal(v.system_status.state, "STANDBY", "system_status")


def reads_version(v: Any) -> None:
    until(lambda: v._raw_version is not None, "no AUTOPILOT_VERSION")
    require(str(v.version).startswith("APM:"), f"version is {v.version}")
    until(lambda: v.capabilities.mission_int, "capability mission_int is missing")


def reads_attitude(v: Any) -> None:
    close(v.attitude.pitch, 0.0, 0.5, "pitch (rad)")


def reads_location(v: Any) -> None:
    until(lambda: v.location.global_frame.lat, "no latitude")
    until(lambda: v.location.local_frame.down is not None, "no local position")


def reads_relative_altitude(v: Any) -> None:
    until(lambda: v.location.global_relative_frame.alt is not None, "no altitude")
    close(v.location.global_relative_frame.alt, 0.0, 1.0, "altitude at the surface (m)")


def reads_velocity_and_speed(v: Any) -> None:
    until(lambda: None not in v.velocity, "no velocity")
    until(lambda: v.airspeed is not None and v.groundspeed is not None, "no speed")


def reads_heading(v: Any) -> None:
    require(0 <= v.heading < 360, f"heading is {v.heading}")


def reads_gps(v: Any) -> None:
    until(lambda: (v.gps_0.fix_type or 0) >= 3, "no satellite fix at the surface")


def reads_battery(v: Any) -> None:
    until(lambda: v.battery is not None and v.battery.voltage, "no voltage")


def reads_rangefinder(v: Any) -> None:
    until(lambda: v.rangefinder.distance is not None, "no distance")


def reads_current_as_wind(v: Any) -> None:
    until(lambda: v.wind is not None and v.wind.wind_speed is not None, "no wind")


def reports_ekf_and_armable(v: Any) -> None:
    until(lambda: v.ekf_ok, "ekf_ok is False")
    until(lambda: v.is_armable, "is_armable is False")


def reads_home(v: Any) -> None:
    until(lambda: v.home_location is not None, "no home")
    close(v.home_location.alt, 0.0, 0.0, "home's altitude")


def receives_heartbeats(v: Any) -> None:
    until(lambda: v.last_heartbeat < 2.0, f"last heartbeat {v.last_heartbeat} s ago")


def download(v: Any) -> None:
    """Download the mission.

    DroneKit sends each request of a download once (``MISSION_COUNT`` and ``MISSION_ITEM`` in
    vehicle.py), and ``download()`` cannot be called again before it has ended. The same request as
    a message of its own starts the download again.
    """
    v.commands.download()
    deadline_s = time.monotonic() + TIMEOUT_S
    while not v.commands.wait_ready(timeout=REPEAT_S, raise_exception=False):
        require(time.monotonic() < deadline_s, "the mission is not downloaded")
        v.send_mavlink(v.message_factory.mission_request_list_encode(0, 0))


def downloads_an_empty_mission(v: Any) -> None:
    download(v)
    equal(v.commands.count, 0, "number of commands")


def upload(v: Any, integer: bool) -> None:
    """Upload a mission of two items, as MISSION_ITEM_INT or as MISSION_ITEM with float degrees."""
    home = v.home_location
    commands = v.commands
    commands.clear()
    for command, p1, frame in ((WAYPOINT, 0, RELATIVE), (DELAY, 5, 2)):
        place = (home.lat + 1e-4, home.lon, -3) if frame == RELATIVE else (0, 0, 0)
        item = dronekit.Command(0, 0, 0, frame, command, 0, 0, p1, 0, 0, 0, *place)
        commands.add(dronekit.CommandInt.from_command(item) if integer else item)
    commands.upload(timeout=TIMEOUT_S)


def exchange_mission(v: Any, integer: bool) -> None:
    """Upload a mission and download it.

    DroneKit sends the number of items once, and calls an upload whose last item is lost a success:
    it is repeated until the download shows the mission.
    """
    deadline_s = time.monotonic() + TIMEOUT_S
    while True:
        with contextlib.suppress(dronekit.TimeoutError):
            upload(v, integer)
            download(v)
            if [c.command for c in v.commands] == [WAYPOINT, DELAY]:
                break
        require(time.monotonic() < deadline_s, "the mission is not uploaded")
    equal(v.commands[0].z, -3.0, "altitude of the waypoint")
    latitude = v.commands[0].x * (1e-7 if isinstance(v.commands[0].x, int) else 1.0)
    close(latitude, v.home_location.lat + 1e-4, 1e-5, "latitude of the waypoint")


def uploads_float_items_and_downloads_them(v: Any) -> None:
    exchange_mission(v, integer=False)


def uploads_and_downloads_a_mission(v: Any) -> None:
    exchange_mission(v, integer=True)


def overrides_channels(v: Any) -> None:
    def is_shown() -> bool:
        v.channels.overrides = {"5": 1500, "4": 1600}  # repeated: the vehicle drops it after 3 s
        return bool(v.channels["4"] == 1600)

    until(is_shown, f"channel 4 is {v.channels['4']}")
    v.channels.overrides = {}


def arms_and_disarms(v: Any) -> None:
    arm(v)
    arm(v, armed=False)


def starts_the_mission(v: Any) -> None:
    """Check mode AUTO, arming, the current item and the speed that results."""
    set_mode(v, "AUTO")
    arm(v)
    until(lambda: v.commands.next >= 1, "the mission does not begin")
    until(lambda: v.groundspeed > 0.3, "the vehicle does not move")


def follows_set_points_in_guided(v: Any) -> None:
    set_mode(v, "GUIDED")
    arm(v)  # on a slow line the mission has ended meanwhile
    mask = 0b1101_1111_1000  # position only
    target = v.message_factory.set_position_target_local_ned_encode(
        0, 0, 0, 1, mask, 200, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0
    )

    def dives() -> bool:
        v.send_mavlink(target)
        return bool(v.location.local_frame.down > 1.0)

    until(dives, "the vehicle does not dive to the set-point")
    equal(v.mode.name, "GUIDED", "mode")


def surfaces(v: Any) -> None:
    set_mode(v, "SURFACE")
    until(lambda: v.location.local_frame.down < 1.0, "the vehicle does not surface")


EVERY: list[Check] = [
    reads_every_parameter,
    sets_a_parameter,
    reads_mode_and_arming,
    reads_system_status,
    reads_version,
    reads_attitude,
    reads_location,
    reads_relative_altitude,
    reads_velocity_and_speed,
    reads_heading,
    reads_gps,
    reads_battery,
    reads_rangefinder,
    reads_current_as_wind,
    reports_ekf_and_armable,
    reads_home,
    receives_heartbeats,
    enters_every_mode_by_name,
    downloads_an_empty_mission,
    uploads_float_items_and_downloads_them,
    uploads_and_downloads_a_mission,
    overrides_channels,
    arms_and_disarms,
    starts_the_mission,
    follows_set_points_in_guided,
    surfaces,
]


def main(address: str) -> None:
    vehicle = dronekit.connect(
        address, baud=BAUD, wait_ready=True, timeout=120, heartbeat_timeout=120
    )
    verdicts = {}
    for check in EVERY:
        began_s, problem = time.monotonic(), None
        try:
            check(vehicle)
        except Exception as error:
            problem = error
        verdicts[name_of(check)] = verdict(problem, began_s)
    vehicle.close()
    print(report(verdicts), flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("address")
    parser.add_argument("--slow", action="store_true")
    options = parser.parse_args()
    mavutil.set_dialect("ardupilotmega")
    main(options.address)
