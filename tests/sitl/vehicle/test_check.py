"""Impossible vehicles are rejected in one line; reports of possible ones agree with references."""

import json
import re
import subprocess
import sys
import tomllib
from math import pi, sqrt
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl import vehicle_check
from sitl.vehicle import check, config
from tests.sitl.vehicle.test_fill_missing import FINNED

WHOLE = FINNED + "[ballast]\nx_cm_m = 0.0\n[linear]\nz_CM_m = -0.01\n"


def refused(text: str, tmp_path: Path) -> str:
    file = tmp_path / "mine.toml"
    file.write_text(text)
    with pytest.raises(config.VehicleFileError) as refusal:
        vehicle_check.check(file)
    assert "\n" not in str(refusal.value)
    return str(refusal.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("z_CM_m = -0.01", "z_CM_m = 0.01", "otherwise the vehicle capsizes"),
        ("x_cm_m = 0.0", "x_cm_m = 0.0\nx_cb_m = 1.2", "expected inside the hull"),
        ("z_CM_m = -0.01", "I_yy_kgm2 = 90.0", "expected none above the sum of the other two"),
        ("z_CM_m = -0.01", "I_yy_kgm2 = -1.0", "linear.I_yy_kgm2 = -1.0: expected float > 0"),
        ("x_cm_m = 0.0", "x_cm_m = 1.2", "mass matrix has an eigenvalue -"),
        ("diameter_m = 0.2", "diameter_m = 2.5", "expected more than its two caps together"),
        ('layout = "cruciform"', 'layout = "y"', "fins.layout = 'y': expected cruciform or x"),
        (
            "root_chord_m = 0.10",
            "root_chord_m = 0.10\nx_m = -1.5",
            "fins.x_m = -1.5: expected on the hull",
        ),
        (
            'shape = "cylinder"',
            'shape = "cube"',
            "hull.shape = 'cube': expected series58, myring, cylinder, profile",
        ),
        ("[fins]", "[wings]", "wings = {"),
        ("span_m = 0.12", "", "fins: missing key span_m"),
    ],
)
def test_impossible_vehicle_rejected_with_key(
    old: str, new: str, message: str, tmp_path: Path
) -> None:
    assert old in WHOLE
    assert message in refused(WHOLE.replace(old, new), tmp_path)


def test_vehicle_without_duct_and_fins_rejected(tmp_path: Path) -> None:
    bare = FINNED[: FINNED.index("[fins]")]
    assert "neither a table duct nor fins" in refused(bare, tmp_path)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (
            "[[0.0, 0.0], [0.5, 0.1], [0.5, 0.1], [1.0, 0.0]]",
            "hull.points_m: expected finite distances",
        ),
        ("[[0.0, 0.0], [0.5, 0.6], [1.0, 0.0]]", "expected longer than wide"),
        ("[[0.0, 0.0], [0.5, 0.001], [1.0, 0.0]]", "at most 100 times as long as wide"),
        ("[[0.0, 0.0], [1.0, 0.0]]", "hull.points_m = "),
    ],
)
def test_invalid_profile_rejected(points: str, message: str, tmp_path: Path) -> None:
    hull = f'shape = "profile"\npoints_m = {points}\n'
    text = FINNED.replace('shape = "cylinder"\nlength_m = 2.0\ndiameter_m = 0.2\n', hull)
    assert message in refused(text, tmp_path)


def test_profile_read_from_csv_file(tmp_path: Path) -> None:
    (tmp_path / "hull.csv").write_text("x_m,radius_m\n0.0,0.0\n0.5,0.1\n1.5,0.1\n2.0,0.03\n")
    file = tmp_path / "mine.toml"
    inner = 'shape = "profile"\nfile = "hull.csv"\n'
    file.write_text(FINNED.replace('shape = "cylinder"\nlength_m = 2.0\ndiameter_m = 0.2\n', inner))
    assert vehicle_check.check(file).length_m == pytest.approx(2.0)
    (tmp_path / "hull.csv").write_text("x_m,radius_m\n0.0;0.0\n")
    with pytest.raises(
        config.VehicleFileError, match=r"hull\.file = 'hull\.csv'.*expected a CSV file"
    ):
        vehicle_check.check(file)


def test_travel_beyond_stall_of_fins_warned(tmp_path: Path) -> None:
    file = tmp_path / "fins.toml"
    for travel_deg, warned in ((20.0, False), (25.0, True)):
        file.write_text(f"{FINNED}\n[tailcone]\ntravel_deg = {travel_deg}\n")
        found = vehicle_check.check(file).warnings
        assert any("stall" in text for text in found) == warned


def test_caribou_truth_warns_of_effective_coefficients() -> None:
    assert any("effective" in text for text in vehicle_check.check("caribou_truth").warnings)
    assert vehicle_check.check("caribou_nominal").warnings == []


