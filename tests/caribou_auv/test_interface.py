"""The Python interface without processes."""

import math
import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import caribou_auv as auv
from caribou_auv import flying
from caribou_auv.pytest_plugin import CaribouVehicle
from sitl import scenario
from tests.ground.campaign.test_vehicle_file import WITHOUT_COMPASS
from tests.sysid.data.readers import files
from tests.sysid.data.readers import test_damage as damaged

ROOT = Path(__file__).parents[2]


def test_every_public_name_exists_and_is_documented() -> None:
    assert sorted(auv._MODULE_OF) == sorted(auv.__all__)
    for name in auv.__all__:
        assert getattr(auv, name).__doc__
    with pytest.raises(AttributeError, match="no attribute 'refit'"):
        auv.refit  # noqa: B018


def test_plugin_is_registered_and_loads_no_numerical_library() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    module = project["entry-points"]["pytest11"]["caribou"]
    assert hasattr(import_module(module), "caribou_vehicle")
    script = f"import sys, {module}; sys.exit('numpy' in sys.modules or 'numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], cwd=ROOT, check=False).returncode == 0


def test_log_of_each_format_has_the_same_columns(tmp_path: Path) -> None:
    own = auv.to_arrays(auv.load_log(damaged.write_own(tmp_path / "a.mcap")))
    other = auv.to_arrays(auv.load_log(files.ulog(tmp_path / "a.ulg", texts=False)))
    assert list(own) == list(other)
    messages = auv.load_messages(tmp_path / "a.mcap")
    assert np.array_equal(messages["/mavlink/1/1/ATTITUDE"]["pitch_rad"], own["pitch_rad"])


