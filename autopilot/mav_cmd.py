"""MAV_CMD: what each command of COMMAND_LONG and COMMAND_INT asks of the vehicle. One table of handlers.

Clients fill every parameter they do not mean with NaN, repeat a command whose acknowledgement was lost, and send
some commands to component 0: every handler is indifferent to all three.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

from autopilot import identity, mission, modes, requests, telemetry
from autopilot.schedule import Schedule
from autopilot.telemetry import Values
from autopilot.types import ACCEPTED, DENIED, FAILED, TEMPORARILY_REJECTED, UNSUPPORTED, Severity
from autopilot.vehicle import Vehicle
from link import dialect
from link.dialect import MessageType, constant
from link.missions import FRAME_MISSION, MissionItem

_FORCE = 21_196
"""COMPONENT_ARM_DISARM.param2 that skips the checks."""
_PAUSE, _CONTINUE = 0, 1
_INT32_LIMIT = 1 << 31
_SAFE_RECOVERY = constant("MAV_STANDARD_MODE_SAFE_RECOVERY")
_ALL_MODES = 0
_LOWEST_CUSTOM_MODE = 65_536
"""DO_SET_MODE.param2 from here on is a whole custom_mode, below it is PX4's main mode."""


class Command(NamedTuple):
    """A command as it came. Parameters may be NaN: not given."""

    number: int
    p1: float
    p2: float
    p3: float
    p4: float
    p5: float
    p6: float
    p7: float
    scaled: bool
    """COMMAND_INT: p5 and p6 are whole numbers, 1e-7 degrees where they are a place."""


class Outcome(NamedTuple):
    """MAV_RESULT, and the messages to send to the requester after the acknowledgement."""

    result: int
    messages: tuple[tuple[MessageType, Values], ...] = ()


def command_from_message(message: Any) -> Command:
    """The command in a decoded COMMAND_LONG or COMMAND_INT."""
    m = message
    if hasattr(m, "x"):
        return Command(m.command, m.param1, m.param2, m.param3, m.param4, m.x, m.y, m.z, True)
    return Command(m.command, m.param1, m.param2, m.param3, m.param4, m.param5, m.param6, m.param7, False)


def custom_mode(main: float, sub: float) -> int:
    """DO_SET_MODE's second and third parameter as a custom_mode."""
    main_number, sub_number = whole(main), whole(sub)
    return main_number if main_number >= _LOWEST_CUSTOM_MODE else main_number << 16 | sub_number << 24


def whole(value: float, default: int = 0) -> int:
    """The value as a whole number, ``default`` where none was given or no int32 holds it."""
    return int(value) if abs(value) < _INT32_LIMIT else default


