"""Output numbers of rudder, elevator and thrust, and the scale of the outputs.

Syntax and default scale are those of ``sitl --outputs`` (docs/other_autopilots.md). In logs with
ArduPilot's parameters the outputs are found by ``SERVOn_FUNCTION`` and scaled by ``SERVOn_MIN``,
``SERVOn_TRIM``, ``SERVOn_MAX`` and ``SERVOn_REVERSED``.
"""

import math
import re
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.dataset import DEFAULT_TRAVEL_DEG, Actuators, Array, LogError
from sysid.data.readers.parameter_history import ParameterHistory

PULSE_CENTRE_US = 1500.0
"""Servo pulse at zero deflection."""
PULSE_HALF_US = 400.0
"""Difference of the servo pulse at full travel from the centre."""
MIN_MOTION = 0.02
"""Range of an output, as a fraction of the full travel to one side, from which on it moves."""
MAX_FRACTION = 2.0
"""Output above which the values are servo pulses in microseconds, not fractions of the travel."""


class ServoChannels(NamedTuple):
    """Output numbers, counted from 1; negative for an output with reversed sign.

    An elevator of 0 is none, as on a boat.
    """

    rudder: int
    elevator: int
    thrust: int


FIRST_THREE = ServoChannels(1, 2, 3)
"""Outputs of a log without SERVOn_FUNCTION."""
_FUNCTIONS = ((21, 26), (19,), (70, 73))
"""SERVOn_FUNCTION of rudder (rudder, ground steering), elevator and thrust (throttle, throttle
left), the preferred first (ArduPilot, SRV_Channel.h)."""
V_TAIL = (79, 80)
"""SERVOn_FUNCTION of the left and right half of a V-tail."""
UNKNOWN_HALF = -1
"""In place of SERVOn_FUNCTION: half of a V-tail of PX4 that may be the left or the right one."""
_MIXED = {
    77.0: "an elevon",
    78.0: "an elevon",
    79.0: "a V-tail",
    80.0: "a V-tail",
    UNKNOWN_HALF: "half of a V-tail whose CA_SV_CSk_TRQ_P or CA_SV_CSk_TRQ_Y is missing or 0",
}
"""SERVOn_FUNCTION of surfaces that act in both planes."""

MAX_OUTPUTS = 16
"""Number of outputs with parameters of their own."""
TRAVEL = "ACT_TRAVEL_DEG"
"""Parameter with the travel of the surfaces."""
TRIMS = ("TRIM_RUD_DEG", "TRIM_ELE_DEG")
"""Parameters with the command of a surface for straight and level motion."""
READ_PARAMETERS = frozenset(
    (
        TRAVEL,
        *(
            f"SERVO{number}_{name}"
            for number in range(1, MAX_OUTPUTS + 1)
            for name in ("FUNCTION", "TRIM", "MIN", "MAX", "REVERSED")
        ),
    )
)
"""Names of the parameters that scale the outputs."""
_OUTPUT_PARAMETERS = (TRAVEL, "SERVO", "PWM_", "CA_")
"""Beginnings of the names of parameters by which outputs are read, those of PX4 included."""


class OutputOptions(NamedTuple):
    """Knowledge of the outputs that a log may not hold."""

    channels: ServoChannels | None = None
    """Output numbers; None to find them in the log's parameters, else `FIRST_THREE`."""
    travel_deg: float | None = None
    """Travel of the vehicle's surfaces, used for a log without ACT_TRAVEL_DEG."""


FROM_LOG = OutputOptions()
"""Everything is found in the log."""


def parse(text: str) -> ServoChannels:
    """Parse ``RUDDER,ELEVATOR,THRUST``, for example ``1,-2,3``.

    Parameters
    ----------
    text : str
        Three output numbers, counted from 1, with a minus for a reversed output; 0 for no elevator.

    Returns
    -------
    ServoChannels
        The output numbers.

    Raises
    ------
    LogError
        The text has another form.
    """
    if not re.fullmatch(r"-?[1-9]\d?,(0|-?[1-9]\d?),-?[1-9]\d?", text):
        raise LogError(
            f"--servo-channels {text or repr(text)}: give RUDDER,ELEVATOR,THRUST counted from 1, "
            "with a minus for a reversed output, and 0 for no elevator"
        )
    return ServoChannels(*(int(part) for part in text.split(",")))


def find_channels(
    parameters: Mapping[str, float], usual: ServoChannels = FIRST_THREE
) -> ServoChannels:
    """Return the outputs by their SERVOn_FUNCTION.

    Parameters
    ----------
    parameters : mapping of str to float
        Parameters of the autopilot.
    usual : ServoChannels
        Outputs if no parameters name a rudder and a throttle.

    Returns
    -------
    ServoChannels
        The output numbers; their signs are those of SERVOn_REVERSED. Without an elevator, 0.
    """
    rudder, elevator, thrust = _numbers(parameters)
    channels = usual
    if rudder is not None and thrust is not None:
        channels = ServoChannels(rudder, elevator or 0, thrust)
    return _signed(channels, parameters)


