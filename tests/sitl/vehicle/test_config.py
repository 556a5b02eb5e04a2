"""A vehicle file is read, or rejected in one line with file, key, value and what is expected."""

import re
from pathlib import Path

import pytest

from sitl.vehicle import build_model, config
from tests.sitl.vehicle import flight

BENCH = (Path(config.__file__).parent / "caribou_nominal.toml").read_text()
REMUS = (Path(config.__file__).parent / "remus100.toml").read_text()


def altered(key: str, value: str) -> str:
    """Return caribou_nominal with the first ``key`` set to ``value``, or removed if empty."""
    line = f"{key} = {value}" if value else ""
    text, n = re.subn(rf"(?m)^{key} = .*$", line, BENCH, count=1)
    assert n == 1
    return text


@pytest.mark.parametrize("name", flight.SHIPPED)
def test_shipped_vehicle_loads_by_name(name: str) -> None:
    assert config.load(name).name == name


def test_only_caribou_truth_has_rudder_bias() -> None:
    assert config.load("caribou_nominal").tailcone.rudder_bias_deg == 0.0
    assert config.load("caribou_truth").tailcone.rudder_bias_deg == -6.0


def test_unknown_name_is_read_as_path(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(BENCH)
    assert config.load(file) == config.load("caribou_nominal")


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("diameter_m", "-0.5", r"hull\.diameter_m = -0\.5: expected float > 0"),
        ("prismatic", "1.5", r"hull\.prismatic = 1\.5: expected float > 0 and < 1"),
        ("mass_kg", '"heavy"', r"ballast\.mass_kg = 'heavy': expected float, got str"),
        ("mass_kg", "true", r"ballast\.mass_kg = True: expected float, got bool"),
        ("mass_kg", "nan", r"ballast\.mass_kg = nan: expected a finite number"),
        ("Y_v_kgps", "inf", r"linear\.Y_v_kgps = inf: expected a finite number"),
        ("prismatic", "", r"hull: missing key prismatic"),
        (
            "separated_deg",
            "15.0",
            r"duct\.separated_deg = 15\.0: expected more than duct\.stall_deg = 20\.0",
        ),
        (
            "base_length_m",
            '1.0\nshape = ["cylinder"]',
            r"hull\.shape = \['cylinder'\]: expected series58, ",
        ),
        (
            "max_section",
            "0.4\nmax_sektion = 0.4",
            r"hull\.max_sektion = 0\.4: unknown key; known here: base_length_m, ",
        ),
        (
            "name",
            '"caribou_nominal"\ncolour = "red"',
            r"colour = 'red': unknown key; known here: name, water, ",
        ),
        (
            "net_buoyancy_n",
            "-7000.0",
            r"ballast\.net_buoyancy_n = -7000\.0: expected more than minus the weight",
        ),
    ],
)
def test_bad_value_rejected_with_key(key: str, value: str, message: str) -> None:
    with pytest.raises(config.VehicleFileError, match=rf"^mine\.toml: {message}") as refusal:
        config.parse(altered(key, value), "mine.toml")
    assert "\n" not in str(refusal.value)


def test_propeller_larger_than_duct_rejected() -> None:
    text = BENCH.replace("diameter_m = 0.38 ", "diameter_m = 0.50 ")
    with pytest.raises(
        config.VehicleFileError,
        match=r"propeller\.diameter_m = 0\.5: expected less than duct\.diameter_m",
    ):
        config.parse(text, "mine.toml")


def test_hull_too_thin_for_its_formulas_rejected() -> None:
    """The eccentricity of the spheroid would round to 1, whose artanh is infinite."""
    text = re.sub(r"(?m)^diameter_m = .*$", "diameter_m = 1e-9", REMUS, count=1)
    with pytest.raises(config.VehicleFileError, match=r"at most 100 times as long as wide"):
        config.parse(text, "thin.toml")


def test_table_instead_of_number_rejected_with_key() -> None:
    with pytest.raises(
        config.VehicleFileError, match=r"^mine\.toml: water = 3: expected object, got int"
    ):
        config.parse(
            re.sub(
                r"(?s)\[water\].*?\n\n",
                "",
                BENCH.replace('name = "caribou_nominal"', 'name = "x"\nwater = 3'),
            ),
            "mine.toml",
        )


def test_invalid_toml_error_has_line() -> None:
    with pytest.raises(config.VehicleFileError, match=r"^mine\.toml: not valid TOML: .*line 2"):
        config.parse("name = 'x'\nwater =\n", "mine.toml")


@pytest.mark.parametrize("name", ["no_such_vehicle", "no/such/file.toml", "."])
def test_unreadable_file_error_lists_vehicles(name: str) -> None:
    with pytest.raises(
        config.VehicleFileError, match=r"cannot be read .* give .*caribou_nominal.*, or a TOML file"
    ):
        config.load(name)


def test_binary_file_rejected(tmp_path: Path) -> None:
    file = tmp_path / "vehicle.toml"
    file.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(config.VehicleFileError, match="not UTF-8 text"):
        config.load(file)


def test_indefinite_mass_matrix_rejected() -> None:
    with pytest.raises(config.VehicleFileError, match="mass matrix has an eigenvalue -"):
        build_model.build(config.parse(altered("z_CM_m", "-0.5"), "mine.toml"))


def test_thrust_below_duct_drag_rejected() -> None:
    with pytest.raises(
        config.VehicleFileError, match=r"thrust_n = 0\.1: expected more than the duct's own drag"
    ):
        build_model.build(config.parse(altered("thrust_n", "0.1"), "mine.toml"))


def test_lost_steps_without_motor_steps_rejected() -> None:
    text = altered("lost_step_chance", "0.01")
    with pytest.raises(
        config.VehicleFileError,
        match=r"tailcone\.lost_step_chance = 0\.01: expected tailcone\.step_deg",
    ):
        config.parse(text, "mine.toml")
    stepping = text.replace("step_deg = 0.0 ", "step_deg = 0.05 ")
    assert config.parse(stepping, "mine.toml").tailcone.lost_step_chance == 0.01
