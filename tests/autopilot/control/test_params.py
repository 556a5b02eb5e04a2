"""Parameter table: MAVLink rules for names and values, ranges, and files."""

import inspect
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autopilot.control import request_handler, requests
from autopilot.control.params import (
    LOCKED_WHILE_ARMED,
    PARAMETERS,
    RULES,
    Config,
    ParamError,
    ParamInfo,
    ParamTable,
    config,
    find_conflict,
)
from autopilot.param_file import lines, load, to_text
from mavlink_io.real32 import as_real32
from tests.helpers.missions import Flight


def test_every_parameter_is_representable_in_mavlink() -> None:
    names = [row.name for row in PARAMETERS]
    assert names == sorted(set(names))
    for row in PARAMETERS:
        assert re.fullmatch(r"[A-Z][A-Z0-9_]{0,15}", row.name)
        assert row.minimum <= row.default <= row.maximum
        assert row.doc
    assert {row.field for row in PARAMETERS} | {"lqg_controllers"} == set(
        inspect.signature(Config).parameters
    )


def test_defaults_equal_initial_gains_of_paper() -> None:
    """Reference: Table 3 of the paper, initial column."""
    table = ParamTable()
    given_gains = {
        "HDG": (0.65, 1.5, 0.001, 0.01),
        "PTCH": (0.8, 1.9, 0.0, 0.0),
        "DPT": (0.13, 0.0, 0.001, 0.004),
    }
    for loop, gains in given_gains.items():
        assert tuple(table.get(f"{loop}_{name}") for name in ("P", "D", "I", "IMAX")) == gains


@given(st.data())
def test_set_in_range_is_stored_out_of_range_is_rejected(data: st.DataObject) -> None:
    row = data.draw(st.sampled_from(PARAMETERS))
    table = ParamTable()
    value = data.draw(st.floats(row.minimum, row.maximum).filter(lambda x: far_from_zero(row, x)))
    if row.integer:
        value = float(round(value))
    stored = table.set(row.name, value)
    assert table.get(row.name) == stored == value
    for wrong in (
        float("nan"),
        row.maximum + 1.0 + abs(row.maximum),
        row.minimum - 1.0 - abs(row.minimum),
    ):
        with pytest.raises(ParamError, match=row.name):
            table.set(row.name, wrong)
    assert table.get(row.name) == stored


def far_from_zero(row: ParamInfo, value: float) -> bool:
    """Return whether a value is not rejected for being too close to 0."""
    return row.integer or value == 0.0 or abs(value) >= row.smallest


def test_whole_number_is_stored_in_the_type_of_its_default() -> None:
    """Another type of a field makes the compiled tick compile again, which takes minutes."""
    changed = config({row.name: int(row.maximum) for row in PARAMETERS})
    for row in PARAMETERS:
        kind = int if row.integer else float
        assert type(getattr(changed, row.field)) is kind, row.name


def test_unknown_name_is_rejected() -> None:
    with pytest.raises(ParamError, match="HDG_Q"):
        config({"HDG_Q": 1.0})
    with pytest.raises(ParamError, match="HDG_Q"):
        ParamTable().get("HDG_Q")


def test_file_with_commas_spaces_and_comments_is_read(tmp_path: Path) -> None:
    path = tmp_path / "gains.param"
    path.write_text("# gains\nHDG_P,0.55\nHDG_D 1.35  # faster\n\n")
    assert load(path) == {"HDG_P": 0.55, "HDG_D": 1.35}


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("HDG_P 9", "must be 0 to 5"),
        ("NOPE,1", "does not exist"),
        ("HDG_P", "expected NAME,VALUE"),
        ("HDG_P,x", "NAME,VALUE"),
    ],
)
def test_file_bad_line_is_reported(tmp_path: Path, line: str, words: str) -> None:
    path = tmp_path / "bad.param"
    path.write_text(f"HDG_D,1\n{line}\n")
    with pytest.raises(ParamError, match=words) as error:
        load(path)
    assert f"{path}:2" in str(error.value)


@given(st.data())
def test_file_round_trip_any_float32_is_exact(data: st.DataObject) -> None:
    row = data.draw(st.sampled_from([row for row in PARAMETERS if not row.integer]))
    value = data.draw(st.floats(row.minimum, row.maximum).filter(lambda x: far_from_zero(row, x)))
    ((_, name, read),) = lines(
        to_text({row.name: min(row.maximum, max(row.minimum, as_real32(value)))})
    )
    assert not isinstance(read, ParamError)
    assert (name, as_real32(read)) == (row.name, as_real32(value))


def test_file_missing_is_reported(tmp_path: Path) -> None:
    with pytest.raises(ParamError, match=r"none\.param"):
        load(tmp_path / "none.param")


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"FENCE_DPT_MIN": 5.0, "FENCE_DPT_MAX": 5.0}, "must be less than FENCE_DPT_MAX = 5"),
        ({"FS_DEPTH_M": 1.0}, "RTL_DEPTH_M = 2: must be at most FS_DEPTH_M = 1"),
        ({"SID_DEPTH_MIN": 20.0}, "SID_DEPTH_MIN = 20: must be less than SID_DEPTH_MAX = 15"),
        ({"SURF_TIME_S": 2.0}, "SURF_HOLD_S = 3: must be less than SURF_TIME_S = 2"),
        ({"FS_PITCH_DEG": 20.0}, "PTCH_LIM_DEG = 20: must be less than FS_PITCH_DEG = 20"),
    ],
)
def test_conflicting_parameters_prevent_arming(values: dict[str, float], text: str) -> None:
    assert find_conflict(config({})) == ""
    assert find_conflict(config({"SURF_TIME_S": 0.0, "FENCE_DPT_MIN": 5.0})) == ""
    flight = Flight(config=config(values))
    for _ in flight.run(0.1):
        pass
    _, answer, _ = request_handler.handle_request(flight.state, requests.Arm(), flight.config)
    assert text in answer.text
    assert flight.ask(requests.Arm(force=True)) == 0


def test_every_rule_names_parameters_and_holds_for_defaults() -> None:
    names = {row.name for row in PARAMETERS}
    for rule in RULES:
        assert {rule.lower, rule.upper} <= names
    assert names >= LOCKED_WHILE_ARMED


def test_dangerous_parameter_is_locked_while_armed() -> None:
    table = ParamTable()
    table.armed = True
    with pytest.raises(ParamError, match="EST_SURF_HPA = 900: locked while armed"):
        table.set("EST_SURF_HPA", 900.0)
    assert table.get("EST_SURF_HPA") == 1013.25
    assert table.set("EST_SURF_HPA", 1013.25) == 1013.25, "a set that changes nothing is loaded"
    assert table.set("HDG_P", 0.5) == 0.5
    table.armed = False
    assert table.set("EST_SURF_HPA", 990.0) == 990.0
