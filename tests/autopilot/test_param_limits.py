"""Parameters at the ends of their ranges: every mode gives finite actuators."""

import math

import pytest

from autopilot.control import core, modes, request_handler, requests
from autopilot.control.params import (
    PARAMETERS,
    Config,
    ParamError,
    ParamInfo,
    ParamTable,
    config,
    validate,
)
from autopilot.control.setpoints import MotionTarget
from autopilot.control.types import AutopilotState, Inputs, Stick
from mavlink_io.mission_items import MissionItem
from mavlink_io.real32 import as_real32
from mavlink_io.records import Altimeter, Battery, DuctFeedback, Dvl, GpsFix, Leak
from tests.helpers.missions import leg, sensors

TICKS = 6
"""Number of ticks in each mode, enough for several steps of every loop and excitation."""
STEPS_US = (20_000, 200_000)
"""Tick of the simulator, and the longest step of the estimator (``core.MAX_STEP_S``)."""
FIX = GpsFix(0, 3, 41.5, -70.7, 0.0, 0.5, 0.1, 0.0, 9, 1.5, 2.0)
ITEMS = (
    *leg(depth_m=4.0, heading_deg=90.0, duration_s=0.1),
    MissionItem(4, 2, 178, p1=1.0, p2=1.0, p3=-1.0),
)
FULL_THRUST = MissionItem(5, 2, 178, p1=1.0, p2=-1.0, p3=100.0)


def ends(row: ParamInfo) -> list[float]:
    """Return minimum, maximum, and the smallest accepted value beside the minimum, as REAL32."""
    if row.integer:
        return [row.minimum, min(row.minimum + 1, row.maximum), row.maximum]
    above = math.nextafter(row.minimum, math.inf)
    smallest = row.smallest if row.minimum <= 0.0 else row.minimum
    return [row.minimum, as_real32(above) if above > 1e-30 else smallest, smallest, row.maximum]


def accepted_config(row: ParamInfo, value: float) -> Config:
    return config({"SYS_FAILURE_EN": 0.0, row.name: value})


def inputs(time_us: int, tick: int) -> Inputs:
    """Return inputs with a record of every sensor at ordinary values."""
    reading = sensors(
        time_us, roll=0.05, pitch=0.02 * tick, heading=0.1 * tick, depth_m=5.0 + 0.1 * tick
    )
    return Inputs(
        reading,
        FIX._replace(time_us=time_us) if tick % 3 == 0 else None,
        Altimeter(time_us, 12.0 + 0.1 * tick, 0.3, 30.0),
        0.5,
        stick=Stick(0.5, -0.5, 0.8),
        dvl=Dvl(time_us, 1.2, 0.1, 0.0, True, 0.02, 90),
        battery=Battery(30.0, 2.0, 1.0, 0.5),
        leak=Leak(wet=False),
        duct=DuctFeedback(time_us, 0.1, -0.1),
        attitude_silent_s=0.01,
        motion_silent_s=0.01,
    )


def fly(mode: modes.Mode, config: Config, step_us: int) -> AutopilotState:
    """Fly some ticks in a mode; assert that all actuators are finite and within range."""
    state = core.initial_state()
    tick = 0

    def step() -> None:
        nonlocal state, tick
        state, frame, _, _ = core.tick(state, inputs(tick * step_us, tick), config)
        tick += 1
        assert all(-1.0 <= control <= 1.0 for control in frame.controls), (mode.name, frame)

    def ask(request: requests.Request) -> None:
        nonlocal state
        state = request_handler.handle_request(state, request, config)[0]

    step()
    ask(requests.LoadMission((*ITEMS, FULL_THRUST)))
    ask(requests.SetTarget(MotionTarget(depth_m=6.0, velocity_mps=complex(1.0, 0.5))))
    ask(requests.Arm(force=True))
    ask(requests.SetMode(mode.number))
    for _ in range(TICKS):
        step()
    ask(requests.ChangeTarget(depth_m=8.0, heading_rad=-2.0, thrust=1.0))
    for _ in range(TICKS):
        step()
    ask(requests.Disarm(force=True))
    step()
    return state


@pytest.mark.parametrize("row", PARAMETERS, ids=lambda row: row.name)
def test_parameter_limits_give_finite_actuators_in_every_mode(row: ParamInfo) -> None:
    for value in dict.fromkeys(ends(row)):
        flown = accepted_config(row, value)
        for mode in modes.MODES:
            for step_us in STEPS_US:
                state = fly(mode, flown, step_us)
                numbers = (state.estimate.speed_mps, state.estimate.depth_m, state.estimate.north_m)
                assert all(map(math.isfinite, numbers)), (
                    row.name,
                    value,
                    mode.name,
                    step_us,
                    numbers,
                )


@pytest.mark.parametrize("row", PARAMETERS, ids=lambda row: row.name)
def test_parameter_limits_survive_real32_and_nan_is_refused(row: ParamInfo) -> None:
    table = ParamTable()
    for limit in (row.minimum, row.maximum):
        assert table.set(row.name, as_real32(limit)) == pytest.approx(limit, rel=1e-6)
    before = table.get(row.name)
    for nonsense in (math.nan, math.inf, -math.inf, 1e-40, -1e-40, 5e-324):
        if row.integer and abs(nonsense) < 1.0 and row.minimum <= 0:
            continue  # rounds to the whole number 0
        with pytest.raises(ParamError, match=row.name):
            table.set(row.name, nonsense)
    assert table.get(row.name) == before


def test_parameter_with_zero_as_off_names_both_ranges() -> None:
    with pytest.raises(ParamError) as error:
        validate("THR_CRUISE_PCT", 1e-40)
    assert str(error.value) == "THR_CRUISE_PCT = 1e-40: must be 0, or 1 to 100 %"
    with pytest.raises(ParamError) as error:
        validate("TRIM_RUD_DEG", 1e-40)
    assert str(error.value) == "TRIM_RUD_DEG = 1e-40: must be -15 to 15 deg, not a denormal number"


def test_fraction_of_an_integer_parameter_is_refused() -> None:
    table = ParamTable()
    with pytest.raises(ParamError, match=r"MAV_SYS_ID = 2\.5: must be a whole number, 1 to 255"):
        table.set("MAV_SYS_ID", 2.5)
    assert (table.get("MAV_SYS_ID"), table.revision) == (1.0, 0)
    assert table.set("MAV_SYS_ID", 2.0) == 2.0
