"""Exports of logs, read by readers that this project did not write."""

import errno
import json
import os
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros1.decoder import DecoderFactory
from numpy.typing import NDArray
from scipy.io import loadmat
from typer.testing import CliRunner

from ground.cli.main import app
from ground.log_tools import export, mcap, viewer_log
from ground.log_tools.formats import ExportFormat
from ground.log_tools.si_units import si_columns
from mavlink_io.errors import InputError
from sysid.data import readers, segments, state_table
from tests.helpers import node
from tests.mavlink_io.logging import decoding
from tests.sysid.data.readers import files
from tests.sysid.data.readers import test_damage as damaged


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return damaged.write_own(tmp_path / "dive.mcap")


@pytest.fixture
def view(log: Path) -> Path:
    (path,) = export.export(log, log.with_name("view.mcap"), ExportFormat.MCAP)
    return path


def run(*words: str) -> Any:
    done = CliRunner().invoke(app, ["log", *words, "--json"], catch_exceptions=False)
    return json.loads(done.stdout)


def decoded(path: Path, topic: str) -> list[Any]:
    """Return messages by the MCAP project's reader."""
    factories = [DecoderFactory(), decoding.JsonDecoderFactory()]
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=factories)
        return [message for _, _, _, message in reader.iter_decoded_messages([topic])]


def test_csv_is_utf_8_whatever_the_locale(tmp_path: Path) -> None:
    """Texts hold U+FFFD in place of damaged bytes, and the reader of CSV logs expects UTF-8."""
    script = (
        "import sys, warnings; from pathlib import Path; from ground.log_tools import export;"
        "warnings.simplefilter('error', EncodingWarning);"
        "export._write_csv(Path(sys.argv[1]), {'text': ['\\ufffd']})"
    )
    command = [sys.executable, "-X", "warn_default_encoding", "-c", script]
    subprocess.run([*command, str(tmp_path / "a.csv")], check=True)
    assert (tmp_path / "a.csv").read_text(encoding="utf-8") == "text\n\ufffd\n"


def test_csv_of_messages_is_in_si_units() -> None:
    columns: dict[str, NDArray[np.integer[Any]]] = {
        "time_boot_ms": np.array([1500], np.uint32),
        "lat": np.array([423_500_000], np.int32),
        "alt": np.array([-2500], np.int32),
        "vx": np.array([130], np.int16),
        "hdg": np.array([65535], np.uint16),
    }
    si = si_columns("/mavlink/1/1/GLOBAL_POSITION_INT", columns)
    assert si["time_boot_s"][0] == pytest.approx(1.5)
    assert si["lat_deg"][0] == pytest.approx(42.35)
    assert si["alt_m"][0] == pytest.approx(-2.5)
    assert si["vx_mps"][0] == pytest.approx(1.3)
    assert np.isnan(si["hdg_rad"][0])  # MAVLink: UINT16_MAX if unknown


def test_csv_of_battery_has_nan_for_unknown_values() -> None:
    columns: dict[str, NDArray[np.integer[Any]]] = {
        "battery_remaining": np.array([-1, 50], np.int8),
        "current_battery": np.array([-1, 250], np.int16),
    }
    si = si_columns("/mavlink/1/1/BATTERY_STATUS", columns)
    np.testing.assert_allclose(si["battery_remaining_fraction"], [np.nan, 0.5])
    np.testing.assert_allclose(si["current_battery_a"], [np.nan, 2.5])