def find_v_tail(parameters: Mapping[str, float]) -> ServoChannels | None:
    """Return the outputs of the left and right half of a V-tail, and of the thrust.

    None without one, and where other outputs act as rudder, elevator or elevons, too.

    Parameters
    ----------
    parameters : mapping of str to float
        ArduPilot's parameters, or those that `px4_outputs` makes of PX4's.

    Returns
    -------
    ServoChannels or None
        The output numbers, left and right in place of rudder and elevator; their signs are those of
        SERVOn_REVERSED.
    """
    of_mixed = [f for f in _functions(parameters).values() if f in _MIXED]
    rudder, elevator, thrust = _numbers(parameters)
    others = rudder is not None or elevator is not None
    if sorted(of_mixed) != [*V_TAIL] or others or thrust is None:
        return None
    left, right = (
        next(n for n, f in _functions(parameters).items() if f == half) for half in V_TAIL
    )
    return _signed(ServoChannels(left, right, thrust), parameters)


def _functions(parameters: Mapping[str, float]) -> dict[int, float]:
    """Return the SERVOn_FUNCTION by the number of the output."""
    return {
        int(match[1]): function
        for name, function in parameters.items()
        if (match := re.fullmatch(r"SERVO(\d+)_FUNCTION", name))
    }


def _numbers(parameters: Mapping[str, float]) -> list[int | None]:
    """Return the outputs of rudder, elevator and thrust; None without SERVOn_FUNCTION."""
    functions = _functions(parameters)
    # of several outputs with one function, the lowest number remains
    number_of_function = {functions[number]: number for number in sorted(functions, reverse=True)}
    return [
        next((number_of_function[f] for f in choices if f in number_of_function), None)
        for choices in _FUNCTIONS
    ]


def _signed(channels: ServoChannels, parameters: Mapping[str, float]) -> ServoChannels:
    """Return output numbers with the signs of SERVOn_REVERSED."""
    return ServoChannels(
        *(n * (-1 if parameters.get(f"SERVO{n}_REVERSED") == 1.0 else 1) for n in channels)
    )


def mixed_surfaces(parameters: Mapping[str, float]) -> str:
    """Return the outputs whose surfaces act in both planes; empty without any.

    Parameters
    ----------
    parameters : mapping of str to float
        Parameters of the autopilot.

    Returns
    -------
    str
        Name, value and meaning of each SERVOn_FUNCTION; the number of an output of PX4.
    """
    functions = {n: parameters.get(f"SERVO{n}_FUNCTION") for n in range(1, MAX_OUTPUTS + 1)}
    return ", ".join(
        f"output {number} ({_MIXED[function]})"
        if function == UNKNOWN_HALF
        else f"SERVO{number}_FUNCTION = {function:g} ({_MIXED[function]})"
        for number, function in functions.items()
        if function in _MIXED
    )


def names_surfaces(parameters: Mapping[str, float]) -> bool:
    """Return whether the parameters say which outputs are rudder, elevator and thrust.

    Parameters
    ----------
    parameters : mapping of str to float
        Parameters of the autopilot.

    Returns
    -------
    bool
        True for Caribou's autopilot (ACT_TRAVEL_DEG), and where SERVOn_FUNCTION names a rudder or a
        V-tail, and a throttle. The outputs of other logs may belong to motors.
    """
    numbers = tuple(map(abs, find_channels(parameters)))
    is_known = numbers != FIRST_THREE or find_v_tail(parameters) is not None
    return TRAVEL in parameters or is_known


def travel_rad(parameters: Mapping[str, float], options: OutputOptions) -> float:
    """Return the surface angle at an output of 1: of the log, of the vehicle, or the default.

    Parameters
    ----------
    parameters : mapping of str to float
        Parameters of the autopilot.
    options : OutputOptions
        Travel of the vehicle.

    Returns
    -------
    float
        Angle in radians.
    """
    vehicle_deg = DEFAULT_TRAVEL_DEG if options.travel_deg is None else options.travel_deg
    return math.radians(parameters.get(TRAVEL, vehicle_deg))


