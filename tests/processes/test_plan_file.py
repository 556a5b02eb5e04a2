"""`ground fly` flies a plan file of QGroundControl whole, with processes and a simulated sea."""

import json
import math
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from pymavlink import mavutil

from autopilot.control.types import Home
from tests.helpers.qgroundcontrol_plan import RALLY_M, REACHED, SURVEY_DEPTH_M, WAYPOINTS_M, plan
from tests.helpers.subprocesses import Finished, process

pytestmark = pytest.mark.process

SITE = Home(42.35, -71.0, True)
"""Place of the start: the default of a scenario."""
LONGEST_S = 200.0
"""Wall time for the dive of 300 s on a busy machine, in s."""
NEAR_M = 10.0
"""Largest distance to a waypoint: its radius of acceptance, and the drift of dead reckoning."""
RALLY_NEAR_M = 25.0
"""Largest distance to the rally point at the end: the vehicle surfaces while it moves on."""
RALLY_TEXT = "RTL: return point reached"
FENCE, RALLY = 1, 2


def fly(folder: Path, content: dict[str, Any]) -> Finished:
    """Fly a plan in the simulator, with a telemetry log and a log of the true state."""
    (folder / "area.plan").write_text(json.dumps(content), encoding="utf-8")
    names = ("--log", "area.mcap", "--tlog", "area.tlog", "--truth", "truth.mcap")
    files = (word if word.startswith("--") else str(folder / word) for word in names)
    command = ("-m", "ground", "fly", str(folder / "area.plan"), "--sitl", *files)
    with process(*command) as child:
        return child.finish(timeout_s=LONGEST_S)


def telemetry(path: Path, *names: str) -> list[Any]:
    """Return the messages of these names, as pymavlink reads them."""
    log: Any = mavutil.mavlink_connection(str(path))
    messages = []
    while (message := log.recv_match(type=list(names))) is not None:
        messages.append(message)
    log.close()
    return messages


def track(path: Path) -> list[tuple[float, float, float]]:
    """Return the true positions: north, east and depth (m) from the start."""
    with path.open("rb") as file:
        states = [json.loads(message.data) for _, _, message in make_reader(file).iter_messages()]
    return [tuple(state["position_ned_m"]) for state in states]


def test_plan_with_survey_jump_fence_and_rally_is_flown_whole(tmp_path: Path) -> None:
    done = fly(tmp_path, plan(SITE))
    assert done.status == 0, done.stderr
    messages = telemetry(
        tmp_path / "area.tlog", "MISSION_ITEM_REACHED", "STATUSTEXT", "MISSION_ACK", "HEARTBEAT"
    )
    by_name = {
        name: [m for m in messages if m.get_type() == name]
        for name in ("MISSION_ITEM_REACHED", "STATUSTEXT", "MISSION_ACK")
    }
    assert [m.seq for m in by_name["MISSION_ITEM_REACHED"]] == list(REACHED)
    acknowledged = {m.mission_type: m.type for m in by_name["MISSION_ACK"]}
    assert acknowledged == {0: 0, FENCE: 0, RALLY: 0}
    texts = [m.text for m in by_name["STATUSTEXT"]]
    assert RALLY_TEXT in texts
    assert not [text for text in texts if "fence" in text.lower()], texts
    places = track(tmp_path / "truth.mcap")
    for waypoint_m in WAYPOINTS_M:
        assert min(math.dist(place[:2], waypoint_m) for place in places) < NEAR_M
    assert max(depth_m for *_, depth_m in places) == pytest.approx(SURVEY_DEPTH_M, abs=0.6)
    assert math.dist(places[-1][:2], RALLY_M) < RALLY_NEAR_M
    assert places[-1][2] < 0.6


def test_plan_whose_jump_crosses_an_exclusion_polygon_is_refused(tmp_path: Path) -> None:
    """The line from the last waypoint back to the first, item 1, crosses the polygon."""
    done = fly(tmp_path, plan(SITE, keep_out_m=((35.0, 5.0), (35.0, 25.0), (50.0, 5.0))))
    assert done.status == 1
    assert "Mission item 1: geofence: the line to it is inside exclusion zone 1" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["area.plan"], "logs of an armed vehicle"
