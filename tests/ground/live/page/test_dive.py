"""Rows, panel and history of one dive on the live page."""

import math
from itertools import pairwise

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ground.client.vehicle import StatusText
from ground.live.page.dive import ROW_PERIOD_S, ShownDive
from ground.live.page.history import COLUMNS, MAX_OLD_ROWS, MAX_ROWS, History
from ground.live.page.page_state import Browser, PageState
from ground.live.watch import rows
from mavlink_io.codec import Frame
from mavlink_io.dialect import by_name
from tests.ground.live.page.telemetry import ARDUPILOT, frame, heartbeat, motion


def fly(dive: ShownDive, *times_s: float) -> None:
    for time_s in times_s:
        for received in motion(time_s):
            dive.on_frame(received)


def row(dive: ShownDive) -> dict[str, float | None]:
    return dict(zip(COLUMNS, dive.history.since(0)[-1], strict=True))


def test_row_holds_motion_outputs_and_setpoints_in_degrees() -> None:
    dive = ShownDive("a", travel_deg=20.0)
    dive.on_frame(heartbeat())
    fly(dive, 10.0)
    last = row(dive)
    assert last["time_s"] == 10.0
    assert last["depth_m"] == pytest.approx(4.0 + math.sin(10.0 / 3.0), abs=1e-3)
    assert last["heading_deg"] == pytest.approx(math.degrees(1.0), abs=1e-3)
    assert last["rudder"] == pytest.approx(20.0 * 0.5 * math.sin(10.0), abs=1e-3)
    assert last["elevator"] == pytest.approx(4.0, abs=1e-3)
    assert last["thrust"] == pytest.approx(58.0, abs=1e-3)
    assert (last["depth_setpoint_m"], last["heading_setpoint_deg"]) == (4.0, 0.0)
    assert last["north_m"] == pytest.approx(20.0 * math.sin(1.0), abs=1e-3)


def test_outputs_of_another_autopilot_are_percent() -> None:
    dive = ShownDive("a")
    dive.on_frame(heartbeat(ARDUPILOT))
    dive.on_frame(frame("SERVO_OUTPUT_RAW", servo1_raw=1700, servo2_raw=1500))
    dive.on_frame(frame("ATTITUDE", time_boot_ms=100))
    assert (row(dive)["rudder"], row(dive)["elevator"]) == (50.0, 0.0)
    assert not dive.panel()["has_surfaces"]


@pytest.mark.parametrize(
    ("name", "fields", "columns"),
    [
        ("LOCAL_POSITION_NED", {"x": 1e30}, ["north_m", "east_m"]),
        ("LOCAL_POSITION_NED", {"z": -3.4e38}, ["depth_m"]),
        ("ATTITUDE", {"yaw": 1e30}, ["heading_deg"]),
        ("ATTITUDE_TARGET", {"q": (math.nan,) * 4}, ["heading_setpoint_deg", "pitch_setpoint_deg"]),
        ("ACTUATOR_OUTPUT_STATUS", {"actuator": (0.0, 0.0, 1e30, *[0.0] * 29)}, ["thrust"]),
    ],
)
def test_impossible_value_leaves_a_gap_in_its_columns_only(
    name: str, fields: dict[str, object], columns: list[str]
) -> None:
    dive = ShownDive("a")
    dive.on_frame(heartbeat())
    kinds = {received.name: received for received in motion(10.0)}
    bad = frame(name, **{**kinds[name].decode()._asdict(), **fields})
    for received in {**kinds, name: bad}.values():
        dive.on_frame(received)
    assert [column for column, value in row(dive).items() if value is None] == columns


def test_pulse_of_65535_us_is_no_output() -> None:
    dive = ShownDive("a")
    dive.on_frame(heartbeat(ARDUPILOT))
    dive.on_frame(frame("SERVO_OUTPUT_RAW", servo1_raw=1700, servo2_raw=0, servo3_raw=65535))
    dive.on_frame(frame("ATTITUDE", time_boot_ms=100))
    assert [row(dive)[name] for name in ("rudder", "elevator", "thrust")] == [50.0, 0.0, None]


def test_unknown_place_is_not_taken_for_the_origin() -> None:
    dive = ShownDive("a")
    unknown = 2**31 - 1
    for time_ms, lat, lon in ((1000, unknown, unknown), (2000, 420_000_000, -710_000_000)):
        dive.on_frame(frame("GLOBAL_POSITION_INT", time_boot_ms=time_ms, lat=lat, lon=lon))
        dive.on_frame(frame("ATTITUDE", time_boot_ms=time_ms))
    dive.on_frame(frame("MISSION_CURRENT", seq=65535))
    assert [line[COLUMNS.index("north_m")] for line in dive.history.since(0)] == [None, 0.0]
    assert dive.panel()["sequence"] is None


