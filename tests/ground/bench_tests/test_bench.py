"""`ground bench-test` and `ground inclining-test` with real processes and a simulated vehicle."""

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from ground.bench_tests import bench, incline
from ground.cli.main import app
from ground.client import flight
from ground.client import vehicle as client
from ground.client.recorder import Recorder
from ground.client.vehicle import VehicleClient, VehicleClientError
from ground.simulation import processes
from mavlink_io.errors import InputError, OperationError
from mavlink_io.mission_items import MavCmd
from tests.ground.fake import ACCEPTED, DENIED, FakeVehicle, step_while_waiting


def ground(*arguments: str, folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "ground", *arguments]
    return subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=200, check=False
    )


def run(*arguments: object) -> None:
    """Run a command in this process; its exception is raised."""
    CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)


def beyond(found: dict[str, Any], expected: float) -> float:
    """Off by how many standard deviations."""
    return abs(float(found["value"]) - expected) / float(found["sd"])


@pytest.mark.process
def test_bench_test_simulated_vehicle_tailcone_identified(tmp_path: Path) -> None:
    sweeps = ["--amplitude", "10", "--amplitude", "30", "--frequency", "0.2", "--frequency", "0.5"]
    ran = ground("bench-test", "--axis", "elevator", *sweeps, "--json", folder=tmp_path)
    assert ran.returncode == 0, ran.stderr
    result = json.loads(ran.stdout)
    assert list(result) == ["elevator"]
    assert json.loads((tmp_path / "bench" / "bench.json").read_text()) == result
    assert (tmp_path / "bench" / "figure4.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "bench" / "bench.mcap").stat().st_size > 10_000
    model = result["elevator"]["model"]
    simulated = {
        "gain": 1.0,
        "natural_frequency_radps": 3.0,
        "damping_ratio": 0.6,
        "delay_s": 0.3,
        "rate_degps": 15.0,
    }
    for name, value in simulated.items():
        assert beyond(model[name], value) < 4.0, (name, model[name])
        assert model[name]["value"] == pytest.approx(value, rel=0.03)
    assert [point["frequency_hz"] for point in result["elevator"]["points"]] == pytest.approx(
        [0.2, 0.5] * 2, rel=1e-2
    )
    again = ground("bench-test", folder=tmp_path)
    assert (again.returncode, again.stderr) == (
        2,
        "ground: --out bench: exists; give a new folder\n",
    )


@pytest.mark.process
def test_inclining_test_finds_simulated_centre_of_mass(tmp_path: Path) -> None:
    """The vehicle's own file is not told: the prior is the bench's, whose z_CM is another."""
    ran = ground("inclining-test", "--vehicle", "caribou_truth", "--json", folder=tmp_path)
    assert ran.returncode == 0, ran.stderr
    result = json.loads(ran.stdout)
    assert beyond(result["z_cm_m"], -0.015) < 4.0
    assert result["z_cm_m"]["value"] == pytest.approx(-0.015, abs=0.0005)
    assert result["file_z_cm_m"] == -0.021
    assert len(result["readings"]) == 7


@pytest.mark.parametrize(("result", "name"), [(4, "failed"), (6, "cancelled")])
def test_stopped_sweep_ends_the_bench_test(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, result: int, name: str
) -> None:
    """The result in COMMAND_ACK is enough: the fake vehicle sends no text."""
    fake = FakeVehicle({MavCmd.USER_1: [result]})
    monkeypatch.setattr(client, "wait", step_while_waiting(fake))
    fake.heartbeat()
    recorder = Recorder(tmp_path / "bench.mcap")
    vehicle = VehicleClient(fake.ground_end, recorder)
    vehicle.connect()
    with pytest.raises(OperationError, match=f"rudder at 0.5 Hz: user 1: {name}$"):
        bench._run_sweep(bench.Sweep("rudder", 10.0, 0.5), vehicle, recorder)
    assert vehicle.on_frame is None
    recorder.finish()
    fake.close()


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeVehicle]:
    """Return a fake vehicle that has the parameters of a bench test, each with the value 7."""
    parameters = {**dict.fromkeys(bench.PARAMETERS, 7.0), "ACT_TRAVEL_DEG": 15.0}
    fake = FakeVehicle(parameters=parameters)
    fake.modes = (*fake.modes, ("HOLD", 0, 0))
    monkeypatch.setattr(client, "wait", step_while_waiting(fake))
    fake.heartbeat()
    yield fake
    fake.close()


