"""Parameters of PX4's outputs as ArduPilot's: functions and pulses of servos and motors.

``PWM_MAIN_FUNCn`` is 101 to 112 for a motor and 201 to 208 for a control surface, whose kind is
``CA_SV_CSk_TYPE``. Versions before 1.13 have the pulses only (PX4 parameter reference).

A half of a V-tail is what its torques say: PX4 solves torque = sum of ``CA_SV_CSk_TRQ_*`` times
output (``ActuatorEffectivenessControlSurfaces.cpp``). With a positive pitch torque, the half whose
yaw torque is positive, too, is ArduPilot's left one (elevator + rudder); the other one is its right
one (elevator - rudder). With a negative pitch torque both are reversed.
"""

import math
from collections.abc import Iterator, Mapping

from sysid.data.readers.servo_channels import MAX_OUTPUTS, UNKNOWN_HALF, V_TAIL

_FIRST_MOTOR, _FIRST_SURFACE, _COUNT = 101, 201, 12
"""PWM_MAIN_FUNCn of the first motor and of the first control surface; number of each."""
_SURFACES = {3: 19, 4: 21, 5: 77, 6: 78}
"""SERVOn_FUNCTION of elevator, rudder and elevons, by CA_SV_CSk_TYPE."""
_HALVES = (7, 8, 13, 14)
"""CA_SV_CSk_TYPE of the halves of V-tails and A-tails."""
_THROTTLE = 70
"""SERVOn_FUNCTION of the throttle."""
SERVOS = 8
"""Number of controls of actuator_servos; the first motor counts as the output after them."""


def servo_parameters(parameters: Mapping[str, float]) -> dict[str, float]:
    """Return SERVOn_FUNCTION, MIN, TRIM, MAX and REVERSED of the outputs MAIN 1 to 16.

    Parameters
    ----------
    parameters : mapping of str to float
        Parameters of PX4.

    Returns
    -------
    dict of str to float
        Those that follow from the parameters.

    Notes
    -----
    An output of -1 to 1 has a pulse from MIN to MAX, linearly, so that 0 is in the middle. A motor
    that cannot turn backwards (no bit in CA_R_REV) has outputs of 0 to 1.
    """
    return {
        f"SERVO{number}_{name}": value
        for number in range(1, MAX_OUTPUTS + 1)
        for name, value in _output(parameters, number)
    }


def surface_parameters(parameters: Mapping[str, float]) -> dict[str, float]:
    """Return SERVOn_FUNCTION and REVERSED of ``actuator_servos``, and of the first motor.

    Parameters
    ----------
    parameters : mapping of str to float
        Parameters of PX4.

    Returns
    -------
    dict of str to float
        Those that follow from the parameters.
    """
    codes = (*range(_FIRST_SURFACE, _FIRST_SURFACE + SERVOS), _FIRST_MOTOR)
    return {
        f"SERVO{number}_{name}": value
        for number, code in enumerate(codes, start=1)
        for name, value in _surface(parameters, code)
    }


def simulated_parameters(parameters: Mapping[str, float]) -> dict[str, float]:
    """Return SERVOn_FUNCTION and REVERSED of ``actuator_outputs_sim``, which has no pulses.

    Parameters
    ----------
    parameters : mapping of str to float
        Parameters of PX4. A flight controller that flies with a simulator has HIL_ACT_FUNCn; PX4's
        own simulation uses PWM_MAIN_FUNCn (`PWMSim.hpp`).

    Returns
    -------
    dict of str to float
        Those that follow from the parameters.
    """
    is_controller = any(name.startswith("HIL_ACT_FUNC") for name in parameters)
    prefix = "HIL_ACT" if is_controller else "PWM_MAIN"
    return {
        f"SERVO{number}_{name}": value
        for number in range(1, MAX_OUTPUTS + 1)
        for name, value in _surface(parameters, _whole(parameters, f"{prefix}_FUNC{number}"))
    }


def _output(parameters: Mapping[str, float], number: int) -> Iterator[tuple[str, float]]:
    """Yield name and value of the parameters of one output, counted from 1."""
    code = _whole(parameters, f"PWM_MAIN_FUNC{number}")
    surface = dict(_surface(parameters, code))
    function = surface.get("FUNCTION")
    if function is not None:
        yield "FUNCTION", function
    low, high = (_pulse(parameters, name, number) for name in ("MIN", "MAX"))
    if low is not None and high is not None and low < high:
        is_forward_only = function == _THROTTLE and not (
            _whole(parameters, "CA_R_REV") >> (code - _FIRST_MOTOR) & 1
        )
        yield from (("MIN", low), ("MAX", high))
        yield "TRIM", low if is_forward_only else (low + high) / 2.0
    mask = _whole(parameters, "PWM_MAIN_REV")
    is_reversed = parameters.get(f"PWM_MAIN_REV{number}", mask >> (number - 1) & 1) == 1.0
    yield "REVERSED", float(is_reversed != (surface.get("REVERSED") == 1.0))


def _surface(parameters: Mapping[str, float], code: int) -> Iterator[tuple[str, float]]:
    """Yield FUNCTION of a PWM_MAIN_FUNCn, and for half a V-tail REVERSED; nothing of others."""
    index = code - _FIRST_SURFACE
    kind = _whole(parameters, f"CA_SV_CS{index}_TYPE")
    if _FIRST_MOTOR <= code < _FIRST_MOTOR + _COUNT:
        yield "FUNCTION", _THROTTLE
    elif kind in _SURFACES:
        yield "FUNCTION", _SURFACES[kind]
    elif kind in _HALVES:
        pitch, yaw = (parameters.get(f"CA_SV_CS{index}_TRQ_{axis}", math.nan) for axis in "PY")
        is_known = math.isfinite(pitch * yaw) and pitch * yaw != 0.0
        yield "FUNCTION", V_TAIL[pitch * yaw < 0.0] if is_known else UNKNOWN_HALF
        yield "REVERSED", float(pitch < 0.0)


def _whole(parameters: Mapping[str, float], name: str) -> int:
    """Return an integer parameter; 0 if it is missing, or not finite in a damaged log."""
    value = parameters.get(name, 0.0)
    return int(value) if math.isfinite(value) else 0


def _pulse(parameters: Mapping[str, float], name: str, number: int) -> float | None:
    """Return the smallest or largest pulse of an output, us; None if no parameter defines it."""
    names = (f"PWM_MAIN_{name}{number}", f"PWM_MAIN_{name}", f"PWM_{name}")
    return next((parameters[n] for n in names if 0.0 < parameters.get(n, 0.0) < math.inf), None)