def test_ignored_setpoints_are_not_shown() -> None:
    dive = ShownDive("a")
    dive.on_frame(frame("POSITION_TARGET_LOCAL_NED", z=4.0, type_mask=1 << 2))
    dive.on_frame(frame("ATTITUDE_TARGET", q=(math.nan,) * 4, type_mask=1 << 7))
    dive.on_frame(frame("ATTITUDE", time_boot_ms=100))
    assert [row(dive)[name] for name in COLUMNS if "setpoint" in name] == [None] * 3


def test_position_alone_gives_a_track() -> None:
    dive = ShownDive("a")
    for index in range(3):
        dive.on_frame(
            frame(
                "GLOBAL_POSITION_INT",
                time_boot_ms=1000 * index,
                lat=420_000_000 + 1000 * index,
                lon=-710_000_000,
                relative_alt=-2500,
            )
        )
    # the track starts with the second position, 0.0001 deg of latitude further south
    assert row(dive)["north_m"] == pytest.approx(11.13, abs=0.05)
    assert row(dive)["depth_m"] == 2.5


def test_rows_follow_vehicle_time_and_a_restart_begins_again() -> None:
    dive = ShownDive("a")
    fly(dive, *(ROW_PERIOD_S / 4.0 * n for n in range(400, 480)))
    assert len(dive.history.since(0)) == 20
    fly(dive, 1.0, 12.0, 0.0, 12.1)
    assert len(dive.history.since(0)) == 22
    fly(dive, 1.0, 1.02, 1.04)
    assert len(dive.history.since(0)) == 1
    assert dive.history.count == 23


def test_history_is_bounded_and_keeps_the_newest_rows() -> None:
    history = History()
    for number in range(5 * MAX_ROWS):
        history.add((float(number),))
    rows = history.since(0)
    kept = [time_s for (time_s,) in rows if time_s is not None]
    assert len(kept) == len(rows)
    assert len(kept) <= MAX_ROWS
    assert kept == sorted(kept)
    assert kept[0] == 0.0
    newest = 5 * MAX_ROWS - MAX_ROWS // 4
    assert kept[-MAX_ROWS // 4 :] == [float(number) for number in range(newest, 5 * MAX_ROWS)]
    assert history.since(5 * MAX_ROWS - 2) == [(5.0 * MAX_ROWS - 2,), (5.0 * MAX_ROWS - 1,)]


def test_history_of_a_long_dive_is_even_and_complete_at_its_end() -> None:
    history, duration_s = History(), 4 * 3600
    for number in range(round(duration_s / ROW_PERIOD_S)):
        history.add((number * ROW_PERIOD_S,))
    times_s = [time_s for (time_s,) in history.since(0) if time_s is not None]
    gaps_s = [after - before for before, after in pairwise(times_s)]
    assert max(gaps_s) < 3.0 * duration_s / MAX_OLD_ROWS
    assert max(gaps_s[-MAX_ROWS // 4 :]) == pytest.approx(ROW_PERIOD_S)


@given(
    st.sampled_from(sorted({name for _, _, sources in rows.ROWS for name, _ in sources})),
    st.binary(max_size=255),
)
def test_panel_of_arbitrary_messages_is_json(name: str, payload: bytes) -> None:
    dive = ShownDive("a")
    dive.on_frame(heartbeat())
    dive.on_frame(Frame(1, 1, by_name(name).message_id, 0, payload, b""))
    for time_ms in (1 << 31, (1 << 31) + 200, (1 << 31) + 400):  # one alone may be impossible
        dive.on_frame(frame("ATTITUDE", time_boot_ms=time_ms, yaw=math.inf))
    assert msgspec.json.decode(msgspec.json.encode(dive.panel()))["known"]
    assert row(dive)["heading_deg"] is None


def test_browser_receives_everything_once_and_then_the_news() -> None:
    state, browser = PageState(), Browser()
    assert state.news(browser) == b""
    with state.dive("first") as dive:
        fly(dive, 1.0, 2.0)
        dive.on_text(StatusText(2, "Leak detected"))
    first = msgspec.json.decode(state.news(browser))
    assert first["columns"] == list(COLUMNS)
    assert len(first["rows"]) == 2
    assert first["panel"]["texts"][0]["level"] == "alarm"
    assert state.news(browser) == b""
    with state.dive("first") as dive:
        fly(dive, 3.0)
    assert [row[0] for row in msgspec.json.decode(state.news(browser))["rows"]] == [3.0]


def test_browser_follows_the_newest_dive_or_the_one_it_asked_for() -> None:
    state, newest, chosen = PageState(), Browser(), Browser("first")
    for name in ("first", "second"):
        with state.dive(name):
            pass
    assert msgspec.json.decode(state.news(newest))["panel"]["name"] == "second"
    news = msgspec.json.decode(state.news(chosen))
    assert (news["panel"]["name"], news["dives"]) == ("first", ["first", "second"])