def test_vehicle_without_test_parameters_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    fake = FakeVehicle()
    monkeypatch.setattr(client, "wait", step_while_waiting(fake))
    fake.heartbeat()
    vehicle = VehicleClient(fake.ground_end)
    vehicle.connect()
    with (
        pytest.raises(OperationError, match="no parameter SID_DEPTH_MIN; this test needs"),
        bench.armed_without_thrust(vehicle),
    ):
        pass
    assert not fake.commands
    fake.close()


def test_failed_disarming_restores_parameters(fake: FakeVehicle) -> None:
    vehicle = VehicleClient(fake.ground_end)
    vehicle.connect()
    fake.answers[MavCmd.COMPONENT_ARM_DISARM] = [ACCEPTED, DENIED]
    fake.after[MavCmd.COMPONENT_ARM_DISARM] = lambda: fake.heartbeat(armed=True)
    with pytest.raises(VehicleClientError, match="disarm"), bench.armed_without_thrust(vehicle):
        assert fake.table.values["FS_TIME_S"] == 0.0
    assert fake.table.values["FS_TIME_S"] == 7.0


def test_parameter_that_is_not_restored_is_named(fake: FakeVehicle) -> None:
    vehicle, store = VehicleClient(fake.ground_end), fake.table.set
    vehicle.connect()

    def refuse_depth(name: str, value: float) -> float:
        if (name, value) == ("SID_DEPTH_MIN", 7.0):
            raise ValueError("refused")
        return store(name, value)

    fake.table.set = refuse_depth  # type: ignore[method-assign]
    with (
        pytest.raises(OperationError, match=r"; not restored: SID_DEPTH_MIN = 7: set them before"),
        bench.armed_without_thrust(vehicle),
    ):
        pass
    changed = [name for name in bench.PARAMETERS if fake.table.values[name] != 7.0]
    assert changed == ["SID_DEPTH_MIN"]


