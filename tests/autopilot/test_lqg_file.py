"""LQG controller files: round trip, and errors with file, key and value."""

import json
from pathlib import Path
from typing import Any

import pytest

from autopilot.control import lqg, lqg_file
from autopilot.control.lqg import LqgControllers
from autopilot.control.lqg_file import LqgFileError

CONTROLLERS = LqgControllers(
    1.3,
    lqg.from_matrices(((0.9, 0.1, 0.02, 1.0 / 3.0),), (-1.5,), ((0.0, 1.0),), 0),
    lqg.from_matrices(((0.9, 0.1, 0.2, -0.3, 0.05, 0.1),), (2.0,), ((0.0, 0.0, 1.0, 0.0),), 0),
    0.2,
)
WHOLE = json.loads(lqg_file.to_json(CONTROLLERS, "f00d"))


def test_file_round_trip_is_equal(tmp_path: Path) -> None:
    path = tmp_path / "controller.json"
    path.write_text(lqg_file.to_json(CONTROLLERS, "f00d"))
    assert lqg_file.load(path) == CONTROLLERS


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"format": 2}, "format = 2: expected 1"),
        ({"tick_s": 0.01}, "tick_s = 0.01: expected 0.02, the time step of the loops"),
        ({"speed_mps": 0}, "speed_mps = 0: expected more than 0"),
        ({"pitch_per_metre": None}, "pitch_per_metre = None: expected a number"),
        ({"depth": None}, "depth: expected an object"),
        (
            {"heading": {"rows": [[1, 2, 3, 4]], "feedback": [], "loads": 0}},
            "heading.feedback: expected a list of numbers",
        ),
        (
            {"heading": {"feedback": [1], "loads": 1}},
            "heading.loads = 1: expected the number of load states, 0 to 0",
        ),
        ({"heading": {"rows": [], "feedback": [1], "loads": 0}}, "heading.rows: expected 1 rows"),
        (
            {"heading": {"rows": [[1, 2, 3]], "feedback": [1], "loads": 0}},
            r"heading.rows\[0\]: expected 4 numbers",
        ),
        (
            {"heading": {"rows": [[1, 2, 3, float("nan")]], "feedback": [1], "loads": 0}},
            r"heading.rows\[0\] = nan: expected a",
        ),
        (
            {"heading": {"rows": [[1, 2, 3, True]], "feedback": [1], "loads": 0}},
            r"heading.rows\[0\] = True: expected a number",
        ),
    ],
)
def test_wrong_content_raises_with_key(
    tmp_path: Path, change: dict[str, Any], complaint: str
) -> None:
    path = tmp_path / "controller.json"
    path.write_text(json.dumps(WHOLE | change))
    with pytest.raises(LqgFileError, match=rf"^{path}: {complaint}"):
        lqg_file.load(path)


@pytest.mark.parametrize("text", ["", "[1]", "HDG_P,1\n"])
def test_other_file_format_raises(tmp_path: Path, text: str) -> None:
    path = tmp_path / "controller.json"
    path.write_text(text)
    with pytest.raises(
        LqgFileError, match=r"controller\.json: (not JSON|the file: expected an object)"
    ):
        lqg_file.load(path)


def test_missing_file_raises() -> None:
    with pytest.raises(LqgFileError, match=r"^nowhere\.json: No such file"):
        lqg_file.load(Path("nowhere.json"))
