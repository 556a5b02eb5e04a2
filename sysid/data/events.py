"""Events of a vehicle as typed values. No other module interprets the texts of STATUSTEXT.

`parse_text` is called where a log or a link is read. Readers of other autopilots' logs create the
same values without a text. ArduPilot sends "SystemID Starting" with the axis only.
"""

import re
from collections.abc import Callable
from enum import IntEnum, StrEnum
from typing import NamedTuple

from mavlink_io.vehicle_modes import VehicleMode
from sysid.data.bit_errors import differ_in_one_bit


class TestAxis(IntEnum):
    """Axis of a test: number of SID_AXIS."""

    OTHER = 0
    """Axis of another autopilot."""
    ELEVATOR = 11
    RUDDER = 12
    THRUST = 13
    BOTH = 23
    """Rudder and elevator at the same time."""
    ELEVATOR_LOOP_ON = 111
    RUDDER_LOOP_ON = 112
    BOTH_LOOPS_ON = 123

    @classmethod
    def _missing_(cls, value: object) -> "TestAxis":
        return cls.OTHER


class TestWave(StrEnum):
    """Signal of a test."""

    CHIRP = "chirp"
    STEP = "step"
    DOUBLET = "doublet"
    PRBS = "prbs"
    MULTISINE = "multisine"
    THREE_TWO_ONE_ONE = "3211"
    SQUARE = "square"
    MARKED = "marked"
    """Unknown: the user gave the time range."""
    OTHER = "other"

    @classmethod
    def _missing_(cls, value: object) -> "TestWave":
        return cls.OTHER


class StopReason(StrEnum):
    """Reason for the end of a test.

    The value of those that a vehicle reports is the beginning of its text.
    """

    COMPLETE = ""
    DEPTH = "depth"
    ALTITUDE = "altitude"
    PITCH = "pitch"
    HEADING = "heading"
    RATE = "rate"
    TIME = "time"
    GROUND = "by ground"
    MODE = "mode"
    END_LOST = "the log lost its end"
    LOG_ENDED = "the log ended"
    OTHER = "other"


class FailsafeCause(StrEnum):
    """Cause of a failsafe. The value is the beginning of the vehicle's text."""

    DEPTH_UNKNOWN = "depth unknown"
    DEPTH = "depth"
    ALTITUDE = "altitude"
    PITCH = "pitch"
    ARMED_TIME = "armed"
    GROUND_LOST = "ground lost"
    LEAK = "Leak"
    BATTERY = "Battery"
    NO_RISE = "no rise"
    SURFACE_NOT_REACHED = "surface not reached"
    OTHER = ""


class TestStarted(NamedTuple):
    """A test has started."""

    axis: TestAxis
    wave: TestWave = TestWave.CHIRP
    magnitude: float | None = None
    """Amplitude of the rudder, or else of the elevator (deg), or of the thrust (%); None if the
    autopilot does not report it."""
    elevator_deg: float = 0.0
    """Amplitude of the elevator in a test of both surfaces."""


class TestEnded(NamedTuple):
    """A test has ended."""

    reason: StopReason
    detail: str = ""
    """The reason with value and limit; empty for a complete test."""


class ModeChanged(NamedTuple):
    """The vehicle has entered a mode, or was in it at the first HEARTBEAT of a log."""

    mode: VehicleMode | None
    """None for a mode of another autopilot."""


class Armed(NamedTuple):
    """The vehicle was armed."""


class Failsafe(NamedTuple):
    """A failsafe has begun."""

    cause: FailsafeCause
    text: str


class TrimLearned(NamedTuple):
    """Trims that were learned in flight are stored."""

    text: str
    """Names and values of the parameters."""


class InjectedFault(NamedTuple):
    """A simulator has started a fault of its scenario, or one that was commanded."""

    name: str
    """Unit and kind, such as ``rudder stuck``."""


class PlainText(NamedTuple):
    """Text without a type of its own."""

    severity: int
    """MAV_SEVERITY, 0 (emergency) to 7 (debug)."""
    text: str


VehicleEvent = (
    TestStarted
    | TestEnded
    | ModeChanged
    | Armed
    | Failsafe
    | TrimLearned
    | InjectedFault
    | PlainText
)

_NUMBER = r"(-?\d+(?:\.\d+)?)"


def _test_started(match: re.Match[str]) -> TestStarted:
    axis, wave, magnitude, elevator_deg = match.groups()
    return TestStarted(
        axis=TestAxis(int(axis)),
        wave=TestWave(wave) if wave else TestWave.CHIRP,
        magnitude=float(magnitude) if magnitude else None,
        elevator_deg=float(elevator_deg) if elevator_deg else 0.0,
    )


def _test_stopped(match: re.Match[str]) -> TestEnded:
    reasons = (reason for reason in StopReason if reason and match[1].startswith(reason))
    return TestEnded(next(reasons, StopReason.OTHER), match[1] or StopReason.OTHER)


def _failsafe(match: re.Match[str]) -> Failsafe:
    return Failsafe(next(c for c in FailsafeCause if match[1].startswith(c)), match[0])


_PARSERS: tuple[tuple[re.Pattern[str], Callable[[re.Match[str]], VehicleEvent]], ...] = (
    (
        re.compile(
            rf"SystemID Starting: axis=(\d+)"
            rf"(?: wave=(\w+) magnitude={_NUMBER}(?: elevator={_NUMBER})?)?"
        ),
        _test_started,
    ),
    (re.compile(r"SystemID Finished"), lambda match: TestEnded(StopReason.COMPLETE)),
    (re.compile(r"SystemID Stopped: ?(.*)"), _test_stopped),
    (
        re.compile(rf"^Mode ({'|'.join(mode.name for mode in VehicleMode)})$"),
        lambda match: ModeChanged(VehicleMode[match[1]]),
    ),
    (re.compile(r"^Armed"), lambda match: Armed()),
    (re.compile(r"^Failsafe: (.*)"), _failsafe),
    (re.compile(r"^Trim learned: (.*)"), lambda match: TrimLearned(match[1])),
    (re.compile(r"^Fault: (\w+ \w+)$"), lambda match: InjectedFault(match[1])),
)


_BEGINNINGS = ("SystemID Starting: axis=", "SystemID Finished", "SystemID Stopped")
"""Beginnings of the texts of a test."""
REPLACEMENT = "\ufffd"
"""Character in place of bytes that are no UTF-8."""
_SPACES = str.maketrans("\t\r\n\x1b", "    ")
"""Control characters in sound texts; PX4 sends colours as escape sequences."""


def is_damaged(text: str) -> bool:
    """Return whether a text has a character that none has, or is a text of a test but for one bit.

    Parameters
    ----------
    text : str
        Text of a log, with REPLACEMENT in place of bytes that are no UTF-8.
    """
    if REPLACEMENT in text or not text.translate(_SPACES).isprintable():
        return True
    return any(differ_in_one_bit(text[: len(begin)], begin) for begin in _BEGINNINGS)


def parse_text(severity: int, text: str) -> VehicleEvent:
    """Return the value of a complete text.

    Parameters
    ----------
    severity : int
        MAV_SEVERITY.
    text : str
        Text of a STATUSTEXT, with its chunks joined, or of another autopilot's log.

    Returns
    -------
    VehicleEvent
        `PlainText` if the text has no type of its own.
    """
    for pattern, build in _PARSERS:
        if match := pattern.search(text):
            return build(match)
    return PlainText(severity, text)
