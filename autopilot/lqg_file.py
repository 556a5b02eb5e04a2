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
from autopilot.control.lqg import Law, Laws

FORMAT = 1
TICK_S = 0.02
MEASURED = {"heading": 2, "depth": 4}


class LawError(ValueError):
    """A file that holds no laws; the message names file, key, value and what would be right."""


def load(path: Path) -> Laws:
    """Raises LawError."""
    try:
        return parse(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise LawError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
    except LawError as error:
        raise LawError(f"{path}: {error}") from None


def parse(text: str) -> Laws:
    """Raises LawError."""
    try:
        found = json.loads(text)
    except ValueError as error:
        raise LawError(f"no JSON: {error}; give a file that `ground laws` wrote") from None
    found = _object(found, "the file")
    if found.get("format") != FORMAT:
        raise LawError(f"format = {found.get('format')}: expected {FORMAT}")
    if found.get("tick_s") != TICK_S:
        raise LawError(
            f"tick_s = {found.get('tick_s')}: expected {TICK_S}, at which the loops are closed"
        )
    speed_mps, pitch_per_metre = (
        _positive(found.get(key), key) for key in ("speed_mps", "pitch_per_metre")
    )
    heading, depth = (_law(_object(found.get(key), key), key) for key in MEASURED)
    return Laws(speed_mps, heading, depth, pitch_per_metre)


def _law(found: dict[str, Any], key: str) -> Law:
    feedback = found.get("feedback")
    if not isinstance(feedback, list) or not feedback:
        raise LawError(f"{key}.feedback: expected a list of numbers, one a state")
    states, measured, loads = len(feedback), MEASURED[key], found.get("loads")
    if type(loads) is not int or not 0 <= loads < states:
        raise LawError(f"{key}.loads = {loads}: expected how many of the {states} states are loads")
    return lqg.law(
        _matrix(found.get("rows"), f"{key}.rows", states, states + 1 + measured),
        _numbers(feedback, f"{key}.feedback", states),
        _matrix(found.get("start"), f"{key}.start", states, measured),
        loads,
    )


def _matrix(found: Any, key: str, rows: int, columns: int) -> tuple[tuple[float, ...], ...]:
    if not isinstance(found, list) or len(found) != rows:
        raise LawError(f"{key}: expected {rows} rows, one for each of feedback's states")
    return tuple(_numbers(row, f"{key}[{at}]", columns) for at, row in enumerate(found))


def _object(found: Any, key: str) -> dict[str, Any]:
    if not isinstance(found, dict):
        raise LawError(f"{key}: expected an object")
    return found


def _positive(found: Any, key: str) -> float:
    (value,) = _numbers([found], key, 1)
    if value <= 0.0:
        raise LawError(f"{key} = {value:g}: expected more than 0")
    return value


def _numbers(found: Any, key: str, count: int) -> tuple[float, ...]:
    if not isinstance(found, list) or len(found) != count:
        raise LawError(f"{key}: expected {count} numbers")
    for value in found:
        if (
            isinstance(value, bool)
            or not isinstance(value, int | float)
            or not math.isfinite(value)
        ):
            raise LawError(f"{key} = {value}: expected a number")
    return tuple(float(value) for value in found)


def text_of(laws: Laws, model_sha256: str) -> str:
    """The file of laws that were designed on a model."""
    head = {"format": FORMAT, "tick_s": TICK_S, "model_sha256": model_sha256}
    numbers = {"speed_mps": laws.speed_mps, "pitch_per_metre": laws.pitch_per_metre}
    each = {"heading": _object_of(laws.heading), "depth": _object_of(laws.depth)}
    return json.dumps(head | numbers | each) + "\n"


def _object_of(law: Law) -> dict[str, Any]:
    return {"rows": law.rows, "feedback": law.feedback, "start": law.start, "loads": law.loads}
