"""Public tests and logs: fits of a known plant, and reasons why a log holds no test."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lsim

from benchmarks.real_data import public_logs, ship_tests
from sysid.data.runs import Run
from tests.sysid.data.readers import files

UNSTABLE = ([-0.03, -0.0075], [1.0, 0.5, -0.01])
"""Numerator and denominator of a ship that is unstable on course; HSVA's rudder turns to port."""
SPEED_MPS = 1.18


def write_zigzag(path: Path, rudder_deg: float) -> None:
    """Write a zig-zag in HSVA's columns: the rudder is reversed at a heading of half its angle."""
    time_s, heading, rudder, rows = np.arange(0.0, 112.0, 0.05), 0.0, rudder_deg, []
    commands, state, step = [], np.zeros(2), 0.05
    (b1, b0), (_, a1, a0) = UNSTABLE
    for t in time_s:
        if heading * math.copysign(1.0, -rudder) > 0.5 * rudder_deg:
            rudder = -rudder
        commands.append(rudder)
        rate = state[1]
        rows.append([t, 0, 0, heading, SPEED_MPS, 0.0, rate, 0.0, rudder, 10.0, 40.0])
        heading += step * rate
        state = state + step * np.array(
            [-a0 * state[1] + b0 * rudder, state[0] - a1 * state[1] + b1 * rudder]
        )
    text = "\n".join(" ".join(f"{value:.9f}" for value in row) for row in rows)
    path.write_text("HSVA\nKVLCC2\nZigzag\nTime series\n" + text + "\n", encoding="latin-1")


@pytest.fixture(scope="module")
def tests_by_file(tmp_path_factory: pytest.TempPathFactory) -> list[list[Run]]:
    folder = tmp_path_factory.mktemp("hsva")
    for angle in (5, 10, 15, 20):
        write_zigzag(folder / f"HSVA_CPMC_KVLCC2_Z_{angle:02d}_05.dat", float(angle))
    return ship_tests.read_tests(folder, folder)


def test_models_of_an_unstable_ship_predict_held_out_tests(
    tests_by_file: list[list[Run]],
) -> None:
    """The plant is linear and without noise, so that a simulation must reproduce it.

    Filter error is left out: it estimates noise levels, which such a plant does not have.
    Tolerance: the plant is integrated by Euler steps of 0.05 s, and the delay is rounded to 0.1 s.
    """
    errors = ship_tests.compare(tests_by_file)
    by_name = {error.name: error for error in errors}
    for name in ("Nomoto, second order", "output error"):
        assert by_name[name].held_out < 1e-3, name
    rates = [np.degrees(run.rate_radps) for file in tests_by_file for run in file]
    assert max(float(np.std(rate)) for rate in rates) > 0.5


def test_simulated_response_equals_scipys() -> None:
    numbers = np.array([0.03, 0.0075, 0.5, 0.02, 0.0])
    model, rudder = ship_tests._second_order(numbers), np.full(200, 0.1)
    time_s = np.arange(200) * 0.1
    _, expected, _ = lsim(([0.03, 0.0075], [1.0, 0.5, 0.02]), rudder, time_s)
    state, rate = np.zeros(2), []
    for angle in rudder:
        rate.append(float(model.c @ state + model.d * angle))
        state = model.a @ state + model.b * angle
    np.testing.assert_allclose(rate, expected, atol=1e-9)


def test_log_of_the_dive_has_segments(tmp_path: Path) -> None:
    files.dataflash(tmp_path / "dive.BIN", sids=False)
    (finding,) = public_logs.examine(tmp_path)
    assert finding.segments > 0
    assert finding.result == f"{finding.segments} usable segments"


def test_log_of_a_thruster_frame_is_refused_by_name(tmp_path: Path) -> None:
    motors = {f"SERVO{n}_FUNCTION": 32.0 + n for n in range(1, 7)}
    (tmp_path / "logs").mkdir()
    files.dataflash(tmp_path / "logs" / "frame.bin", sids=False, parameters=motors)
    (finding,) = public_logs.examine(tmp_path)
    if not finding.segments:
        assert "6 outputs are motors of a thruster frame" in finding.result


def test_damaged_log_gives_its_error(tmp_path: Path) -> None:
    (tmp_path / "empty.ulg").write_bytes(b"")
    (finding,) = public_logs.examine(tmp_path)
    assert (finding.segments, finding.velocity) == (0, "")
    assert finding.result
