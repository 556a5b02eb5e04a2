"""Law files: JSON with the tick and the speed that laws were designed for, and their matrices.

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

FORMAT = 1
TICK_S = 0.02
MEASURED = {"heading": 2, "depth": 4}


class LqgFileError(ValueError):
    """A file that holds no laws; the message names file, key, value and what would be right."""


def load(path: Path) -> LqgControllers:
    """Raises LawError."""
    try:
        return parse(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise LqgFileError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
    except LqgFileError as error:
        raise LqgFileError(f"{path}: {error}") from None


def parse(text: str) -> LqgControllers:
    """Raises LawError."""
    try:
        found = json.loads(text)
    except ValueError as error:
        raise LqgFileError(
            f"no JSON: {error}; give a file that `ground redesign --method lqg` wrote"
        ) from None
    found = _parse_object(found, "the file")
    if found.get("format") != FORMAT:
        raise LqgFileError(f"format = {found.get('format')}: expected {FORMAT}")
    if found.get("tick_s") != TICK_S:
        raise LqgFileError(
            f"tick_s = {found.get('tick_s')}: expected {TICK_S}, at which the loops are closed"
        )
    speed_mps, pitch_per_metre = (
        _parse_positive(found.get(key), key) for key in ("speed_mps", "pitch_per_metre")
    )
    heading, depth = (
        _parse_controller(_parse_object(found.get(key), key), key) for key in MEASURED
    )
    return LqgControllers(speed_mps, heading, depth, pitch_per_metre)


def _parse_controller(found: dict[str, Any], key: str) -> LqgController:
    feedback = found.get("feedback")
    if not isinstance(feedback, list) or not feedback:
        raise LqgFileError(f"{key}.feedback: expected a list of numbers, one a state")
    states, measured, loads = len(feedback), MEASURED[key], found.get("loads")
    if type(loads) is not int or not 0 <= loads < states:
        raise LqgFileError(
            f"{key}.loads = {loads}: expected how many of the {states} states are loads"
        )
    return lqg.from_matrices(
        _parse_matrix(found.get("rows"), f"{key}.rows", states, states + 1 + measured),
        _parse_numbers(feedback, f"{key}.feedback", states),
        _parse_matrix(found.get("start"), f"{key}.start", states, measured),
        loads,
    )


def _parse_matrix(found: Any, key: str, rows: int, columns: int) -> tuple[tuple[float, ...], ...]:
    if not isinstance(found, list) or len(found) != rows:
        raise LqgFileError(f"{key}: expected {rows} rows, one for each of feedback's states")
    return tuple(_parse_numbers(row, f"{key}[{at}]", columns) for at, row in enumerate(found))


def _parse_object(found: Any, key: str) -> dict[str, Any]:
    if not isinstance(found, dict):
        raise LqgFileError(f"{key}: expected an object")
    return found


def _parse_positive(found: Any, key: str) -> float:
    (value,) = _parse_numbers([found], key, 1)
    if value <= 0.0:
        raise LqgFileError(f"{key} = {value:g}: expected more than 0")
    return value


def _parse_numbers(found: Any, key: str, count: int) -> tuple[float, ...]:
    if not isinstance(found, list) or len(found) != count:
        raise LqgFileError(f"{key}: expected {count} numbers")
    for value in found:
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not math.isfinite(value)
        ):
            raise LqgFileError(f"{key} = {value}: expected a number")
    return tuple(float(value) for value in found)


def to_json(laws: LqgControllers, model_sha256: str) -> str:
    """The file of laws that were designed on a model."""
    head = {"format": FORMAT, "tick_s": TICK_S, "model_sha256": model_sha256}
    numbers = {"speed_mps": laws.speed_mps, "pitch_per_metre": laws.pitch_per_metre}
    each = {"heading": _controller_json(laws.heading), "depth": _controller_json(laws.depth)}
    return json.dumps(head | numbers | each) + "\n"


def _controller_json(law: LqgController) -> dict[str, Any]:
    return {"rows": law.rows, "feedback": law.feedback, "start": law.start, "loads": law.loads}
