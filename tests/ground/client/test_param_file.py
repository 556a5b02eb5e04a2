"""Parameter files: those of other tools, and invalid lines."""

from pathlib import Path

import pytest

from ground.client import param_file
from mavlink_io.errors import InputError


@pytest.mark.parametrize(
    "text",
    ["HDG_P,0.5\n", "# gains\nHDG_P,0.5  # why\n", "HDG_P 0.5\n", "1\t1\tHDG_P\t0.5\t9\n"],
)
def test_load_parameter_files_of_other_tools(text: str, tmp_path: Path) -> None:
    path = tmp_path / "gains.param"
    path.write_text(text)
    assert param_file.load(path) == {"HDG_P": 0.5}


def test_save_and_load_parameters_round_trip(tmp_path: Path) -> None:
    values = {"HDG_P": 0.65, "MAV_SYS_ID": 1.0, "DPT_I": 0.001, "NEGATIVE": -1e-7}
    param_file.save(tmp_path / "p.param", values)
    assert param_file.load(tmp_path / "p.param") == values


@pytest.mark.parametrize("line", ["HDG_P", "HDG_P,nan", "HDG_P,x", "a,b,c", "HDG_P,1_000"])
def test_load_invalid_line_is_named(line: str, tmp_path: Path) -> None:
    path = tmp_path / "gains.param"
    path.write_text(f"HDG_D,1\n{line}\n")
    with pytest.raises(InputError, match=r"gains\.param: line 2: .* expected NAME,VALUE"):
        param_file.load(path)


def test_load_long_line_is_cut_off(tmp_path: Path) -> None:
    """The file of an LQG controller is one line of 10,000 characters."""
    path = tmp_path / "controller.json"
    path.write_text('{"rows": [' + "0.5, " * 2000)
    with pytest.raises(InputError, match=r"is no parameter; expected NAME,VALUE") as caught:
        param_file.load(path)
    assert len(str(caught.value)) < 150 + len(str(path))


def test_load_parameter_given_twice_is_named(tmp_path: Path) -> None:
    path = tmp_path / "gains.param"
    path.write_text("HDG_P,1\nHDG_D,1\nHDG_P,2\n")
    with pytest.raises(InputError, match=r"gains\.param: line 3: HDG_P is given twice; keep one"):
        param_file.load(path)
