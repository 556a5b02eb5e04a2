"""Plants from outside: independence, trim, true linear response, and logs that the readers accept.

Verifies: benchmarks.plants. Reference: the linear response behind the hold of the command, half a
tick. Tolerance: 0.1 dB; 0.1 deg in yaw, and 0.6 deg in pitch, where the vehicle leaves its trim
during the test.
"""

import ast
import math
from pathlib import Path

import numpy as np
import pytest

from benchmarks.campaigns import drawn as drawn_hulls
from benchmarks.identification import drawn_plants, outside, vehicles
from benchmarks.plants import catalogue, flight, logs, small_signal
from benchmarks.plants.actuators import Axis
from benchmarks.plants.flight import Gains
from benchmarks.plants.logs import TestScaling
from sitl.vehicle import config
from sysid.data import readers, segments
from sysid.planes import PLANES, Plane

PROJECT = ("mavlink_io", "autopilot", "sitl", "sysid", "ground", "tests")
NAMES = tuple(catalogue.SPECIFICATIONS)


def test_plants_import_no_package_of_the_project() -> None:
    for path in Path(catalogue.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):
                names = [node.module or ""]
            assert not [name for name in names if name.split(".")[0] in PROJECT], path.name


@pytest.mark.parametrize("name", NAMES)
def test_trimmed_plant_does_not_accelerate(name: str) -> None:
    plant = catalogue.plant(name, 1)
    slopes = small_signal.derivative(plant.trim.state, 0.0, plant.trim.elevator_rad, plant.body)
    assert np.max(np.abs(slopes)) < 1e-8


def test_calibration_gives_the_specified_turning_acceleration() -> None:
    found = [
        small_signal.numbers(plant.body, plant.trim, True).b1_per_s2
        for plant in (catalogue.plant("race", seed) for seed in range(1, 21))
    ]
    wanted = catalogue.SPECIFICATIONS["race"].b1_per_s2
    assert np.mean(np.log(found)) == pytest.approx(math.log(wanted), abs=0.07)  # 3 x 0.1 / sqrt(20)


def without_friction(axis: Axis) -> Axis:
    """Return the axis without play, steps, breakaway and dead zone."""
    return axis._replace(play_rad=0.0, step_rad=0.0, breakaway_rad=0.0, dead_rad=0.0)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_sine_test_shows_the_linear_response(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    case, plant = outside.case_of(name), catalogue.plant(name, 2)
    true = outside.truth(plant, case)
    plant = plant._replace(
        rudder=without_friction(plant.rudder),
        elevator=without_friction(plant.elevator),
        travel_rad=1.0,
    )
    monkeypatch.setattr(flight, "sensor_errors", lambda ticks, *_: np.zeros((ticks, 8)))
    for plane in Plane:
        omega, yaw = true.crossover_radps[plane], PLANES[plane].is_yaw
        period = round(2.0 * math.pi / omega / flight.TICK_S)
        time_s = flight.TICK_S * np.arange(12 * period)
        signal = math.radians(0.3) * case.scale(plane) * np.sin(omega * time_s)
        recorded = flight.dive(
            plant,
            [flight.Test(yaw, 60.0, signal)],
            61.0 + float(time_s[-1]),
            Gains(*case.hold),
            np.random.default_rng(0),
            0.0,
        )
        first = round(60.0 / flight.TICK_S) + 6 * period
        rows = recorded.rows[first : first + 5 * period]
        t = flight.TICK_S * np.arange(len(rows))
        basis = np.column_stack([np.cos(omega * t), np.sin(omega * t), np.ones(t.size), t, t**2])
        rate, command = (
            fit[0] - 1j * fit[1]
            for fit in (
                np.linalg.lstsq(basis, rows[:, column], rcond=None)[0]
                for column in ((2, 7) if yaw else (1, 8))
            )
        )
        hold = np.exp(-0.5j * omega * flight.TICK_S)
        ratio = rate / command / (hold * true.response[plane])
        assert abs(20.0 * math.log10(abs(ratio))) < 0.1
        assert abs(math.degrees(np.angle(ratio))) < (0.1 if yaw else 0.6)


def test_log_of_a_plant_holds_its_tests(tmp_path: Path) -> None:
    case, plant = outside.case_of("vortex"), catalogue.plant("vortex", 1)
    rng = np.random.default_rng(1)
    gains = Gains(*case.hold)
    recorded = logs.fly(plant, "sweeps", True, scaling=TestScaling(0.2, 0.2), gains=gains, rng=rng)
    path = tmp_path / "rudder_sweeps.csv"
    logs.write_csv(path, plant, recorded, gains, rng)
    log = readers.read(path)
    runs = segments.cut_runs(log)
    assert [round(float(run.time_s[-1])) for run in runs] == [28, 28, 24, 24]
    assert {run.plane for run in runs} == {Plane.YAW}
    assert log.parameters["ACT_TRAVEL_DEG"] == pytest.approx(15.0)


@pytest.mark.parametrize("kind", catalogue.SPECIFICATIONS)
def test_drawn_plant_differs_from_its_file_as_specified(kind: str, tmp_path: Path) -> None:
    """The linearised plant has the drawn numbers, and the file another servo than the plant."""
    path = tmp_path / "vehicle.toml"
    path.write_text(drawn_hulls.text(7, is_tailcone_known=False), encoding="utf-8")
    file = config.load(str(path))
    nominal = vehicles.nominal(file)
    spec = drawn_plants.specification(catalogue.SPECIFICATIONS[kind].kind, 7, file, nominal)
    plant = catalogue.assemble(kind, spec)
    small = small_signal.numbers(plant.body, plant.trim, yaw=True)
    assert small.b1_per_s2 == pytest.approx(spec.b1_per_s2, rel=1e-3)
    assert sorted((small.p_fast_per_s, small.p_slow_per_s)) == pytest.approx(
        sorted(np.linalg.eigvals(np.array(spec.yaw)).real), rel=1e-2
    )
    assert file.tailcone.lag_relative_sd == 0.3
    assert plant.rudder.omega_radps != file.tailcone.natural_frequency_radps
    again = drawn_plants.specification(catalogue.SPECIFICATIONS[kind].kind, 7, file, nominal)
    assert again == spec
