"""The vehicle and its autopilot without sockets: the two pure functions called in turn."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from autopilot.control import core, modes, params, request_handler, requests
from autopilot.control.lqg import LqgControllers
from autopilot.control.types import Event, Inputs, Trace
from mavlink_io.frames import euler_from_quaternion
from mavlink_io.mission_items import MissionItem
from sitl import scenario
from sitl.core import plant
from sitl.scenario import Scenario
from sitl.vehicle import config as vehicles
from sitl.vehicle.config import VehicleConfig

COLUMNS = (
    "t_s",
    "true_roll",
    "true_pitch",
    "true_heading",
    "true_depth_m",
    "heading",
    "pitch",
    "roll",
    "depth_m",
    "rudder",
    "elevator",
    "true_rudder",
    "surge_mps",
    "north_m",
    "east_m",
    "p_radps",
    "q_radps",
    "r_radps",
    "depth_rate_mps",
    "thrust",
    "surface_m",
)


class Dive:
    """One mission from arming to disarming; the history as columns by name."""

    def __init__(
        self,
        items: tuple[MissionItem, ...],
        *,
        vehicle: str | VehicleConfig = "caribou_truth",
        sea: str | Scenario = "calm",
        seed: int = 1,
        values: Mapping[str, float] | None = None,
        controllers: LqgControllers | None = None,
        limit_s: float = 900.0,
    ) -> None:
        self.config = replace(params.config(values or {}), lqg_controllers=controllers)
        self._plant = plant.build(
            vehicles.load(vehicle) if isinstance(vehicle, str) else vehicle,
            scenario.load(sea) if isinstance(sea, str) else sea,
        )
        self._rng = plant.random_streams(seed)
        self.body, reading = plant.initial_state(self._plant, self._rng)
        self.state = core.initial_state()
        self.told: list[tuple[float, str]] = []
        """Return the vehicle times, in s, at which a text was sent."""
        self.surfacing_s = np.inf
        """Vehicle time, in s, at which the vehicle entered SURFACE; infinite before that."""
        self._rows: list[tuple[float, ...]] = []
        frame = self._tick(reading)
        for request in (
            requests.LoadMission(items),
            requests.SetMode(modes.MISSION.number),
            requests.Arm(),
        ):
            self.state, answer, _ = request_handler.handle_request(self.state, request, self.config)
            assert answer.result == 0, answer.text
        while self.state.armed and self.state.time_us < limit_s * 1e6:
            self.body, reading = plant.step(self._plant, self.body, frame, self._rng)
            frame = self._tick(reading)
        self.history = np.array(self._rows)

    def __getitem__(self, column: str) -> NDArray[np.float64]:
        return self.history[:, COLUMNS.index(column)]

    def during(self, start_s: float, end_s: float) -> NDArray[np.bool_]:
        return (self["t_s"] >= start_s) & (self["t_s"] < end_s)

    def texts(self) -> list[str]:
        return [text for _, text in self.told]

    def _tick(self, reading: Any) -> Any:
        devices = reading.dvl, reading.battery, reading.leak, reading.duct
        inputs = Inputs(reading.frame, reading.gps, reading.altimeter, None, None, *devices)
        self.state, frame, trace, events = core.tick(self.state, inputs, self.config)
        self.told += [
            (self.state.time_us / 1e6, event.text) for event in events if isinstance(event, Event)
        ]
        if self.state.mode == modes.SURFACE.number:
            self.surfacing_s = min(self.surfacing_s, self.state.time_us / 1e6)
        self._keep(trace)
        return frame

    def _keep(self, trace: Trace) -> None:
        truth, estimate = self.body.truth, self.state.estimate
        self._rows.append(
            (
                self.state.time_us / 1e6,
                *euler_from_quaternion(*truth.attitude_q),
                truth.position_ned_m[2],
                estimate.heading_rad,
                estimate.pitch_rad,
                estimate.roll_rad,
                estimate.depth_m,
                trace.rudder_rad,
                trace.elevator_rad,
                truth.rudder_rad,
                float(self.body.body[7]),
                truth.position_ned_m[0],
                truth.position_ned_m[1],
                estimate.p_radps,
                estimate.q_radps,
                estimate.r_radps,
                estimate.depth_rate_mps,
                trace.thrust,
                truth.surface_m,
            )
        )
