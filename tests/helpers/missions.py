"""A kinematic vehicle without hydrodynamics: its angular rates follow the surfaces at once."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from autopilot.control import core, modes, request_handler, requests
from autopilot.control.params import Config
from autopilot.control.types import (
    ACCEPTED,
    AutopilotState,
    Event,
    Inputs,
    ItemReached,
    Trace,
)
from mavlink_io.frames import STANDARD_GRAVITY_MPS2, quaternion_from_euler, rotate_back
from mavlink_io.mission_items import MissionItem
from mavlink_io.records import SENSORS_ALL, ActuatorFrame, Altimeter, SensorFrame

TICK_US = 20_000


def sensors(
    time_us: int,
    *,
    roll: float = 0.0,
    pitch: float = 0.0,
    heading: float = 0.0,
    depth_m: float = 5.0,
    rates: tuple[float, float, float] = (0.0, 0.0, 0.0),
    declination_deg: float = -14.4,
) -> SensorFrame:
    """Readings of nearly perfect sensors at an attitude and depth, without acceleration.

    The last digit flickers, because the autopilot detects constant readings as a fault.
    """
    dither = 1e-9 if time_us // TICK_US % 2 else -1e-9
    attitude = quaternion_from_euler(roll, pitch, heading)
    force = rotate_back(attitude, (0.0, 0.0, -STANDARD_GRAVITY_MPS2 + dither))
    rates = rates[0] + dither, rates[1], rates[2]
    declination = math.radians(declination_deg)
    field_ned = (0.2 * math.cos(declination), 0.2 * math.sin(declination), 0.48 + dither)
    pressure = dither + 1013.25 + 1025.0 * STANDARD_GRAVITY_MPS2 * depth_m / 100.0
    return SensorFrame(
        time_us,
        *force,
        *rates,
        *rotate_back(attitude, field_ned),
        pressure,
        0.0,
        0.0,
        10.0,
        SENSORS_ALL,
        0,
    )


@dataclass
class Flight:
    """Run ``core.tick`` with the kinematic vehicle and store the events."""

    config: Config = field(default_factory=Config)
    state: AutopilotState = field(default_factory=AutopilotState)
    heading: float = 0.0
    pitch: float = 0.0
    depth_m: float = 5.0
    speed_mps: float = 0.0
    altitude_m: float | None = None
    silent: int = 0
    """Bits of ``fields_updated`` of sensors that have no new reading."""
    more: dict[str, Any] = field(default_factory=dict)
    """Additional fields of ``Inputs``."""
    events: list[Event | ItemReached] = field(default_factory=list)
    trace: Trace = field(default_factory=Trace)
    frame: ActuatorFrame | None = None

    def ask(self, request: requests.Request) -> int:
        self.state, answer, events = request_handler.handle_request(
            self.state, request, self.config
        )
        self.events += events
        return answer.result

    def step(self) -> AutopilotState:
        time_us = self.state.time_us + TICK_US if self.state.time_us >= 0 else 0
        pitch_rate, yaw_rate = 0.5 * self.trace.elevator_rad, 0.5 * self.trace.rudder_rad
        self.pitch += pitch_rate * 0.02
        self.heading += yaw_rate * 0.02
        steady = 1.3 * self.trace.thrust / 0.58
        self.speed_mps += (steady**2 - self.speed_mps**2) / self.config.speed_length_m * 0.02
        before_m = self.depth_m
        self.depth_m -= self.speed_mps * math.sin(self.pitch) * 0.02
        if before_m >= 0.0:  # a test may set a depth above the water
            self.depth_m = max(0.0, self.depth_m)
        rates = (0.0, pitch_rate, yaw_rate)
        altimeter = (
            None if self.altitude_m is None else Altimeter(time_us, self.altitude_m, 0.3, 30.0)
        )
        reading = sensors(
            time_us, pitch=self.pitch, heading=self.heading, depth_m=self.depth_m, rates=rates
        )
        turning = reading._replace(
            accel_y_mps2=reading.accel_y_mps2 + yaw_rate * self.speed_mps,
            accel_z_mps2=reading.accel_z_mps2 - pitch_rate * self.speed_mps,
            fields_updated=reading.fields_updated & ~self.silent,
        )
        inputs = Inputs(turning, None, altimeter, None)._replace(**self.more)
        self.state, self.frame, self.trace, events = core.tick(self.state, inputs, self.config)
        self.events += events
        return self.state

    def run(self, seconds: float) -> Iterator[AutopilotState]:
        for _ in range(round(seconds * 50)):
            yield self.step()

    def run_until(self, condition: Callable[[AutopilotState], bool], limit_s: float) -> float:
        """Run until a condition holds and return the vehicle time, in s; fail after the limit."""
        start = self.state.time_us
        for state in self.run(limit_s):
            if condition(state):
                return (state.time_us - start) / 1e6
        raise AssertionError(f"not within {limit_s} s; said: {self.texts()}")

    def texts(self) -> list[str]:
        return [event.text for event in self.events if isinstance(event, Event)]


def under_way(mode: modes.Mode = modes.DEPTH, **changes: object) -> Flight:
    """Return a flight that is armed and in a mode, with changes of the configuration."""
    flight = Flight(config=Config(**changes))  # type: ignore[arg-type]
    flight.step()
    assert flight.ask(requests.SetMode(mode.number)) == ACCEPTED
    assert flight.ask(requests.Arm()) == ACCEPTED
    flight.step()
    return flight


def leg(
    *, depth_m: float, heading_deg: float, duration_s: float, first: int = 0
) -> tuple[MissionItem, ...]:
    """Return the items of a leg: speed, depth, heading and duration."""
    return (
        MissionItem(first, 2, 178, p1=1.0, p2=-1.0, p3=58.0),
        MissionItem(first + 1, 2, 186, p1=-depth_m, p2=3.0),
        MissionItem(first + 2, 2, 115, p1=heading_deg),
        MissionItem(first + 3, 2, 93, p1=duration_s),
    )


def excitation_item(
    sequence: int, *, axis: int, magnitude_deg: float, duration_s: int, wave: int = 1
) -> MissionItem:
    return MissionItem(sequence, 2, 31010, p1=axis, p2=magnitude_deg, x=duration_s, y=wave)
