"""The C program that the run time of a step is compared with: same states as the Python model."""

import ctypes
import shutil
from pathlib import Path

import numpy as np
import pytest

from benchmarks.speed import physics
from mavlink_io.errors import OperationError
from sitl.vehicle import dynamics
from sitl.vehicle.water import STILL, Water

NEEDS_COMPILER = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
STEPS = 100


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return physics.compiled(("-O2",), tmp_path_factory.mktemp("physics"))


@NEEDS_COMPILER
@pytest.mark.parametrize(
    ("water", "z_up_m"), [(STILL, physics.DEEP_M), (physics.SHALLOW, -0.4)], ids=["deep", "shallow"]
)
@pytest.mark.parametrize("uncoupled", physics.UNCOUPLED)
@pytest.mark.parametrize("vehicle", physics.VEHICLES)
def test_c_gives_the_states_of_the_model(
    library: Path, vehicle: str, uncoupled: float, water: Water, z_up_m: float
) -> None:
    model = physics.model_of(vehicle, uncoupled)
    state, work = physics.start(z_up_m), dynamics.work_array()
    for _ in range(STEPS):
        dynamics.rk4_step(
            state,
            physics.RUDDER_RAD,
            physics.ELEVATOR_RAD,
            0.58 * model.propeller.full_rps,
            np.zeros(6),
            water,
            physics.STEP_S,
            model,
            work,
        )
    in_c = physics.in_c(library, model, water, z_up_m)(STEPS)
    assert state == pytest.approx(in_c, rel=0.0, abs=physics.SAME)
    assert np.abs(state - physics.start(z_up_m)).max() > 0.1


@NEEDS_COMPILER
def test_library_of_another_model_is_refused(
    library: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A number added to the model made the C program read beyond its structures."""
    monkeypatch.setattr(physics, "mirrored", lambda _: ctypes.c_double(0.0))
    with pytest.raises(OperationError, match=r"structures of physics\.c"):
        physics.in_c(library, physics.model_of("remus100"), STILL, physics.DEEP_M)
