"""A replay flies the mission of its dive."""

import json
from pathlib import Path

import pytest

from autopilot.control.params import ParamError
from autopilot.control.types import Home
from ground.cli.replay import replay
from ground.client.recorder import Recorder
from ground.log_tools import replay as replays
from ground.log_tools.replay import ReplayRequest, replay_log
from ground.missions import plans
from mavlink_io.errors import InputError
from sysid.data.dataset import LogError
from sysid.test_design import prior
from tests.helpers import qgroundcontrol_plan


def test_replay_of_another_mission_is_refused(tmp_path: Path) -> None:
    log, model = tmp_path / "dive.mcap", prior.read("caribou_nominal")
    recorder = Recorder(log)
    plan = plans.write_plan(plans.load_items("straight_run"))
    recorder.attach("mission.plan", plan.encode(), "application/json")
    recorder.finish()
    with pytest.raises(InputError, match=r"--mission combined: .* holds another mission"):
        replay_log(ReplayRequest(log, {}, "combined"), model)
    with pytest.raises(LogError, match="no ATTITUDE"):  # the mission is that of the dive
        replay_log(ReplayRequest(log, {}, "straight_run"), model)


def test_replay_has_geofence_and_rally_points_of_the_log(tmp_path: Path) -> None:
    source = tmp_path / "survey.plan"
    source.write_text(json.dumps(qgroundcontrol_plan.plan(Home(42.3, -71.1, known=True))))
    dive, log = plans.load(str(source)), tmp_path / "dive.mcap"
    recorder = Recorder(log)
    plan = plans.write_plan(dive.items, dive.fence, dive.rally)
    recorder.attach("mission.plan", plan.encode(), "application/json")
    recorder.finish()
    flown = replays._plan(ReplayRequest(log, {}))
    assert flown == (dive.items, dive.fence, dive.rally)
    empty = tmp_path / "empty.mcap"
    Recorder(empty).finish()
    assert replays._plan(ReplayRequest(empty, {}, str(source))) == flown


def test_replay_refused_parameter_names_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise ParamError("HDG_D = 9999: must be 0 to 10 s")

    monkeypatch.setattr(replays, "replay_log", refuse)
    params = tmp_path / "oor.param"
    params.write_text("HDG_D,9999\n")
    with pytest.raises(ParamError, match=r"oor\.param: HDG_D = 9999: must be 0 to 10 s"):
        replay(tmp_path / "dive.mcap", params)


def test_replay_of_a_refused_log_creates_no_folder(tmp_path: Path) -> None:
    gains, out = tmp_path / "held.param", tmp_path / "out"
    gains.write_text("HDG_P,0.6\n")
    with pytest.raises(LogError, match=r"none\.mcap"):
        replay(tmp_path / "none.mcap", gains, out=out)
    assert not out.exists()