def actuator_commands(
    time_s: Array,
    values: NDArray[np.float64],
    options: OutputOptions,
    history: ParameterHistory,
    where: str,
    *,
    usual: ServoChannels = FIRST_THREE,
    convert: Callable[[Mapping[str, float]], dict[str, float]] = dict,
) -> Actuators:
    """Return the commands of the surfaces and of the thrust.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Vehicle time.
    values : ndarray, shape (n, outputs)
        Fractions of the travel, or pulses in microseconds. A pulse of 0 us and NaN are zero
        deflection.
    options : OutputOptions
        Output numbers and travel.
    history : ParameterHistory
        Parameters of the autopilot; each value counts for the rows of its time.
    where : str
        File and message, for the error.
    usual : ServoChannels
        Output numbers if neither options nor parameters name them.
    convert : callable
        Returns ArduPilot's parameters of the outputs for those of the autopilot.

    Returns
    -------
    Actuators
        Commands in radians and fractions of thrust.

    Raises
    ------
    LogError
        The log does not have one of the outputs.
    """
    commands = np.zeros((3, time_s.size))
    others, assumed, mixed = set[int](), dict[str, None](), dict[str, None]()
    has_elevator = False
    for rows, own_parameters in history.epochs(time_s, _OUTPUT_PARAMETERS):
        parameters = own_parameters | convert(own_parameters)
        v_tail = None if options.channels else find_v_tail(parameters)
        channels = options.channels or v_tail or find_channels(parameters, usual)
        commands[:, rows] = _fractions(values[rows], channels, parameters, where)
        if v_tail:
            commands[:2, rows] = _unmixed(*commands[:2, rows])
        others.update(_other_outputs(values[rows], channels))
        assumed[_assumed_pulses(values[rows], channels, parameters)] = None
        mixed["" if options.channels or v_tail else mixed_surfaces(parameters)] = None
        travel = travel_rad(parameters, options)
        commands[:2, rows] *= travel
        has_elevator = has_elevator or channels.elevator != 0
    return Actuators(
        time_s=time_s,
        rudder_rad=commands[0],
        elevator_rad=commands[1],
        thrust=commands[2],
        travel_rad=travel,
        other_outputs=tuple(sorted(others)),
        has_elevator=has_elevator,
        assumed_pulses="; ".join(filter(None, assumed)),
        mixed_surfaces="; ".join(filter(None, mixed)),
    )


def _unmixed(left: Array, right: Array) -> tuple[Array, Array]:
    """Return rudder and elevator of the halves of a V-tail, all as fractions of the travel.

    Positive halves are deflected upwards: left = elevator + rudder, right = elevator - rudder, each
    times a gain (ArduPilot, Plane, `channel_function_mixer`). The gain is left out: a rudder of 1
    is both halves at their full travel.
    """
    return (left - right) / 2.0, (left + right) / 2.0


def _other_outputs(values: NDArray[np.float64], channels: ServoChannels) -> tuple[int, ...]:
    """Return the numbers of the outputs that move and are not chosen."""
    if not values.size:
        return ()
    known = np.where(np.isfinite(values), values, 0.0)
    is_pulse = np.max(np.abs(known), axis=0) > MAX_FRACTION
    full = np.where(is_pulse, PULSE_HALF_US, 1.0)
    moving = np.flatnonzero(np.ptp(known, axis=0) > MIN_MOTION * full) + 1
    return tuple(number for number in moving.tolist() if number not in set(map(abs, channels)))


def _are_pulses(outputs: NDArray[np.float64]) -> bool:
    """Return whether outputs are pulses in microseconds, not fractions of the travel."""
    return bool(np.nanmax(np.abs(outputs), initial=0.0) > MAX_FRACTION)


def _assumed_pulses(
    values: NDArray[np.float64], channels: ServoChannels, parameters: Mapping[str, float]
) -> str:
    """Return the outputs whose range is not known, and the one taken; empty without any."""
    numbers = [abs(n) for n in channels if n]
    chosen = values[:, [number - 1 for number in numbers]]
    if not _are_pulses(chosen):
        return ""
    unknown = [str(n) for n in numbers if f"SERVO{n}_MAX" not in parameters]
    taken = f"{PULSE_CENTRE_US:g} +- {PULSE_HALF_US:g} us"
    return f"{taken} for the outputs {', '.join(unknown)}" if unknown else ""


def _fractions(
    values: NDArray[np.float64],
    outputs: ServoChannels,
    parameters: Mapping[str, float],
    where: str,
) -> tuple[Array, Array, Array]:
    """Return rudder, elevator and thrust as fractions -1..1; raise LogError without an output."""
    largest = max(abs(number) for number in outputs)
    if largest > values.shape[1]:
        raise LogError(
            f"{where} has {values.shape[1]} outputs but not number {largest}; give other numbers"
            " with --servo-channels"
        )
    chosen = values[:, [abs(number) - 1 for number in outputs]]
    if _are_pulses(chosen):
        chosen = np.stack(
            [
                _fraction_of_pulse(pulses, abs(number), parameters)
                for pulses, number in zip(chosen.T, outputs, strict=True)
            ],
            axis=1,
        )
    chosen = np.nan_to_num(chosen) * np.sign(outputs)
    return chosen[:, 0], chosen[:, 1], chosen[:, 2]


def _fraction_of_pulse(pulses: Array, number: int, parameters: Mapping[str, float]) -> Array:
    """Return the fraction of the travel of an output, -1..1, from its pulses in microseconds.

    A throttle whose trim equals its minimum has fractions 0..1.
    """
    centre, lowest, highest = (
        parameters.get(f"SERVO{number}_{name}", default)
        for name, default in (
            ("TRIM", PULSE_CENTRE_US),
            ("MIN", PULSE_CENTRE_US - PULSE_HALF_US),
            ("MAX", PULSE_CENTRE_US + PULSE_HALF_US),
        )
    )
    deviation = np.where(pulses == 0.0, 0.0, pulses - centre)
    span = np.where(deviation < 0.0, max(centre - lowest, 1.0), max(highest - centre, 1.0))
    return np.clip(deviation / span, -1.0, 1.0)
