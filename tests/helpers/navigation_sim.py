"""The vehicle and its autopilot without sockets, with requests on the way, in any environment."""

from collections.abc import Mapping
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from autopilot.control import core, modes, params, request_handler, requests
from autopilot.control.types import ACCEPTED, Event, Inputs, Trace
from mavlink_io.frames import euler_from_quaternion, geodetic_to_offset
from mavlink_io.mission_items import MissionItem
from mavlink_io.tick import TICK_S
from sitl import scenario
from sitl.core import plant
from sitl.environment_schema import CurrentConfig, Variation
from sitl.vehicle import config as vehicles

TRIM = {"TRIM_RUD_DEG": 6.0, "TRIM_ELE_DEG": 0.4}
"""Trims of the field vehicle, whose duct is mounted at an angle."""
COLUMNS = (
    "t_s",
    "north_m",
    "east_m",
    "depth_m",
    "heading",
    "told_north_m",
    "told_east_m",
    "sd_m",
    "current_north_mps",
    "current_east_mps",
    "thrust",
    "speed_mps",
)


def water(
    name: str, north_mps: float = 0.0, east_mps: float = 0.0, rms_mps: float = 0.0
) -> scenario.Scenario:
    """Return a shipped scenario with a current."""
    speed = float(np.hypot(north_mps, east_mps))
    towards = float(np.degrees(np.arctan2(east_mps, north_mps)))
    current = CurrentConfig(
        speed_mps=speed,
        towards_deg=towards,
        variation=Variation(rms_mps=rms_mps, time_constant_s=120.0),
    )
    return msgspec.structs.replace(scenario.load(name), current=current)


class Voyage:
    """A vehicle that starts at the surface; its history is stored as columns by name, at 10 Hz."""

    def __init__(
        self,
        sea: scenario.Scenario,
        *,
        dvl: bool = True,
        seed: int = 1,
        values: Mapping[str, float] | None = None,
        depth_m: float | None = None,
    ) -> None:
        self.config = params.config({**TRIM, **(values or {})})
        vehicle = vehicles.load("caribou_truth")
        carried = msgspec.structs.replace(vehicle.instruments, dvl="a50" if dvl else "none")
        if depth_m is not None:
            sea = msgspec.structs.replace(
                sea, start=msgspec.structs.replace(sea.start, depth_m=depth_m)
            )
        self._plant = plant.build(msgspec.structs.replace(vehicle, instruments=carried), sea)
        self._rng = plant.random_streams(seed)
        self.body, reading = plant.initial_state(self._plant, self._rng)
        self.state, self.trace, self.events = core.initial_state(), Trace(), list[Any]()
        self.silences: dict[str, Any] = {}
        """Additional fields of ``Inputs``."""
        self._rows: list[tuple[float, ...]] = []
        self._frame = self._tick(reading)

    def ask(self, *requests_: requests.Request) -> None:
        """Requests to handle; each must be accepted."""
        for request in requests_:
            self.state, answer, events = request_handler.handle_request(
                self.state, request, self.config
            )
            self.events += events
            assert answer.result == ACCEPTED, (request, answer.text)

    def fly(self, *items: MissionItem) -> None:
        self.ask(
            requests.LoadMission(items), requests.SetMode(modes.MISSION.number), requests.Arm()
        )

    def sail(self, seconds: float, *, until_disarmed: bool = False) -> "Voyage":
        for _ in range(round(seconds / TICK_S)):
            self.body, reading = plant.step(self._plant, self.body, self._frame, self._rng)
            self._frame = self._tick(reading)
            if until_disarmed and not self.state.armed:
                break
        return self

    def __len__(self) -> int:
        return len(self._rows)

    def __getitem__(self, column: str) -> NDArray[np.float64]:
        return np.array(self._rows)[:, COLUMNS.index(column)]

    def error_m(self) -> NDArray[np.complex128]:
        """Return the estimated minus the true position, north + i east, in m."""
        return (self["told_north_m"] - self["north_m"]) + 1j * (
            self["told_east_m"] - self["east_m"]
        )

    def texts(self) -> list[str]:
        return [event.text for event in self.events if isinstance(event, Event)]

    def _tick(self, reading: Any) -> Any:
        devices = reading.dvl, reading.battery, reading.leak, reading.duct
        inputs = Inputs(reading.frame, reading.gps, reading.altimeter, None, None, *devices)
        if self.silences:
            inputs = inputs._replace(**self.silences)
        self.state, frame, self.trace, events = core.tick(self.state, inputs, self.config)
        self.events += events
        if self.state.time_us % 100_000 == 0:
            self._keep()
        return frame

    def _keep(self) -> None:
        """Positions relative to the scenario's origin, which is only near home."""
        truth = self.body.truth
        estimated = self.state.estimate
        home = self.state.home
        site = self._plant.sea
        north, east = 0.0, 0.0
        if home.known:
            north, east = geodetic_to_offset(
                home.lat_deg, home.lon_deg, site.latitude_deg, site.longitude_deg
            )
        drift = estimated.navigation.current_mps
        self._rows.append(
            (
                self.state.time_us / 1e6,
                *truth.position_ned_m,
                euler_from_quaternion(*truth.attitude_q)[2],
                estimated.north_m + north,
                estimated.east_m + east,
                estimated.position_sd_m,
                drift.real,
                drift.imag,
                self.trace.thrust,
                float(self.body.body[7]),
            )
        )
