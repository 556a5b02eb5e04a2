"""The compiled closed loop: the same dives as tick by tick, and steps that are short enough."""

import math
import os
import subprocess
import sys
from typing import Any, cast

import numpy as np
import pytest

from autopilot.control import core, params, steady
from mavlink_io.jit_stored import StoredFunction
from mavlink_io.mission_items import MissionItem
from sitl.core import body, tailcone
from sitl.core.body import Body
from sitl.vehicle import dynamics as physics
from sitl.vehicle.water import STILL, Water
from sysid.models import greybox
from sysid.monte_carlo import closed_loop, dynamics, samples, simulate
from sysid.monte_carlo.simulate import Sea, SimulatedDive
from sysid.planes import Plane
from sysid.test_design.prior import DesignPrior
from tests.helpers.missions import leg
from tests.sysid.monte_carlo.conftest import HELD, LAND, mission, silent

SHAPED = {
    "DPT_REF_W": 0.5,
    "HDG_REF_W": 0.5,
    "PTCH_FF": 0.1,
    "TRIM_AUTO_S": 20.0,
    "ACT_LEAD_W": 6.0,
    "ACT_LEAD_Z": 0.2,
    "HDG_PEAK_W": 1.2,
    "HDG_PEAK_GAIN": 1.4,
    "PTCH_PEAK_W": 1.6,
    "PTCH_PEAK_GAIN": 1.3,
    "DPT_REF_LEAD": 3.0,
    "TRIM_PIT_DEG": -2.0,
    "GAIN_SPD_MPS": 1.3,
}
"""Everything that the loops can do beside PID."""
WEIGHTED = {"DPT_SPW": 0.5, "HDG_SPW": 0.5, "ROLL_COMP": 1.0}
CHIRP = MissionItem(5, 2, 31010, p1=12.0, p2=4.0, p3=0.05, p4=0.4, x=40, y=0, z=2.0)
PRBS = CHIRP._replace(p1=11.0, p3=3.0, p4=1.0, y=3)
LINE = MissionItem(5, 1, 16, x=600_000, y=200_000, z=4.0)
"""To a place 60 m north and 20 m east, 4 m deep."""


def numbered(*items: MissionItem) -> tuple[MissionItem, ...]:
    return tuple(item._replace(sequence=n) for n, item in enumerate(items))


SHORT = mission(3.0, 20.0, 10.0)
STEPS = leg(depth_m=4.0, heading_deg=30.0, duration_s=30.0)
MISSIONS = {
    "legs": mission(4.0, 30.0, 60.0),
    "tests": numbered(*STEPS, CHIRP, PRBS, LAND),
    "line": numbered(*STEPS[:-1], LINE, LAND),
}


def fly(
    known: DesignPrior, items: tuple[MissionItem, ...], values: dict[str, float]
) -> SimulatedDive:
    vehicle = known.vehicle(known.mean)
    config = params.config({**samples.trims_deg(vehicle), **HELD, **values})
    return simulate.fly(vehicle, known.noise, items, config, Sea(1.0, 0.2, 0.01), (4,))


PITCH_LIMITED = {"HDG_P": 5.0, "FS_PITCH_DEG": 15.0, "PTCH_LIM_DEG": 14.9}
"""The pitch overshoots its limit into the failsafe."""