def test_bench_test_above_the_travel_leaves_no_folder(
    fake: FakeVehicle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The corrected command finds the name free."""
    fake.send_text("ready")
    monkeypatch.setattr(flight, "open_transport", lambda _: fake.ground_end)
    with pytest.raises(InputError, match="--amplitude 100: this duct's travel is 30 deg"):
        run("bench-test", "--connect", "memory:fake", "--amplitude", "100", "--out", tmp_path / "b")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", ["bench-test", "inclining-test"])
def test_bench_test_is_of_the_named_vehicle(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without --vehicle-id it moved the duct of the first vehicle on the link."""
    systems = list[int | None]()

    def opened(*_: object, system: int | None, **__: object) -> None:
        systems.append(system)
        raise OperationError("opened")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(flight, "open_recorded_vehicle", opened)
    with pytest.raises(OperationError, match="opened"):
        run(command, "--connect", "memory:fake", "--vehicle-id", "7")
    assert systems == [7]


@pytest.mark.parametrize("command", ["bench-test", "inclining-test"])
def test_long_wait_for_the_sensors_is_reported(
    command: str, fake: FakeVehicle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(flight, "open_transport", lambda _: fake.ground_end)
    monkeypatch.setattr(client, "WAIT_NOTICE_S", 0.05)
    monkeypatch.setattr(client, "READY_TIMEOUT_S", 0.2)
    fake.answers[MavCmd.COMPONENT_ARM_DISARM] = [DENIED]
    fake.after[MavCmd.DO_SET_MODE] = lambda: fake.heartbeat(status=1)  # MAV_STATE_BOOT
    done = CliRunner().invoke(app, [command, "--connect", "memory:fake"])
    assert isinstance(done.exception, VehicleClientError)
    assert "denied" in str(done.exception)
    assert "waiting up to 0.2 s for the vehicle to read its sensors\n" in done.stderr


def test_inclining_test_parameters_alone_are_no_log(
    fake: FakeVehicle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As with a wrong --speed: the simulator ends after the parameters were received."""
    monkeypatch.setattr(flight, "open_transport", lambda _: fake.ground_end)
    log = tmp_path / "incline.mcap"
    with flight.open_recorded_vehicle("memory:fake", log) as (vehicle, _):
        vehicle.connect()
        vehicle.parameters()
    assert not log.exists()


@pytest.mark.parametrize(
    ("option", "prior"),
    [
        ("--vehicle=remus100", "remus100"),
        ("--vehicle=caribou_truth", "caribou_nominal"),
        ("--connect=memory:fake", "caribou_nominal"),
    ],
)
def test_inclining_test_takes_the_mass_of_the_simulated_vehicle(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, option: str, prior: str
) -> None:
    priors = list[str]()

    def measure(session: incline.IncliningSession, *_: object, **__: object) -> None:
        priors.append(session.prior)
        raise OperationError("measured")

    monkeypatch.setattr(incline, "measure", measure)
    monkeypatch.setattr(processes, "SimulatedVehicle", lambda _, **__: "memory:simulated")
    with pytest.raises(OperationError, match="measured"):
        run("inclining-test", option, "--log", tmp_path / "incline.mcap")
    assert priors == [prior]


@pytest.mark.parametrize(
    ("session", "reason"),
    [
        ({"axes": ("keel",)}, "--axis keel: expected rudder or elevator"),
        ({"amplitudes_deg": (0.0,)}, "--amplitude 0: expected degrees peak to peak, above 0"),
        ({"frequencies_hz": (0.1, 9.0)}, "--frequency 9: expected 0.005 to 4 Hz"),
        ({"frequencies_hz": (0.1, 0.1)}, "--frequency: expected at least two"),
    ],
)
def test_check_impossible_sweep_refused(
    tmp_path: Path, session: dict[str, Any], reason: str
) -> None:
    with pytest.raises(InputError, match=reason):
        bench.check(bench.Session(tmp_path, **session))


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("duration_s = 5.0\nmove = []", "duration_s = 5: expected 10 to 600"),
        ("duration_s = 60.0\n[[move]]\nmas_kg = 1.0", "mas_kg = 1.0: unknown key"),
        ("duration_s =", "Invalid value"),
        ("duration_s = 60.0\n[[move]]\nmass_kg = nan", "mass_kg = nan: expected a finite number"),
        ("duration_s = 60.0\nmove = []", "at least three"),
    ],
)
def test_load_invalid_moves_refused(tmp_path: Path, text: str, reason: str) -> None:
    file = tmp_path / "moves.toml"
    file.write_text(text)
    with pytest.raises(InputError, match=reason):
        incline.load(file)


def test_shipped_moves_equal_shipped_scenario() -> None:
    """The inclining test's simulated weights equal those that ground assumes."""
    from sitl import scenario

    plan = incline.load(None)
    done = {(fault.from_us, fault.until_us): fault for fault in scenario.load("inclining").faults}
    for move in plan.dated():
        fault = done.pop((round(move.from_s * 1e6), round(move.until_s * 1e6)), None)
        mass_kg, _, y_m, _ = fault.sizes if fault else (0.0,) * 4
        assert mass_kg * y_m == pytest.approx(move.moment_kgm)
    assert not done


def test_lag_that_the_sines_do_not_show_is_undetermined() -> None:
    """A duct without lag was given 60 +- 69 rad/s; its backlash is known to be zero."""
    model = {
        "natural_frequency_radps": {"value": 60.0, "sd": 69.0},
        "damping_ratio": {"value": 0.7, "sd": 0.3},
        "rate_degps": {"value": 64.0, "sd": None},
        "backlash_deg": {"value": 0.01, "sd": 0.02},
    }
    text = bench.format_text({"rudder": {"model": model, "limits": []}}, Path("bench"))
    assert "60.0000 +- 69.0000         3.000  undetermined" in text
    assert "  undetermined: natural_frequency_radps; repeat with larger --amplitude" in text
    assert text.count("undetermined") == 2


def test_rate_limit_that_is_not_shown_gives_no_frequencies() -> None:
    limit: dict[str, Any] = {"amplitude_deg": 4.0, "half_power_hz": None, "paper_hz": None}
    limit |= {name: {"value": 8.0, "sd": None} for name in ("triangle_hz", "sine_hz")}
    texts = []
    for sd in (None, 0.5):
        axis = {"model": {"rate_degps": {"value": 64.0, "sd": sd}}, "limits": [limit]}
        texts.append(bench.format_text({"rudder": axis}, Path("bench")))
    assert "rate limit: not shown by the data" in texts[0]
    assert "triangle" not in texts[0]
    assert "4.0 deg peak to peak     8.000" in texts[1]
