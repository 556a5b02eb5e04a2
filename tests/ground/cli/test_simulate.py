"""`ground simulate`: JSON output, failures and invalid input."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ground.cli.main import app
from ground.cli.options import remark_other_vehicle, to_json
from ground.client import param_file
from ground.missions import plans
from ground.report import simulation
from mavlink_io.errors import InputError, OperationError
from mavlink_io.mission_items import MavCmd, MissionItem
from sitl.vehicle import config
from sysid.models import model_file as models
from sysid.monte_carlo import samples, study
from sysid.monte_carlo.simulate import Sea
from sysid.monte_carlo.study import LegSummary, ResultRange, SimulationSummary
from sysid.test_design import prior
from tests.sysid.monte_carlo.files import SHORT_MISSION, model_of, write_known_model

PLACE = MissionItem(0, 3, MavCmd.NAV_WAYPOINT, x=423_505_000, y=-710_000_000, z=-3.0)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A model, two sets of gains and a mission."""
    write_known_model(tmp_path / "model.json")
    (tmp_path / "held.param").write_text("HDG_P,0.6\nHDG_D,1.5\n")
    (tmp_path / "wild.param").write_text("HDG_P,4.0\nHDG_D,1.5\n")
    (tmp_path / "short.toml").write_text(SHORT_MISSION)
    (tmp_path / "place.plan").write_text(plans.write_plan([PLACE]))
    return tmp_path


def simulate(folder: Path, *options: str) -> tuple[str, BaseException | None]:
    given = ["simulate", str(folder / "model.json"), "--mission", str(folder / "short.toml")]
    ended = CliRunner().invoke(app, [*given, *options])
    return ended.stdout, ended.exception


@pytest.mark.process
def test_simulate_json_compares_sets_names_unstable_one(folder: Path) -> None:
    held, wild = (folder / name for name in ("held.param", "wild.param"))
    out, failure = simulate(
        folder, "--gains", str(held), "--compare", str(wild), "--samples", "2", "--json"
    )
    first, second = json.loads(out)["results"]
    assert (first["gains"], first["diverged"], first["vehicles"]) == ("held.param", {}, 2)
    assert (second["gains"], second["diverged"]) == ("wild.param", {"heading": 2})
    assert isinstance(failure, OperationError)
    assert str(failure) == "wild.param, sea x1: of 2 vehicles 2 did not hold heading"
    alone = study.StudyRequest(
        plans.load_items(str(folder / "short.toml")), {held.name: param_file.load(held)}, vehicles=2
    )
    (in_one_process,) = study.simulate_samples(samples.read(folder / "model.json"), alone)
    assert (
        first == json.loads(to_json(simulation.as_json([in_one_process], "short", 1)))["results"][0]
    )


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (
            ("--disturbance-scale", "rough"),
            "--disturbance-scale rough: must be different numbers from 0 to 10",
        ),
        (("--disturbance-scale", "1,1"), "--disturbance-scale 1,1: must be different"),
        (("--disturbance-scale", "11"), "--disturbance-scale 11: must be"),
        (("--compare", "held.param"), "held.param: is given twice"),
        (("--mission", "nowhere"), "nowhere: no readable mission"),
        (("--mission", "place.plan"), "item 0: latitude and longitude cannot be simulated"),
        (("--prior", "caribou_truth"), "is the simulated truth"),
        (("--keep", "."), "Is a directory"),
    ],
)
def test_simulate_invalid_option_is_one_line(
    folder: Path, options: tuple[str, str], said: str
) -> None:
    option, value = options
    given = str(folder / value) if value.endswith((".param", ".plan")) else value
    out, failure = simulate(folder, "--gains", str(folder / "held.param"), option, given)
    assert out == ""
    assert isinstance(failure, InputError)
    assert said in str(failure)
    assert "\n" not in str(failure)


@pytest.mark.parametrize(("prior_name", "is_remarked"), [("remus100", True), ("edited", False)])
def test_prior_of_another_vehicle_than_the_model_is_remarked(
    folder: Path, capsys: pytest.CaptureFixture[str], prior_name: str, *, is_remarked: bool
) -> None:
    """The file of the same vehicle with another ballast is what the option is for."""
    if prior_name == "edited":
        text = Path(str(config.__file__)).with_name("caribou_nominal.toml").read_text()
        prior_name = str(folder / "edited.toml")
        Path(prior_name).write_text(text.replace("x_cm_m = 0.0", "x_cm_m = 0.001"))
    remark_other_vehicle(folder / "model.json", prior_name)
    expected = f"ground: --prior {prior_name}: is the file of remus100, and "
    assert (expected in capsys.readouterr().err) is is_remarked


def test_simulate_unknown_parameter_names_file(folder: Path) -> None:
    (folder / "odd.param").write_text("HDG_Q,1\n")
    _, failure = simulate(folder, "--gains", str(folder / "odd.param"))
    assert isinstance(failure, InputError)
    assert str(failure) == "odd.param: parameter HDG_Q does not exist"


def test_simulate_model_without_covariance_refused(folder: Path) -> None:
    known = prior.from_file(config.load("caribou_nominal"))
    models.write(model_of(known._replace(covariance=0.0 * known.covariance)), folder / "model.json")
    _, failure = simulate(folder, "--gains", str(folder / "held.param"))
    assert isinstance(failure, InputError)
    assert "joint.covariance" in str(failure)


def test_format_text_holds_values_legs_and_failures() -> None:
    two = ResultRange(1.0, 2.0)
    leg = LegSummary(340.0, 3.0, ResultRange(21.0, 25.0), 1)
    told = SimulationSummary(
        "new.param",
        Sea(1.5),
        9,
        two,
        two,
        ResultRange(0.05, 0.07),
        (leg,),
        two,
        two,
        two,
        None,
        1,
        {},
        {"pitch": 2},
        9.0,
    )
    page = simulation.format_text([told], "square")
    for expected in (
        "square: 9 vehicles sampled from the model",
        "x1.5",
        "5.0",
        "7.0",
        "3 m, 340 deg",
        "21, worst 25; 1 did not",
    ):
        assert expected in page
    assert page.endswith("new.param, sea x1.5: of 9 vehicles 1 broached, 2 surfaced for pitch")
