"""Parameters of PX4's outputs as ArduPilot's: functions and pulses of servos and motors.

``PWM_MAIN_FUNCn`` is 101 to 112 for a motor and 201 to 208 for a control surface, whose kind is
``CA_SV_CSk_TYPE``. Versions before 1.13 have the pulses only (PX4 parameter reference).
"""

import math
from collections.abc import Iterator, Mapping

from sysid.data.readers.servo_channels import MAX_OUTPUTS

_FIRST_MOTOR, _FIRST_SURFACE, _COUNT = 101, 201, 12
"""PWM_MAIN_FUNCn of the first motor and of the first control surface; number of each."""
_SURFACES = {3: 19, 4: 21, 5: 77, 6: 78, 7: 79, 8: 80}
"""SERVOn_FUNCTION of elevator, rudder, elevons and V-tail, by CA_SV_CSk_TYPE."""
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
    """Return SERVOn_FUNCTION of the values of ``actuator_servos``, and of the first motor.

    Parameters
    ----------
    parameters : mapping of str to float
        Parameters of PX4.

    Returns
    -------
    dict of str to float
        Those that follow from the parameters.
    """
    functions = [_function(parameters, _FIRST_SURFACE + k) for k in range(SERVOS)]
    return {
        f"SERVO{number}_FUNCTION": function
        for number, function in enumerate((*functions, _THROTTLE), start=1)
        if function is not None
    }


def _output(parameters: Mapping[str, float], number: int) -> Iterator[tuple[str, float]]:
    """Yield name and value of the parameters of one output, counted from 1."""
    code = _whole(parameters, f"PWM_MAIN_FUNC{number}")
    function = _function(parameters, code)
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
    yield "REVERSED", parameters.get(f"PWM_MAIN_REV{number}", mask >> (number - 1) & 1)


def _function(parameters: Mapping[str, float], code: int) -> float | None:
    """Return the SERVOn_FUNCTION of a PWM_MAIN_FUNCn; None if it has none."""
    if _FIRST_MOTOR <= code < _FIRST_MOTOR + _COUNT:
        return _THROTTLE
    return _SURFACES.get(_whole(parameters, f"CA_SV_CS{code - _FIRST_SURFACE}_TYPE"))


def _whole(parameters: Mapping[str, float], name: str) -> int:
    """Return an integer parameter; 0 if it is missing, or not finite in a damaged log."""
    value = parameters.get(name, 0.0)
    return int(value) if math.isfinite(value) else 0


def _pulse(parameters: Mapping[str, float], name: str, number: int) -> float | None:
    """Return the smallest or largest pulse of an output, us; None if no parameter defines it."""
    names = (f"PWM_MAIN_{name}{number}", f"PWM_MAIN_{name}", f"PWM_{name}")
    return next((parameters[n] for n in names if 0.0 < parameters.get(n, 0.0) < math.inf), None)