def test_frame_has_the_columns_of_the_arrays(tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    log = auv.load_log(damaged.write_own(tmp_path / "a.mcap"))
    arrays, frame = auv.to_arrays(log), auv.to_frame(log)
    assert frame.index.name == "time_s"
    assert [frame.index.name, *frame.columns] == list(arrays)
    assert np.array_equal(frame["depth_m"], arrays["depth_m"], equal_nan=True)


def test_errors_of_input_are_one_line(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"")
    (tmp_path / "latin.toml").write_bytes(b'title = "\xe9"\n')
    cases = (
        lambda: auv.load_log(tmp_path / "none.mcap"),
        lambda: auv.load_model(tmp_path / "none.json"),
        lambda: auv.load_parameters(tmp_path / "none.param"),
        lambda: auv.simulate("no_such_mission"),
        lambda: auv.simulate("straight_run", {"NO_SUCH": 1.0}),
        lambda: auv.simulate("straight_run", vehicle="no_such_vehicle"),
        lambda: auv.fly("straight_run", tmp_path / "a.mcap"),
        lambda: auv.fly("straight_run", tmp_path / "none" / "a.mcap"),
        lambda: auv.identify(str(tmp_path / "a.mcap")),
        lambda: auv.fly("straight_run", tmp_path / "b.mcap", scenario="none", faults=[{}]),
        lambda: auv.fly(
            "straight_run", tmp_path / "b.mcap", scenario=tmp_path / "latin.toml", faults=[{}]
        ),
        lambda: auv.fly("straight_run", tmp_path / "b.mcap", faults={"at_s": 60.0}),  # type: ignore[arg-type]
        lambda: auv.fly("straight_run", tmp_path / "b.mcap", faults=[{"at_s": None}]),  # type: ignore[dict-item]
        lambda: auv.fly("straight_run", tmp_path / "b.mcap", faults=[{"a\nb": 1.0}]),
        lambda: auv.fly("straight_run", tmp_path / "b.mcap", parameters={"HDG_P": "0.6"}),  # type: ignore[dict-item]
        lambda: auv.simulate("straight_run", {"HDG_P": "0.6"}),  # type: ignore[dict-item]
        lambda: auv.simulate("straight_run", ["HDG_P"]),  # type: ignore[arg-type]
        lambda: auv.save_parameters({"HDG_P": "0.6"}, tmp_path / "a.param"),  # type: ignore[dict-item]
        lambda: auv.save_parameters({1: 0.6}, tmp_path / "a.param"),  # type: ignore[dict-item]
        lambda: auv.save_parameters({"HDG_P": math.nan}, tmp_path / "a.param"),
        lambda: auv.save_model("model.json", tmp_path / "b.json"),  # type: ignore[arg-type]
        lambda: auv.design(tmp_path / "none.json"),
        lambda: auv.design({"model": 1}),  # type: ignore[arg-type]
        lambda: auv.simulate("straight_run", model="none.json"),
        lambda: auv.fly("straight_run", tmp_path / "b.mcap", connect="udpin:[::1]:1", faults=[{}]),
        lambda: auv.compare([]),  # type: ignore[arg-type]
        lambda: auv.compare({}),
    )
    for case in cases:
        with pytest.raises(auv.CaribouError) as caught:
            case()
        assert "\n" not in str(caught.value)


def test_dive_without_a_steady_leg_is_compared(tmp_path: Path) -> None:
    log = auv.load_log(damaged.write_own(tmp_path / "a.mcap"))
    comparison = auv.compare({"short": log})
    assert comparison.dives[0].legs == 0
    assert str(comparison).splitlines()[1].split() == ["short", "nan", "nan", "nan", "0"]


@pytest.mark.slow
def test_simulated_dives_are_compared() -> None:
    first = auv.simulate("straight_run", seed=2)
    again = auv.simulate("straight_run", seed=2)
    assert first.finished
    assert np.array_equal(first.log.depth.depth_m, again.log.depth.depth_m)
    rough = auv.simulate("straight_run", seed=2, sea=auv.Sea(times=3.0))
    comparison = auv.compare({"calm": first.log, "rough": rough.log})
    calm, wild = comparison.dives
    assert wild.heading_deg > calm.heading_deg
    assert [line.split()[0] for line in str(comparison).splitlines()] == ["95", "calm", "rough"]


def test_faults_are_added_to_a_scenario(tmp_path: Path) -> None:
    fault: dict[str, float | str] = {
        "at_s": 60.0,
        "unit": "rudder",
        "kind": "stuck",
        "angle_deg": 5,
    }
    for name in ("disturbed", str(tmp_path / "own.toml")):
        if name != "disturbed":
            (tmp_path / "own.toml").write_text('title = "own"\n')
        with flying._scenario_with_faults(name, [fault]) as file:
            (read,) = scenario.load(file).fault
            assert read == fault
            assert scenario.load(file).disturbance == scenario.load(name).disturbance
        assert not Path(file).exists()


def test_text_of_a_fault_is_a_toml_string() -> None:
    text = "".join(map(chr, range(128))) + "\\u0041 \u00e9\U0001f600"
    assert tomllib.loads(flying._fault_table({"unit": text}))["fault"] == [{"unit": text}]


def test_number_of_numpy_is_a_toml_number() -> None:
    table = flying._fault_table({"at_s": np.float64(60.0), "angle_deg": np.float64(5.0)})
    assert tomllib.loads(table)["fault"] == [{"at_s": 60.0, "angle_deg": 5.0}]


def test_options_of_a_dive_replace_those_of_the_marker(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flown = []
    monkeypatch.setattr(flying, "fly", lambda *args, **options: flown.append((*args, options)))
    vehicle = CaribouVehicle(tmp_path, {"seed": 1, "speed": "max"})
    vehicle.fly("trim")
    vehicle.fly("trim", seed=5)
    assert flown[0] == ("trim", tmp_path / "1-trim.mcap", {"seed": 1, "speed": "max"})
    assert flown[1] == ("trim", tmp_path / "2-trim.mcap", {"seed": 5, "speed": "max"})


def test_simulated_vehicle_is_checked_before_the_dive(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(flying, "SimulatedVehicle", lambda *_, **__: pytest.fail("was started"))
    vehicle = tmp_path / "blind.toml"
    vehicle.write_text(WITHOUT_COMPASS)
    with pytest.raises(auv.CaribouError, match="does not arm without it"):
        auv.fly("straight_run", tmp_path / "a.mcap", vehicle=vehicle, parameters={})


def test_autopilot_that_cannot_start_is_reported(tmp_path: Path) -> None:
    factory = flying._AutopilotCommand([str(tmp_path / "none")])
    arguments = ["--hil", "udpin:127.0.0.1:1", "--gcs", "tcpin:127.0.0.1:2", "--lifeline"]
    with pytest.raises(auv.CaribouError, match="none: No such file or directory; give a program"):
        factory("autopilot", arguments, tmp_path / "stderr")


def test_autopilot_command_gets_both_addresses(tmp_path: Path) -> None:
    script = "import sys, pathlib; pathlib.Path(sys.argv[1]).write_text(' '.join(sys.argv[2:]))"
    factory = flying._AutopilotCommand([sys.executable, "-c", script, str(tmp_path / "seen")])
    arguments = ["--hil", "udpin:127.0.0.1:1", "--gcs", "tcpin:127.0.0.1:2", "--lifeline"]
    factory("autopilot", arguments, tmp_path / "stderr").end(60.0)
    seen = (tmp_path / "seen").read_text()
    assert seen == "--hil udpin:127.0.0.1:1 --gcs tcpin:127.0.0.1:2"