def test_caribou_nominal_periods_and_speeds() -> None:
    found = vehicle_check.check("caribou_nominal")
    stiffness = 640.0 * 9.80665 * 0.021
    assert found.pitch_period_s == pytest.approx(
        2 * pi * sqrt((469.0 + 458.0) / stiffness), rel=1e-9
    )
    assert found.full_speed_mps == pytest.approx(
        1.3 / 0.58, rel=0.01
    )  # drag and thrust both grow with speed squared
    yaw = (-449 * -525 - (266 - 640 * 1.3) * -239) / (-449 * -525)
    assert found.yaw.straight_line_index == pytest.approx(yaw, rel=1e-6)
    assert found.yaw.moment_tail_nm - found.yaw.moment_hull_nm == pytest.approx(
        -239 * 1.3, rel=1e-6
    )


def test_level_trim_equals_identification_solver() -> None:
    """Reference: the solver of the identification for the same equations."""
    from sitl.vehicle import build_model
    from sysid.estimation.map import steady_state

    vehicle = config.load("xfin_auv")
    model, found = build_model.build(vehicle), vehicle_check.check("xfin_auv")
    assert found.level_pitch_deg == pytest.approx(
        steady_state.level_pitch_rad(vehicle, model) * 180 / pi, rel=1e-6
    )
    assert found.level_elevator_deg == pytest.approx(
        steady_state.level_elevator_rad(vehicle, model) * 180 / pi, rel=1e-6
    )


def test_vehicle_without_level_trim_rejected(tmp_path: Path) -> None:
    said = refused(FINNED + "[operating_point]\nspeed_mps = 0.001\n", tmp_path)
    assert "operating_point.speed_mps = 0.001: expected a speed at which level motion" in said


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "sitl.vehicle", *arguments],
        capture_output=True,
        text=True,
        check=False,
    )


def test_command_line_writes_once_and_checks(tmp_path: Path) -> None:
    out = str(tmp_path / "mine.toml")
    options = [
        "new",
        "--hull",
        "myring",
        "--tail",
        "x",
        "--length-m",
        "2.0",
        "--diameter-m",
        "0.25",
        "--out",
        out,
    ]
    assert run(*options).returncode == 0
    assert run("check", out).stdout.startswith("mine: 2.000 m, ")
    assert json.loads(run("check", out, "--json").stdout)["yaw"]["states"] == ["v", "r", "psi"]
    again = run(*options)
    assert (again.returncode, again.stderr) == (2, f"vehicle: {out}: exists; give a new name\n")


def test_missing_diameter_is_named(tmp_path: Path) -> None:
    out = str(tmp_path / "mine.toml")
    refusal = run("new", "--hull", "myring", "--tail", "x", "--length-m", "2", "--out", out)
    assert refusal.returncode == 2
    assert "--diameter-m: is missing" in refusal.stderr


def test_command_line_errors_are_one_line(tmp_path: Path) -> None:
    for arguments in (["check", "nowhere"], ["new", "--out", str(tmp_path / "x.toml")]):
        refusal = run(*arguments)
        assert refusal.returncode == 2
        assert refusal.stdout == ""
        assert refusal.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("part", "message"),
    [
        (
            "[operating_point]\nspeed_mps = 99999999999999999999999\n",
            "operating_point.speed_mps = 99999999999999999999999: expected float > 0 and <= 15",
        ),
        (
            "[damping]\ncrossflow_cd = 1e200\n",
            "damping.crossflow_cd = 1e+200: expected float >= 0 and <= 100",
        ),
        (
            "[tailcone]\ntravel_deg = 0.26\n",
            "tailcone.travel_deg = 0.26: expected float >= 1 and <= 45",
        ),
        (
            "[water]\ndensity_kgpm3 = 1.025\n",
            "water.density_kgpm3 = 1.025: expected float >= 900 and <= 1100",
        ),
        (
            "[linear]\nM_de_nmprad = 1e300\n",
            "linear.M_de_nmprad = 1e+300: expected float >= -1e+09 and <= 1e+09",
        ),
    ],
)
def test_value_that_no_vehicle_has_rejected_with_range(
    part: str, message: str, tmp_path: Path
) -> None:
    assert refused(f"{FINNED}\n{part}", tmp_path).endswith(f"mine.toml: {message}")


def test_wrong_derived_key_names_its_derivation(tmp_path: Path) -> None:
    """The file has no mass: it is derived from the net buoyancy."""
    message = refused(f"{FINNED}\n[ballast]\nnet_buoyancy_n = 5000.0\n", tmp_path)
    assert re.search(r"ballast\.mass_kg = -\d+.*; derived, as .*B_net/g.*B_net 5000 N", message)