def test_pandas_reads_every_csv(log: Path, tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    tables = {Path(f).name: pandas.read_csv(f) for f in run("export", str(log))["files"]}
    expected = readers.load(log).tables
    assert {f"{topic.removeprefix('/mavlink/').replace('/', '-')}.csv" for topic in expected} == (
        set(tables) - {"state.csv", "parameters.csv"}
    )
    for topic, table in expected.items():
        name = f"{topic.removeprefix('/mavlink/').replace('/', '-')}.csv"
        assert len(tables[name]) == table.time_s.size
    attitude = tables["1-1-ATTITUDE.csv"]
    truth = expected["/mavlink/1/1/ATTITUDE"].columns["yaw"].astype(float)
    assert attitude["yaw_rad"].to_numpy() == pytest.approx(truth, abs=0)
    state = state_table.state_table(readers.read(log))
    recorded = {name: v for name, v in state.items() if not np.isnan(v).all()}
    assert set(tables["state.csv"].columns) == {*recorded, "test"}
    for name, values in recorded.items():
        assert np.array_equal(tables["state.csv"][name].to_numpy(float), values, equal_nan=True)


def test_state_csv_is_a_log_for_identification(log: Path, tmp_path: Path) -> None:
    export.export_csv(log, tmp_path / "csv")
    original, again = readers.read(log), readers.read(tmp_path / "csv" / "state.csv")
    assert again.attitude.r_radps == pytest.approx(original.attitude.r_radps, abs=0)
    tests = [type(event.value).__name__ for event in again.events]
    assert tests == ["TestStarted", "TestEnded"]


def test_state_csv_has_the_loop_rate_and_no_unknown_values(tmp_path: Path) -> None:
    """A fit takes the time for which commands are held from the rate of the loops."""
    path = tmp_path / "dive.csv"
    rows = [f"{k / 25},{0.01 * k},{k % 7},58" for k in range(50)]
    header = "time_s,heading_rad,rudder_deg,thrust_pct"
    path.write_text("\n".join(["# SCHED_LOOP_RATE = 400", header, *rows, ""]))
    original, state = readers.read(path), tmp_path / "state.csv"
    export.write_state(original, state)
    lines = state.read_text().splitlines()
    assert lines[0].endswith(",test,loop_hz")
    assert lines[1].endswith(",400.0")
    assert not {"depth_m", "depth_rate_mps", "pitch_rad", "q_radps"} & set(lines[0].split(","))
    assert segments.hold_of(readers.read(state)) == segments.hold_of(original)


def test_scipy_reads_every_structure_of_the_mat(log: Path, tmp_path: Path) -> None:
    (target,) = export.export(log, tmp_path / "dive.mat", ExportFormat.MAT)
    content = loadmat(target, simplify_cells=True)
    tables = readers.load(log).tables
    for topic, table in tables.items():
        structure = content["m" + topic.removeprefix("/mavlink/").replace("/", "_")]
        assert np.size(structure["time_s"]) == table.time_s.size
        assert len(structure) == 1 + len(table.columns)
    state = state_table.state_table(readers.read(log))
    for name, values in state.items():
        assert np.array_equal(content["state"][name], values, equal_nan=True)
    assert content["parameters"] == readers.read(log).parameters


def test_tlog_export_holds_the_same_messages(log: Path, tmp_path: Path) -> None:
    (target,) = export.export(log, tmp_path / "dive.tlog", ExportFormat.TLOG)
    expected, again = readers.load(log).tables, readers.load(target).tables
    assert set(again) == set(expected)
    for topic, table in expected.items():
        for name, values in table.columns.items():
            assert np.array_equal(again[topic].columns[name], values)
    with pytest.raises(InputError, match=r"dive\.tlog: --format tlog is for MCAP logs"):
        export.export_tlog(target, tmp_path / "second.tlog")


def test_csv_export_that_fails_leaves_only_what_was_there(log: Path, tmp_path: Path) -> None:
    folder = tmp_path / "csv"
    folder.mkdir()
    (folder / "parameters.csv").write_text("mine")  # written last
    with pytest.raises(FileExistsError):
        export.export_csv(log, folder)
    assert [file.name for file in folder.iterdir()] == ["parameters.csv"]
    assert (folder / "parameters.csv").read_text() == "mine"


def test_tlog_export_on_a_full_disk_leaves_no_file(
    log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The part stayed, and the next attempt ended with "File exists"."""

    def write(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("mavlink_io.logging.tlog.TelemetryLog.write", write)
    target = tmp_path / "dive.tlog"
    with pytest.raises(OSError, match="No space left") as raised:
        export.export(log, target, ExportFormat.TLOG)
    assert raised.value.filename == str(target)
    assert not target.exists()


def test_view_holds_the_whole_log_with_state_and_scene(log: Path, view: Path) -> None:
    before, after = mcap.info(log), mcap.info(view)
    assert after["damage"] == []
    added = {"/caribou/state", "/caribou/scene"}
    assert set(after["topics"]) - set(before["topics"]) == added
    assert {t: n for t, n in after["topics"].items() if t not in added} == before["topics"]
    assert (after["attachments"], after["metadata"]) == (before["attachments"], before["metadata"])
    profile, count, by_encoding = decoding.decode(view)
    assert (profile, sum(by_encoding.values())) == ("", count)


def test_state_is_in_degrees_and_metres(log: Path, view: Path) -> None:
    recorded = readers.read(log)
    states = decoded(view, "/caribou/state")
    times = [state.time_s for state in states]
    yaw_deg = np.interp(times, recorded.attitude.time_s, np.degrees(recorded.attitude.yaw_rad))
    assert np.array([s.heading_deg for s in states]) == pytest.approx(yaw_deg % 360.0)
    with view.open("rb") as file:
        stamps = [m.log_time for _, _, m in make_reader(file).iter_messages(["/caribou/state"])]
    with log.open("rb") as file:
        first = next(
            m.log_time for _, _, m in make_reader(file).iter_messages(["/mavlink/1/1/ATTITUDE"])
        )
    assert stamps[0] == first
    assert np.diff(stamps).min() >= 0.98e9 * viewer_log.STATE_PERIOD_S


def test_scene_shows_hull_duct_and_a_bounded_trail(
    view: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenes = decoded(view, "/caribou/scene")
    assert [e["id"] for e in scenes[-1]["entities"]] == ["hull", "duct", "trail"]
    trails = [scene["entities"][2]["lines"][0]["points"] for scene in scenes]
    assert [len(trail) for trail in trails] == list(range(1, len(trails) + 1))
    monkeypatch.setattr(viewer_log, "TRAIL_POINTS", 8)
    log = readers.read(view)
    short = [
        json.loads(data)["entities"][2]["lines"][0]["points"]
        for _, topic, data in viewer_log.derived_messages(log)
        if topic == "/caribou/scene"
    ]
    assert max(map(len, short)) <= 8
    assert [trail[-1] for trail in short] == [trail[-1] for trail in trails]
    assert short[-1][0] == trails[-1][0]


@pytest.mark.parametrize(
    ("rudder_rad", "elevator_rad", "axis"), [(0.2, 0.0, "y"), (0.0, 0.2, "z"), (0.0, 0.0, "")]
)
def test_duct_turns_the_way_of_its_command(
    rudder_rad: float, elevator_rad: float, axis: str
) -> None:
    turn = viewer_log._duct(rudder_rad, elevator_rad)["pose"]["orientation"]
    w, x, y, z = (turn[name] for name in "wxyz")
    # third column of the rotation matrix: the cylinder's axis, which points forward
    forward = 2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)
    assert forward[0] == pytest.approx(np.cos(rudder_rad + elevator_rad))
    # positive rudder: trailing edge to starboard (-y); positive elevator: trailing edge up (+z)
    trailing_edge = {"y": -forward[1], "z": -forward[2]}
    assert trailing_edge["y"] == pytest.approx(-np.sin(0.2) if axis == "y" else 0.0, abs=1e-12)
    assert trailing_edge["z"] == pytest.approx(np.sin(0.2) if axis == "z" else 0.0, abs=1e-12)


def test_view_of_another_vehicles_log_has_poses(tmp_path: Path) -> None:
    path = files.ulog(tmp_path / "a.ulg", texts=False)
    (view,) = export.export(path, tmp_path / "view.mcap", ExportFormat.MCAP)
    assert set(mcap.info(view)["topics"]) == {"/caribou/state", "/caribou/scene", "/tf"}
    assert decoding.decode(view)[2].keys() == {"ros1", "json"}


@pytest.mark.slow
def test_foxglove_packages_read_every_message(
    log: Path, view: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    counts = node.read_logs(tmp_path_factory.getbasetemp() / "node", log, view)
    for path in (log, view):
        assert counts[str(path)]["decoded"] == mcap.info(path)["topics"]
        assert counts[str(path)]["messages"] == mcap.info(path)["messages"]


def test_existing_file_is_not_overwritten(log: Path, tmp_path: Path) -> None:
    (tmp_path / "dive.mat").write_bytes(b"mine")
    with pytest.raises(InputError, match=r"dive\.mat"):
        run("export", str(log), "--format", "mat")
    assert (tmp_path / "dive.mat").read_bytes() == b"mine"


def test_layouts_show_topics_and_fields_that_exist(view: Path, tmp_path: Path) -> None:
    info = Counter(mcap.info(view)["topics"]) + Counter(["/log", "/foxglove/location", "/tf"])
    fields = {field.name for field in viewer_log.STATE_FIELDS}
    run("layout", "foxglove", "--out", str(tmp_path / "layout.json"))
    layout = json.loads((tmp_path / "layout.json").read_text())
    panels = layout["configById"]
    assert set(_leaves(layout["layout"])) == set(panels)
    plotted = {path["value"] for panel in panels.values() for path in panel.get("paths", ())}
    assert len(plotted) > 10
    for path in plotted:
        topic, _, field = path.partition(".")
        assert topic in info
        assert field in fields
    assert set(panels["3D!scene"]["topics"]) == {viewer_log.SCENE.topic}
    assert panels["map!position"]["followTopic"] in info
    assert panels["RosOut!texts"]["topicToRender"] in info
    run("layout", "plotjuggler", "--out", str(tmp_path / "layout.xml"))
    curves = ElementTree.parse(tmp_path / "layout.xml").getroot().iter("curve")
    names = [curve.get("name", "").rpartition("/") for curve in curves]
    assert len(names) > 10
    assert {topic for topic, _, _ in names} == {"/caribou/state"}
    assert {field for _, _, field in names} <= fields


def _leaves(layout: Any) -> list[str]:
    """Return the panels of a Foxglove layout tree."""
    if isinstance(layout, str):
        return [layout]
    return [*_leaves(layout["first"]), *_leaves(layout["second"])]
