"""Notes of a model on its logs: damage, impossible gains, and a travel unlike the prior's."""

import dataclasses
import math
from pathlib import Path

import pytest

from sitl.vehicle import config
from sysid import prior_knowledge, refit, usable_runs
from sysid.data import readers
from sysid.data.dataset import Log
from sysid.planes import Plane
from sysid.refit import RefitRequest
from sysid.reproduction.paper_tables import TABLE_3_INITIAL
from tests.sysid import dives, sea
from tests.sysid.data.readers import files
from tests.sysid.dives import DiveTest

PULSES = {f"SERVO{n}_MAX": 1900.0 for n in (1, 2, 3)}
PARAMETERS = {"ACT_TRAVEL_DEG": 15.0, "SCHED_LOOP_RATE": 50.0} | PULSES


def notes(*logs: Log, prior: str = "caribou_nominal") -> list[str]:
    return usable_runs.log_notes(logs, prior_knowledge.prior_knowledge(prior))


def test_note_names_damaged_log(tmp_path: Path) -> None:
    path = files.dataflash(tmp_path / "cut.bin", parameters=PARAMETERS)
    assert notes(readers.read(path)) == []
    path.write_bytes(path.read_bytes()[:-303])
    (note,) = notes(readers.read(path))
    assert note.startswith("cut.bin is damaged: it ends within a message (")
    assert note.endswith("what followed is lost")


def test_note_says_that_the_range_of_pulses_is_not_known(tmp_path: Path) -> None:
    known = {name: value for name, value in PARAMETERS.items() if name != "SERVO2_MAX"}
    (note,) = notes(readers.read(files.dataflash(tmp_path / "b.bin", parameters=known)))
    assert "assumed: 1500 +- 400 us for the outputs 2;" in note


def test_note_says_that_the_hold_of_commands_is_not_known(tmp_path: Path) -> None:
    log = readers.read(
        files.dataflash(tmp_path / "a.bin", parameters={"ACT_TRAVEL_DEG": 15.0} | PULSES)
    )
    (note,) = notes(log)
    assert note.startswith("a.bin: it is not known how long the autopilot held a command")


def test_note_names_travel_unlike_the_prior(tmp_path: Path) -> None:
    log = readers.read(files.dataflash(tmp_path / "dive.bin", parameters=PARAMETERS))
    assert notes(log, prior="remus100") == [
        "dive.bin: ACT_TRAVEL_DEG = 15, which is used; the travel of prior remus100 is 13.6 deg: a"
        " wrong prior or another tailcone"
    ]


@pytest.mark.parametrize(
    ("logged_deg", "used_deg"),
    [({}, 15.0), ({"ACT_TRAVEL_DEG": 20.0}, 20.0), ({"ACT_TRAVEL_DEG": 10.0}, 10.0)]
    + [({"ACT_TRAVEL_DEG": value}, 15.0) for value in (15.0, 15.000001, 60.0)],
)
def test_travel_of_the_log_replaces_that_of_the_prior(
    logged_deg: dict[str, float], used_deg: float, tmp_path: Path
) -> None:
    """The log knows its vehicle. A number that differs by rounding is that of the prior."""
    path = files.dataflash(tmp_path / "dive.bin", parameters=PARAMETERS)
    log = dataclasses.replace(readers.read(path), parameters=logged_deg)
    known = prior_knowledge.prior_knowledge("caribou_nominal")
    used = usable_runs.with_logged_travel(known, [log])
    assert used.config.tailcone.travel_deg == used_deg
    if used_deg == 15.0:
        assert used == known


@pytest.mark.slow
def test_commands_beyond_the_travel_of_the_prior_are_not_clipped(tmp_path: Path) -> None:
    """With trim the commands reach 20 deg: clipped at 15 deg, the static gain was 21 % larger."""
    nominal = Path(config.__file__).with_name("caribou_nominal.toml").read_text()
    assert nominal.count("\ntravel_deg = 15.0") == 1
    wide = tmp_path / "wide.toml"
    wide.write_text(nominal.replace("\ntravel_deg = 15.0", "\ntravel_deg = 25.0"))
    tests = [DiveTest(Plane.YAW, sea.doublet(degrees)) for degrees in (14.0, -12.0, 13.0)]
    path = dives.write(tmp_path / "dive.mcap", config.load(str(wide)), tests)
    from_nominal, from_wide = (
        refit.refit(RefitRequest(paths=[path], prior=prior, method="paper"))
        for prior in ("caribou_nominal", str(wide))
    )
    assert from_nominal.vehicle.file.tailcone.travel_deg == 25.0
    assert from_nominal.planes == from_wide.planes


def test_refit_records_notes_on_logs(tmp_path: Path) -> None:
    """The paper's method is the fastest; the prior has another travel."""
    tests = [DiveTest(Plane.YAW, sea.doublet(5.0)), DiveTest(Plane.YAW, sea.doublet(-6.0))]
    path = dives.write(tmp_path / "dive.mcap", config.load("caribou_truth"), tests)
    model = refit.refit(RefitRequest(paths=[path], prior="remus100", method="paper"))
    assert any("a wrong prior or another tailcone" in note for note in model.notes)
    assert model.assessment is not None
    assert not model.assessment.planes[Plane.PITCH].tested


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"HDG_P": 1e308}, "HDG_P = 1e+308: expected a gain of at most 1000"),
        ({"PTCH_D": math.nan}, "PTCH_D = nan: expected a gain of at most 1000"),
        ({"DPT_I": -math.inf}, "DPT_I = -inf: expected a gain of at most 1000"),
        (
            {"HDG_P": 0.0, "HDG_D": 0.0, "HDG_I": 0.0},
            "HDG_P, HDG_D, HDG_I = 0: expected gains that close the loop",
        ),
    ],
)
def test_impossible_gains_of_a_log_are_noted_and_not_used(
    changes: dict[str, float], said: str, tmp_path: Path
) -> None:
    log = readers.read(files.dataflash(tmp_path / "dive.bin", parameters=PARAMETERS))
    possible = dataclasses.replace(log, parameters={**log.parameters, **TABLE_3_INITIAL})
    impossible = dataclasses.replace(possible, parameters={**possible.parameters, **changes})
    assert notes(possible) == []
    assert notes(impossible) == [f"dive.bin: {said}; the gains of this log are not used"]
    assert refit._logged_gains([impossible]) is None
    assert refit._logged_gains([impossible, possible]) == TABLE_3_INITIAL