class Commander:
    """Carries commands out on a vehicle."""

    def __init__(self, vehicle: Vehicle, build: Callable[[MessageType], Values | None], system: int) -> None:
        self._vehicle, self._build, self._system = vehicle, build, system
        self._handlers: dict[int, Callable[[Command, Schedule], Outcome]] = {
            constant(f"MAV_CMD_{name}"): handler
            for name, handler in {
                "COMPONENT_ARM_DISARM": self._arm,
                "DO_SET_MODE": self._set_mode,
                "DO_SET_STANDARD_MODE": self._set_standard_mode,
                "MISSION_START": self._start_mission,
                "DO_SET_MISSION_CURRENT": self._set_mission_item,
                "DO_PAUSE_CONTINUE": self._pause,
                "NAV_RETURN_TO_LAUNCH": self._surface,
                "NAV_LAND": self._surface,
                "NAV_LOITER_UNLIM": self._hold,
                "USER_1": self._test,
                "CONDITION_YAW": self._change_target,
                "DO_CHANGE_ALTITUDE": self._change_target,
                "DO_CHANGE_SPEED": self._change_target,
                "DO_SET_HOME": self._set_home,
                "SET_MESSAGE_INTERVAL": self._set_interval,
                "GET_MESSAGE_INTERVAL": self._get_interval,
                "REQUEST_MESSAGE": self._give_message,
                "REQUEST_AUTOPILOT_CAPABILITIES": self._give_version,
                "GET_HOME_POSITION": self._give_home,
                "PREFLIGHT_REBOOT_SHUTDOWN": self._reboot,
            }.items()
        }

    def execute(self, command: Command, schedule: Schedule) -> Outcome:
        """Carry a command out; ``schedule`` is that of the link it came by."""
        handler = self._handlers.get(command.number)
        return Outcome(UNSUPPORTED) if handler is None else handler(command, schedule)

    def _ask(self, wish: requests.Request) -> Outcome:
        return Outcome(self._vehicle.request(wish).result)

    def _refuse(self, result: int, text: str) -> Outcome:
        self._vehicle.say(text)
        return Outcome(result)

    def _arm(self, command: Command, schedule: Schedule) -> Outcome:
        force = command.p2 == _FORCE
        if command.p1 == 1:
            return self._ask(requests.Arm(force))
        if command.p1 == 0:
            return self._ask(requests.Disarm(force))
        return self._refuse(DENIED, f"Arming: param1 is {command.p1:g}, must be 1 or 0")

    def _set_mode(self, command: Command, schedule: Schedule) -> Outcome:
        if not whole(command.p1) & 1:
            return self._refuse(DENIED, "DO_SET_MODE: param1 lacks the custom mode flag (1)")
        return self._ask(requests.SetMode(custom_mode(command.p2, command.p3)))

    def _set_standard_mode(self, command: Command, schedule: Schedule) -> Outcome:
        if command.p1 == _SAFE_RECOVERY:
            return self._surface(command, schedule)
        for mode in modes.MODES:
            if mode.standard_mode and mode.standard_mode == command.p1:
                return self._ask(requests.SetMode(mode.number))
        return self._refuse(FAILED, f"Standard mode {command.p1:g} is not one this vehicle has")

    def _start_mission(self, command: Command, schedule: Schedule) -> Outcome:
        if first := whole(command.p1):
            outcome = self._ask(requests.SetMissionItem(first))
            if outcome.result != ACCEPTED:
                return outcome
        return self._ask(requests.SetMode(modes.MISSION.number))

    def _set_mission_item(self, command: Command, schedule: Schedule) -> Outcome:
        return self._ask(requests.SetMissionItem(whole(command.p1, -1)))

    def _pause(self, command: Command, schedule: Schedule) -> Outcome:
        if command.p1 not in (_PAUSE, _CONTINUE):
            return self._refuse(DENIED, f"DO_PAUSE_CONTINUE: param1 is {command.p1:g}, must be 0 or 1")
        mode = modes.MISSION if command.p1 == _CONTINUE else modes.HOLD
        return self._ask(requests.SetMode(mode.number))

    def _surface(self, command: Command, schedule: Schedule) -> Outcome:
        return self._ask(requests.SetMode(modes.SURFACE.number))

    def _hold(self, command: Command, schedule: Schedule) -> Outcome:
        return self._ask(requests.SetMode(modes.HOLD.number))

    def _test(self, command: Command, schedule: Schedule) -> Outcome:
        axis = whole(command.p1)
        if axis == 0:
            return self._ask(requests.StopTest())
        start_hz, stop_hz, duration_s, fade_s = (
            float(value) if math.isfinite(value) else 0.0 for value in (command.p3, command.p4, command.p5, command.p7)
        )
        wave = whole(command.p6)
        return self._ask(requests.StartTest(axis, command.p2, start_hz, stop_hz, duration_s, wave, fade_s))

    def _change_target(self, command: Command, schedule: Schedule) -> Outcome:
        """A leg's command means the same now as it does in a mission."""
        c = command
        if c.number != mission.Command.CHANGE_SPEED and not math.isfinite(c.p1):
            return self._refuse(DENIED, f"Command {c.number}: param1 is not given")
        item = MissionItem(0, FRAME_MISSION, c.number, p1=c.p1, p2=c.p2, p3=c.p3, p4=c.p4)
        config = self._vehicle.params.config
        _, wrong = mission.check((item,), replace(config, mission_seq0_home=0))
        if wrong:
            return self._refuse(DENIED, f"Command {c.number}: {wrong}")
        if not self._vehicle.state.armed:
            return self._refuse(TEMPORARILY_REJECTED, f"Command {c.number} refused: not armed")
        wanted = mission.begin(item, self._vehicle.state, config)[0].setpoint
        return self._ask(requests.ChangeTarget(wanted.depth_m, wanted.heading_rad, wanted.thrust))

    def _set_home(self, command: Command, schedule: Schedule) -> Outcome:
        """Home may be moved, never lifted from the surface: depth is counted from there."""
        scale = 1e-7 if command.scaled else 1.0
        lat_deg, lon_deg = command.p5 * scale, command.p6 * scale
        if command.p1 == 1:
            lat_deg, lon_deg = (angle * 1e-7 for angle in telemetry.position_dege7(self._vehicle.state))
        if not (abs(lat_deg) <= 90.0 and abs(lon_deg) <= 180.0):
            return self._refuse(DENIED, f"Home refused: {lat_deg:g}, {lon_deg:g} is no place")
        outcome = self._ask(requests.SetHome(lat_deg, lon_deg))
        if not math.isnan(command.p7) and command.p7 != 0.0:
            self._vehicle.say("Home stays at the surface: altitude ignored", Severity.NOTICE)
        return outcome

    def _set_interval(self, command: Command, schedule: Schedule) -> Outcome:
        interval = whole(command.p2)
        try:
            schedule.set_interval(whole(command.p1), None if interval == 0 else max(0, interval))
        except KeyError:
            return Outcome(UNSUPPORTED)
        return Outcome(ACCEPTED)

    def _get_interval(self, command: Command, schedule: Schedule) -> Outcome:
        number = whole(command.p1)
        try:
            interval = schedule.interval_us(number) or -1
        except KeyError:
            return Outcome(UNSUPPORTED, ((dialect.by_name("MESSAGE_INTERVAL"), (0, number & 0xFFFF)),))
        return Outcome(ACCEPTED, ((dialect.by_name("MESSAGE_INTERVAL"), (interval, number)),))

    def _give_message(self, command: Command, schedule: Schedule) -> Outcome:
        message = dialect.by_id(whole(command.p1))
        if message is None:
            return Outcome(UNSUPPORTED)
        if message.name == "AVAILABLE_MODES":
            return self._give_modes(message, whole(command.p2))
        values = self._build(message)
        return Outcome(UNSUPPORTED) if values is None else Outcome(ACCEPTED, ((message, values),))

    def _give_modes(self, message: MessageType, index: int) -> Outcome:
        wanted = range(1, len(modes.MODES) + 1) if index == _ALL_MODES else (index,)
        try:
            return Outcome(ACCEPTED, tuple((message, identity.available_mode(n)) for n in wanted))
        except IndexError:
            return Outcome(DENIED)

    def _give_version(self, command: Command, schedule: Schedule) -> Outcome:
        message = dialect.by_name("AUTOPILOT_VERSION")
        return Outcome(ACCEPTED, ((message, identity.autopilot_version(self._system)),))

    def _give_home(self, command: Command, schedule: Schedule) -> Outcome:
        message = dialect.by_name("HOME_POSITION")
        return Outcome(ACCEPTED, ((message, telemetry.home_position(self._vehicle.snapshot())),))

    def _reboot(self, command: Command, schedule: Schedule) -> Outcome:
        if self._vehicle.state.armed:
            return self._refuse(TEMPORARILY_REJECTED, "Reboot refused: armed")
        if command.p1 == 1:
            self._vehicle.restart("asked by ground")
        return Outcome(ACCEPTED if command.p1 in (0, 1) else UNSUPPORTED)
