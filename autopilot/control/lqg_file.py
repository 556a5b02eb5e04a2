"""Files of LQG controllers: JSON with time step, design speed and matrices (see ``lqg``).

{"format": 1, "tick_s": 0.02, "speed_mps": 1.3, "pitch_per_metre": 0.2, "model_sha256": "...",
 "heading": {"rows": [[A B L], ...], "feedback": [F], "start": [[S], ...], "loads": 1}, "depth":
 ...}
"""

import json
import math
from pathlib import Path
from typing import Any

from autopilot.control import lqg
from autopilot.control.lqg import LqgController, LqgControllers
from mavlink_io.errors import ErrorCode, InputError
from mavlink_io.text_files import parse_json, read_text
from mavlink_io.tick import TICK_S

FORMAT = 1
MEASURED = {"heading": 2, "depth": 4}
"""Number of measurements of each controller."""


class LqgFileError(InputError):
    """A file is not a valid controller file; the message has file, key, value and expectation."""

    code = ErrorCode.CONTROLLER_FILE


def load(path: Path) -> LqgControllers:
    """Read controllers from a file.

    Parameters
    ----------
    path : Path
        File of ``ground redesign --method lqg``.

    Returns
    -------
    LqgControllers
        The controllers.

    Raises
    ------
    LqgFileError
        The file cannot be read or is not a valid controller file.
    """
    try:
        return parse(read_text(path))
    except (OSError, UnicodeDecodeError) as error:
        raise LqgFileError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
    except LqgFileError as error:
        raise LqgFileError(f"{path}: {error}") from None


def parse(text: str) -> LqgControllers:
    """Read controllers from the text of a file.

    Raises
    ------
    LqgFileError
        The text is not a valid controller file.
    """
    try:
        decoded = parse_json(text)
    except ValueError as error:
        raise LqgFileError(
            f"not JSON: {error}; use a file written by `ground redesign --method lqg`"
        ) from None
    document = _parse_object(decoded, "the file")
    if document.get("format") != FORMAT:
        raise LqgFileError(
            f"format = {document.get('format')}: expected {FORMAT}; use a file written by `ground"
            " redesign --method lqg`"
        )
    if document.get("tick_s") != TICK_S:
        raise LqgFileError(
            f"tick_s = {document.get('tick_s')}: expected {TICK_S}, the time step of the loops"
        )
    speed_mps, pitch_per_metre = (
        _parse_positive(document.get(key), key) for key in ("speed_mps", "pitch_per_metre")
    )
    heading, depth = (
        _parse_controller(_parse_object(document.get(key), key), key) for key in MEASURED
    )
    return LqgControllers(
        speed_mps=speed_mps, heading=heading, depth=depth, pitch_per_metre=pitch_per_metre
    )


def _parse_controller(entry: dict[str, Any], key: str) -> LqgController:
    """Return one controller; ``key`` is its name in the file."""
    feedback = entry.get("feedback")
    if not isinstance(feedback, list) or not feedback:
        raise LqgFileError(f"{key}.feedback: expected a list of numbers, one per state")
    states, measured, loads = len(feedback), MEASURED[key], entry.get("loads")
    if type(loads) is not int or not 0 <= loads < states:
        raise LqgFileError(
            f"{key}.loads = {loads}: expected the number of load states, 0 to {states - 1}"
        )
    return lqg.from_matrices(
        _parse_matrix(entry.get("rows"), f"{key}.rows", states, states + 1 + measured),
        _parse_numbers(feedback, f"{key}.feedback", states),
        _parse_matrix(entry.get("start"), f"{key}.start", states, measured),
        loads,
    )


def _parse_matrix(value: Any, key: str, rows: int, columns: int) -> tuple[tuple[float, ...], ...]:
    """Return a matrix of the given shape."""
    if not isinstance(value, list) or len(value) != rows:
        raise LqgFileError(f"{key}: expected {rows} rows, one per element of feedback")
    return tuple(_parse_numbers(row, f"{key}[{index}]", columns) for index, row in enumerate(value))


def _parse_object(value: Any, key: str) -> dict[str, Any]:
    """Return a JSON object."""
    if not isinstance(value, dict):
        raise LqgFileError(f"{key}: expected an object")
    return value


def _parse_positive(value: Any, key: str) -> float:
    """Return a number above 0."""
    (number,) = _parse_numbers([value], key, 1)
    if number <= 0.0:
        raise LqgFileError(f"{key} = {number:g}: expected more than 0")
    return number


def _parse_numbers(values: Any, key: str, count: int) -> tuple[float, ...]:
    """Return a list of ``count`` finite numbers."""
    if not isinstance(values, list) or len(values) != count:
        raise LqgFileError(f"{key}: expected {count} numbers")
    for value in values:
        if isinstance(value, bool) or not isinstance(value, int | float) or not _is_finite(value):
            raise LqgFileError(f"{key} = {value}: expected a number")
    return tuple(float(value) for value in values)


def _is_finite(value: float) -> bool:
    """Return whether a number fits a float and is neither infinite nor NaN."""
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer of more than 308 digits
        return False


def to_json(controllers: LqgControllers, model_sha256: str) -> str:
    """Return the text of a controller file.

    Parameters
    ----------
    controllers : LqgControllers
        Controllers to write.
    model_sha256 : str
        SHA-256 of the model file that they were designed with.

    Returns
    -------
    str
        JSON object in one line, with the final newline.
    """
    head = {"format": FORMAT, "tick_s": TICK_S, "model_sha256": model_sha256}
    numbers = {"speed_mps": controllers.speed_mps, "pitch_per_metre": controllers.pitch_per_metre}
    matrices = {
        "heading": _controller_json(controllers.heading),
        "depth": _controller_json(controllers.depth),
    }
    return json.dumps(head | numbers | matrices) + "\n"


def _controller_json(controller: LqgController) -> dict[str, Any]:
    """Return the JSON object of one controller."""
    return {
        "rows": controller.rows,
        "feedback": controller.feedback,
        "start": controller.start,
        "loads": controller.loads,
    }
