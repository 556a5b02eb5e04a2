"""Errors that reach a user: one base class, a stable code for each class, and the exit status."""

import sys
from enum import StrEnum
from typing import ClassVar, NoReturn

from mavlink_io.printable import printable

FAILED, BAD_INPUT = 1, 2
"""Exit status after a failure of the work, and after bad input."""


MAX_MESSAGE_LENGTH = 1500
"""Maximum characters of a message: a value from a damaged file may have a million."""


class ErrorCode(StrEnum):
    """Stable short identifier of an error class; `docs/errors.md` gives the meanings."""

    ADDRESS = "address"
    AFLOAT = "afloat"
    ALLOW_LIST = "allow_list"
    AUTOPILOT_OPTION = "autopilot_option"
    AUTOPILOT_TIMEOUT = "autopilot_timeout"
    BAD_INPUT = "bad_input"
    BENCH_RESULT = "bench_result"
    BENCH_TEST = "bench_test"
    COMMAND_REFUSED = "command_refused"
    CONTROLLER_FILE = "controller_file"
    DESIGN_INFEASIBLE = "design_infeasible"
    EXCHANGE_FAILED = "exchange_failed"
    FAILED = "failed"
    FAILSAFE = "failsafe"
    FAULT = "fault"
    FIT_FAILED = "fit_failed"
    GAINS_REJECTED = "gains_rejected"
    INCLINING_TEST = "inclining_test"
    KEY_FILE = "key_file"
    LINK_LOST = "link_lost"
    LOG = "log"
    MARGINS_DISAGREE = "margins_disagree"
    MCAP_CONTENT = "mcap_content"
    MCAP_FILE = "mcap_file"
    MISSION_FILE = "mission_file"
    MISSION_REJECTED = "mission_rejected"
    MODEL_FILE = "model_file"
    NOT_UNIQUE = "not_unique"
    NO_COVARIANCE = "no_covariance"
    NO_PERTURBATION = "no_perturbation"
    OTHER_SOURCES = "other_sources"
    PARAMETER = "parameter"
    PERFORMANCE_BASELINE = "performance_baseline"
    PLAN_INFEASIBLE = "plan_infeasible"
    REFIT_DATA = "refit_data"
    SCENARIO = "scenario"
    SENSOR_CATALOGUE = "sensor_catalogue"
    SERIAL_TOO_SLOW = "serial_too_slow"
    SERVO_OUTPUTS = "servo_outputs"
    SETPOINT = "setpoint"
    STATE_FILE = "state_file"
    STUDY_STOPPED = "study_stopped"
    TRUTH_FILE = "truth_file"
    UNSAFE_GAINS = "unsafe_gains"
    UNSTABLE_LOOP = "unstable_loop"
    UNSUCCESSFUL = "unsuccessful"
    VEHICLE = "vehicle"
    VEHICLE_FILE = "vehicle_file"


class CaribouError(Exception):
    """Base of all errors of the project; the message is one line that names cause and remedy."""

    code: ClassVar[ErrorCode]
    exit_status: ClassVar[int]

    def __str__(self) -> str:
        """Return the message; the middle of a very long one is left out."""
        text = super().__str__()
        if len(text) <= MAX_MESSAGE_LENGTH:
            return text
        half = MAX_MESSAGE_LENGTH // 2 - 10
        return f"{text[:half]} ... {text[-half:]}"


class InputError(CaribouError, ValueError):
    """The input cannot be used; the message names file or option, value and what is expected."""

    code = ErrorCode.BAD_INPUT
    exit_status = BAD_INPUT


class OperationError(CaribouError, RuntimeError):
    """The work failed: the vehicle refused, a process ended, a fit did not converge."""

    code = ErrorCode.FAILED
    exit_status = FAILED


def exit_with_error(program: str, error: CaribouError | OSError) -> NoReturn:
    """Print one line on stderr and exit.

    Parameters
    ----------
    program : str
        Name of the program, printed before the message.
    error : CaribouError or OSError
        Its exit status is used; that of an OSError is `FAILED`.
    """
    print(f"{program}: {printable(error)}", file=sys.stderr)
    sys.exit(error.exit_status if isinstance(error, CaribouError) else FAILED)