@given(
    changed=st.fixed_dictionaries(
        {},
        optional={
            "operating_point.speed_mps": st.sampled_from([1e-9, 0.1, 15.0]),
            "operating_point.thrust_n": st.sampled_from([1e-9, 1e6]),
            "damping.crossflow_cd": st.sampled_from([0.0, 100.0]),
            "ballast.x_cm_m": st.floats(-1.0, 1.0),
            "ballast.mass_kg": st.floats(1e-6, 1e6),
            "linear.M_de_nmprad": st.sampled_from([-1e9, 0.0, 1e9]),
            "linear.Y_v_kgps": st.sampled_from([-1e9, 0.0, 1e9]),
            "linear.N_r_kgm2ps": st.sampled_from([-1e9, 0.0, 1e9]),
            "fins.tip_chord_m": st.sampled_from([1e-9, 30.0]),
            "fins.lift_slope_per_rad": st.sampled_from([1e-9, 100.0]),
        },
    )
)
@pytest.mark.filterwarnings("error")
def test_values_in_range_give_finite_report_or_one_line(changed: dict[str, float]) -> None:
    tables = tomllib.loads(FINNED)
    for name, value in changed.items():
        table, key = name.split(".")
        tables.setdefault(table, {})[key] = value
    text = report_or_error(toml_text(tables))
    assert "nan" not in text
    assert text.startswith("finned: ") or re.fullmatch(r"mine\.toml: .*", text)


def report_or_error(text: str) -> str:
    """Return the report of a vehicle file, or why it is refused."""
    try:
        return check.format_text(check.check_config(config.parse(text, "mine.toml"), "mine.toml"))
    except config.VehicleFileError as error:
        return str(error)


def toml_text(tables: dict[str, Any]) -> str:
    """Return tables of numbers and texts as TOML."""
    top = [f"{key} = {value!r}" for key, value in tables.items() if not isinstance(value, dict)]
    parts = [
        "\n".join([f"[{name}]", *(f"{key} = {value!r}" for key, value in table.items())])
        for name, table in tables.items()
        if isinstance(table, dict)
    ]
    return "\n".join([*top, *parts])


@pytest.mark.parametrize(
    ("part", "message"),
    [
        ("[ballast]\nmass_kg = 58190.0\n", r"ballast\.mass_kg = 58190 .*: expected 31\.\d+ to 12"),
        ("[ballast]\nnet_buoyancy_n = -900.0\n", r"mass_kg = 154\.\d+ with net_buoyancy_n = -900"),
        (
            "[ballast]\nmass_kg = 58.0\nnet_buoyancy_n = 300.0\n",
            r"ballast\.net_buoyancy_n = 300 with mass_kg = 58: expected -\d+.* to \d+.* N: the",
        ),
        ("[tailcone]\nbacklash_deg = 20.0\n", r"backlash_deg = 20\.0: expected less than tailcone"),
        ("[tailcone]\nelevator_bias_deg = -40.0\n", r"elevator_bias_deg = -40\.0: expected less"),
        ("[tailcone]\nstep_deg = 16.0\n", r"step_deg = 16\.0: expected less than tailcone\.travel"),
    ],
)
def test_contradiction_names_the_wrong_key(part: str, message: str, tmp_path: Path) -> None:
    """Before, a wrong mass, length or travel was reported as a wrong speed, or not at all."""
    assert re.search(message, refused(f"{FINNED}\n{part}", tmp_path))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("root_chord_m = 0.10", "root_chord_m = 10.0", r"root_chord_m = 10\.0: expected less than"),
        ("span_m = 0.12", "span_m = 12.0", r"span_m = 12\.0: .* than the hull's length of 2 m"),
    ],
)
def test_fin_longer_than_hull_rejected(old: str, new: str, message: str, tmp_path: Path) -> None:
    assert re.search(message, refused(FINNED.replace(old, new), tmp_path))


@pytest.mark.parametrize(
    ("part", "warning"),
    [
        (
            "[ballast]\nx_cm_m = 0.01\n",
            r"floats at pitch -\d+ deg: ballast\.x_cm_m = 0\.01: expected near ballast\.x_cb_m",
        ),
        ("[ballast]\ny_cm_m = -0.01\n", r"floats at heel \+\d+ deg: ballast\.y_cm_m = -0\.01"),
        ("[ballast]\ny_cm_m = 0.002\n", r"floats at heel -11 deg: ballast\.y_cm_m = 0\.002"),
        ("[ballast]\nnet_buoyancy_n = 38.0\n", r"level motion needs .* of 15 deg of elevator"),
    ],
)
def test_vehicle_far_from_trim_is_warned_of(part: str, warning: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(f"{FINNED}\n{part}")
    assert any(re.match(warning, text) for text in vehicle_check.check(file).warnings)
