"""Without lockstep: load of the serial line, and the actuator watchdog of the tailcone."""

import pytest
from msgspec.structs import replace

from mavlink_io.endpoint import Endpoint
from mavlink_io.records import ActuatorFrame
from mavlink_io.transport import AddressError, Transport
from sitl import scenario
from sitl.backends import factory
from sitl.backends.factory import BackendError, BackendOptions
from sitl.backends.hil import HilClient
from sitl.backends.messages import CONTROLS
from sitl.backends.wall_clock import ACTUATOR_TIMEOUT_S, WallClock, Watchdog, timestep_for_line
from sitl.core import plant
from sitl.core.timestep import DEFAULT_TIMESTEP
from sitl.vehicle import config

AHEAD = ActuatorFrame(20_000, 0, (0.2, -0.1, 0.58, *(0.0,) * 13), 129)
REST = (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("baud", "rate_hz"), [(921_600, 50), (115_200, 50), (57_600, 25), (38_400, 10)]
)
def test_all_sensors_use_less_than_line_share(
    ends: tuple[Transport, Transport], baud: int, rate_hz: int
) -> None:
    steps = timestep_for_line(f"serial:/dev/ttyUSB0:{baud}")
    assert steps.tick_us * rate_hz == 1_000_000
    vehicle = config.load("caribou_truth")
    vehicle = replace(vehicle, instruments=replace(vehicle.instruments, encoder="as5048"))
    sea, rng = plant.build(vehicle, scenario.load("disturbed"), steps), plant.random_streams(1)
    state, said = plant.initial_state(sea, rng)
    link, sent = HilClient(ends[0]), 0
    for _ in range(20 * rate_hz):
        sent += len(link.datagram(said, None))
        state, said = plant.step(sea, state, AHEAD, rng)
    assert sent / 20.0 < 0.75 * baud / 10


def test_too_slow_line_error_names_lowest_baud_rate() -> None:
    with pytest.raises(
        AddressError, match=r"serial:/dev/ttyS0:19200.*too slow .*expected 38400 baud or more"
    ):
        timestep_for_line("serial:/dev/ttyS0:19200")


def test_link_without_baud_rate_has_default_timestep() -> None:
    assert timestep_for_line("udpout:127.0.0.1:14560") == DEFAULT_TIMESTEP


def test_watchdog_times_out_and_reports_once() -> None:
    said: list[str] = []
    dog = Watchdog(said.append, 100.0)
    assert dog.update(None, 130.0).controls[:3] == REST
    assert said == [], "no report before the first actuators"
    assert dog.update(AHEAD, 131.0) is AHEAD
    assert dog.update(None, 131.0 + 0.9 * ACTUATOR_TIMEOUT_S) is AHEAD
    for late_s in (1.1, 2.0, 3.0):
        assert dog.update(None, 131.0 + late_s * ACTUATOR_TIMEOUT_S).controls[:3] == REST
    assert dog.update(AHEAD, 135.0) is AHEAD
    assert said == [
        "actuators after 31.0 s",
        "no actuators for 1 s: duct straight, propeller stopped",
        "actuators after 4.0 s",
    ]


def test_newest_actuators_are_applied(ends: tuple[Transport, Transport]) -> None:
    backend = WallClock(ends[0], lambda: False)
    autopilot = Endpoint(ends[1], 1, 1)
    sea = plant.build(config.load("caribou_nominal"), scenario.load("calm"))
    rng = plant.random_streams(1)
    state, said = plant.initial_state(sea, rng)
    asked = backend.exchange(sea, state, said)
    assert asked is not None
    assert asked.controls[:3] == REST
    for thrust in (0.1, 0.2, 0.3):
        autopilot.send_values(
            CONTROLS, AHEAD._replace(time_us=7, controls=(0.0, 0.0, thrust, *(0.0,) * 13))
        )
    asked = backend.exchange(sea, state, said)
    assert asked is not None
    assert asked.controls[2] == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("asked", "complaint"),
    [
        (BackendOptions("px4", lockstep=False), "--no-lockstep: only with --autopilot caribou"),
        (
            BackendOptions(wait_for_arm=True, lockstep=False),
            "--wait-for-arm cannot be combined with --no-lockstep",
        ),
    ],
)
def test_no_lockstep_rejects_incompatible_options(asked: BackendOptions, complaint: str) -> None:
    with pytest.raises(BackendError, match=complaint):
        factory.check_options(asked)
