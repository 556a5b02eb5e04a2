"""Choice of the backend from the command-line options, and the check of these options."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, cast, get_args

from mavlink_io.errors import ErrorCode, InputError
from mavlink_io.transport import Transport
from sitl.backends import Backend
from sitl.backends.ardupilot import ArduPilot
from sitl.backends.caribou import Caribou
from sitl.backends.px4 import Barometer, Position, Px4
from sitl.backends.servo_outputs import DEFAULT, parse
from sitl.backends.wall_clock import WallClock

PX4_RATE_HZ = 250
"""Default rate of sensor frames to PX4."""
MIN_HZ, MAX_HZ = 50, 1200
"""Range of ``--rate``; a step is the nearest whole number of microseconds."""


class BackendError(InputError):
    """The autopilot is unknown or does not support an option; the message names valid values."""

    code = ErrorCode.AUTOPILOT_OPTION


class BackendDefaults(NamedTuple):
    """Default values and supported options of a backend."""

    address: str
    speed: str
    """Value of ``--speed``; ``max`` for a backend whose autopilot sets the pace."""
    options: frozenset[str]
    """Options that not every backend supports."""


KINDS = {
    "caribou": BackendDefaults(
        "udpout:127.0.0.1:14560", "1", frozenset({"--wait-for-arm", "--no-lockstep"})
    ),
    "px4": BackendDefaults(
        "tcpin:127.0.0.1:4560",
        "1",
        frozenset({"--rate", "--hil-baro", "--hil-position", "--outputs"}),
    ),
    "ardupilot": BackendDefaults("udpin:127.0.0.1:9002", "max", frozenset({"--outputs"})),
}


class BackendOptions(NamedTuple):
    """Autopilot and its options; None for an option that was not given."""

    autopilot: str = "caribou"
    wait_for_arm: bool = False
    rate_hz: int | None = None
    barometer: str | None = None
    position: str | None = None
    outputs: str | None = None
    lockstep: bool = True


def defaults_of(autopilot: str) -> BackendDefaults:
    """Return the defaults of a backend.

    Raises BackendError: the autopilot is unknown.
    """
    defaults = KINDS.get(autopilot)
    if defaults is None:
        raise BackendError(f"--autopilot {autopilot}: expected {', '.join(KINDS)}")
    return defaults


def check_options(choice: BackendOptions) -> None:
    """Check the options.

    Raises BackendError or OutputsError.
    """
    given = {
        "--wait-for-arm": choice.wait_for_arm or None,
        "--rate": choice.rate_hz,
        "--hil-baro": choice.barometer,
        "--hil-position": choice.position,
        "--outputs": choice.outputs,
        "--no-lockstep": None if choice.lockstep else True,
    }
    known = defaults_of(choice.autopilot).options
    for option, value in given.items():
        if value is not None and option not in known:
            users = [name for name, backend in KINDS.items() if option in backend.options]
            raise BackendError(f"{option}: only with --autopilot {' or '.join(users)}")
    if choice.wait_for_arm and not choice.lockstep:
        raise BackendError(
            "--wait-for-arm cannot be combined with --no-lockstep: real time cannot be paused"
        )
    rate_hz = PX4_RATE_HZ if choice.rate_hz is None else choice.rate_hz
    if not MIN_HZ <= rate_hz <= MAX_HZ:
        raise BackendError(f"--rate {choice.rate_hz}: expected {MIN_HZ} to {MAX_HZ} Hz")
    barometers = get_args(Barometer)
    if choice.barometer not in (None, *barometers):
        raise BackendError(f"--hil-baro {choice.barometer}: expected {' or '.join(barometers)}")
    positions = get_args(Position)
    if choice.position not in (None, *positions):
        raise BackendError(f"--hil-position {choice.position}: expected {', '.join(positions)}")
    parse(choice.outputs or DEFAULT)


def create_backend(
    choice: BackendOptions, transport: Transport, stopped: Callable[[], bool]
) -> Backend:
    """Create the backend for options that ``check_options`` has accepted.

    Raises
    ------
    TooSlowError
        The serial line is too slow for the sensor messages.
    """
    outputs = parse(choice.outputs or DEFAULT)
    match choice.autopilot:
        case "px4":
            barometer = cast(Barometer, choice.barometer or "air_equivalent")
            position = cast(Position, choice.position or "sensors")
            rate_hz = choice.rate_hz or PX4_RATE_HZ
            return Px4(
                transport,
                stopped,
                rate_hz=rate_hz,
                outputs=outputs,
                barometer=barometer,
                position=position,
            )
        case "ardupilot":
            return ArduPilot(transport, stopped, outputs=outputs)
        case _ if not choice.lockstep:
            return WallClock(transport, stopped)
        case _:
            return Caribou(transport, stopped, wait_for_arm=choice.wait_for_arm)