@pytest.mark.parametrize("name", MISSIONS)
@pytest.mark.parametrize("values", [{}, SHAPED, WEIGHTED, PITCH_LIMITED])
def test_dive_is_the_same_as_tick_by_tick(
    known: DesignPrior, name: str, values: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    compiled = fly(known, MISSIONS[name], values)
    with monkeypatch.context() as patch:
        patch.setattr(steady, "task_of", lambda state, config: None)
        stepped = fly(known, MISSIONS[name], values)
    assert compiled.log.events == stepped.log.events
    assert compiled.failsafe == stepped.failsafe
    assert np.array_equal(compiled.true_depth_m, stepped.true_depth_m)
    for part in ("attitude", "actuators", "depth", "setpoints"):
        ours, theirs = vars(getattr(compiled.log, part)), vars(getattr(stepped.log, part))
        for column, values_of_column in ours.items():
            assert np.array_equal(values_of_column, theirs[column]), column


@pytest.mark.parametrize("name", MISSIONS)
def test_few_ticks_are_full_ones(
    known: DesignPrior, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    full_ticks: list[int] = []
    tick = core.tick

    def counted(*args: Any) -> Any:
        full_ticks.append(1)
        return tick(*args)

    monkeypatch.setattr(core, "tick", counted)
    dive = fly(known, MISSIONS[name], {})
    assert dive.finished
    assert len(full_ticks) < 0.03 * dive.seconds / 0.02


PLAIN = """
import math
import sys

import numpy as np

from sitl.vehicle import config
from sysid.test_design import prior
from tests.sysid.monte_carlo import test_closed_loop as this

known = prior.with_trim(prior.from_file(config.load("caribou_nominal")), 0.1, 0.01)
dive = this.fly(known, this.SHORT, this.SHAPED)
sys.stdout.buffer.write(dive.true_depth_m.tobytes() + dive.log.attitude.yaw_rad.tobytes())
"""


@pytest.mark.slow
def test_dive_without_numba_is_the_same() -> None:
    # The vehicle's computer runs the same file as plain Python. Machine code and Python round every
    # operation in the same way, and call the same library for sines and roots.
    flown = [
        subprocess.run(
            [sys.executable, "-c", PLAIN],
            env={**os.environ, "NUMBA_DISABLE_JIT": disabled},
            check=True,
            capture_output=True,
        ).stdout
        for disabled in ("0", "1")
    ]
    assert len(flown[0]) > 1000
    assert flown[0] == flown[1]


def test_all_missions_are_flown_by_one_compiled_loop(known: DesignPrior) -> None:
    # A number of another type, as a depth of 4 in place of 4.0, would compile the loop again.
    whole_numbers = numbered(
        *(item._replace(p1=item.p1 and round(item.p1)) for item in STEPS), LAND
    )
    for items in (*MISSIONS.values(), whole_numbers):
        fly(known, items, {})
    assert len(cast(StoredFunction, closed_loop.run).signatures) == 1


def travelled(known: DesignPrior, steps: int, refine: int = 1, seconds: float = 60.0) -> np.ndarray:
    """State after a weaving run in deep water with a number of steps per tick.

    The duct moves as in 5 ms substeps in every case; each is divided by ``refine``.
    """
    vehicle = known.vehicle(known.mean)
    vessel = Body(
        model=vehicle.model,
        rudder=greybox.discretise(vehicle.actuators[Plane.YAW], dynamics.SUBSTEP_S),
        elevator=greybox.discretise(vehicle.actuators[Plane.PITCH], dynamics.SUBSTEP_S),
    )
    state = physics.state_at_rest(-50.0)
    rudder, elevator = tailcone.at_rest(vessel.rudder), tailcone.at_rest(vessel.elevator)
    for k in range(round(seconds / 0.02)):
        angles = np.empty((2, dynamics.SUBSTEPS))
        swing = math.sin(0.02 * k)
        end = body.step_axes(vessel, rudder, elevator, 0.2 * swing, 0.05 * swing, angles)
        parts = angles.reshape(2, steps, -1).mean(axis=2).repeat(refine, axis=1)
        step_s = 0.02 / parts.shape[1]
        wrench = np.zeros(6)
        body.integrate(vessel, state, parts, step_s, end, 0.58, wrench, wrench, STILL)
    return state


def test_one_step_per_tick_converges_in_deep_water(known: DesignPrior) -> None:
    exact = travelled(known, steps=4, refine=8)
    four, one = travelled(known, steps=4), travelled(known, steps=1)
    error_of_four, error_of_one = np.abs(four - exact), np.abs(one - exact)
    assert error_of_four.max() < 1e-7
    # Position (m), and the others (unit quaternion, m/s, rad/s) after 78 m of weaving.
    assert error_of_one[:3].max() < 5e-4
    assert error_of_one[3:].max() < 2e-5


@pytest.mark.parametrize(
    ("height_m", "water", "clear"),
    [
        (-10.0, STILL, True),
        (-0.5, STILL, False),
        (-10.0, Water(ceiling_m=-9.0), False),
        (-10.0, Water(floor_m=-11.0), False),
        (-10.0, Water(floor_m=-30.0), True),
    ],
)
def test_one_step_per_tick_only_clear_of_boundaries(
    known: DesignPrior, height_m: float, water: Water, clear: bool
) -> None:
    vehicle = known.vehicle(known.mean)
    axis = greybox.discretise(vehicle.actuators[Plane.YAW], dynamics.SUBSTEP_S)
    vessel = Body(vehicle.model, axis, axis)
    assert body.is_clear(vessel, physics.state_at_rest(height_m), water) == clear


def test_fine_steps_hardly_change_a_dive(known: DesignPrior) -> None:
    vehicle, levels = known.vehicle(known.mean), {plane: silent() for plane in Plane}
    config = params.config({**samples.trims_deg(vehicle), **HELD})
    one, four = (
        simulate.fly(vehicle, levels, MISSIONS["legs"], config, Sea(0.0), (4,), fine_steps=fine)
        for fine in (False, True)
    )
    assert one.log.attitude.yaw_rad == pytest.approx(four.log.attitude.yaw_rad, abs=1e-3)
    assert one.true_depth_m == pytest.approx(four.true_depth_m, abs=1e-3)
    assert np.any(one.true_depth_m != four.true_depth_m)
