"""A MAVSDK connection that the checks share: its plugins, and all messages of the autopilot."""

import asyncio
import json
import os
import termios
import time
from collections import defaultdict
from collections.abc import Callable
from typing import Any

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.ftp import FtpAsync
from mavsdk.asyncio.plugins.info import InfoAsync
from mavsdk.asyncio.plugins.log_files import LogFilesAsync
from mavsdk.asyncio.plugins.mavlink_direct import MavlinkDirectAsync
from mavsdk.asyncio.plugins.mission import MissionAsync
from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.plugins.mavlink_direct import MavlinkMessage

TIMEOUT_S = 15.0
RETRY_S = 1.0
"""Repeat a request on a lossy line, because MAVSDK does not."""
AUTOPILOT = 1
REQUEST_MESSAGE = 512
Fields = dict[str, Any]


async def first(
    stream: Any, condition: Callable[[Any], bool] = lambda value: True, within_s: float = TIMEOUT_S
) -> Any:
    """Return the first value of a subscription that meets a condition. Raises TimeoutError."""

    async def take() -> Any:
        async for value in stream:
            if condition(value):
                return value

    return await asyncio.wait_for(take(), within_s)


class Client:
    """The connection of one MAVSDK program to the vehicle."""

    def __init__(self, mavsdk: Any, system: Any, *, speed: float, slow: bool) -> None:
        self.mavsdk, self.system, self.speed, self.slow = mavsdk, system, speed, slow
        self.params = ParamAsync(system)
        self.telemetry = TelemetryAsync(system)
        self.action = ActionAsync(system)
        self.missions, self.plans = MissionRawAsync(system), MissionAsync(system)
        self.info, self.logs, self.ftp = InfoAsync(system), LogFilesAsync(system), FtpAsync(system)
        self._direct = MavlinkDirectAsync(system)
        self.began_s = time.monotonic()
        self.latest: dict[str, Fields] = {}
        self.times: dict[str, list[float]] = defaultdict(list)
        self.order: list[str] = []
        """Names of the received messages in order."""
        self.texts: list[str] = []
        self.parameters: dict[str, float] = {}
        """Values of parameters that the vehicle has sent on all links."""
        self._waiting: list[tuple[str, Callable[[Fields], bool], asyncio.Future[Fields]]] = []
        self.flight_mode, self.armed = "", False
        self.counted: dict[str, int] = {}
        self.counted_s = self.counted_vehicle_s = 0.0
        self._tasks = [
            asyncio.create_task(task)
            for task in (self._listen(), self._read(), self._follow_mode(), self._follow_arm())
        ]

    @property
    def vehicle_s(self) -> float:
        """Vehicle time of the last message with a time stamp, in s."""
        return float(self.latest["LOCAL_POSITION_NED"]["time_boot_ms"]) / 1e3

    @property
    def stretch(self) -> float:
        """Factor by which waits for vehicle time are longer than at real time."""
        return max(1.0, 1.0 / self.speed)

    async def _listen(self) -> None:
        async for message in self._direct.subscribe_message(""):
            if message.component_id == AUTOPILOT:
                self._on_message(message.message_name, json.loads(message.fields_json))

    async def _read(self) -> None:
        async for text in self.telemetry.subscribe_status_text():
            self.texts.append(text.text)

    async def _follow_mode(self) -> None:
        async for mode in self.telemetry.subscribe_flight_mode():
            self.flight_mode = mode.name

    async def _follow_arm(self) -> None:
        async for armed in self.telemetry.subscribe_armed():
            self.armed = armed

    def _on_message(self, name: str, fields: Fields) -> None:
        self.latest[name] = fields
        self.order.append(name)
        if name == "PARAM_VALUE":
            self.parameters[fields["param_id"]] = fields["param_value"]
        self.times[name].append(time.monotonic())
        for entry in [e for e in self._waiting if e[0] == name and e[1](fields)]:
            self._waiting.remove(entry)
            if not entry[2].done():
                entry[2].set_result(fields)

    async def next(
        self,
        name: str,
        condition: Callable[[Fields], bool] = lambda fields: True,
        within_s: float = TIMEOUT_S,
    ) -> Fields:
        """Return the next message of a name. Raises TimeoutError."""
        future: asyncio.Future[Fields] = asyncio.get_running_loop().create_future()
        entry = name, condition, future
        self._waiting.append(entry)
        try:
            return await asyncio.wait_for(future, within_s)
        except TimeoutError:
            raise TimeoutError(f"no such {name} within {within_s:g} s") from None
        finally:
            if entry in self._waiting:
                self._waiting.remove(entry)

    async def send(self, name: str, **fields: Any) -> None:
        await self._direct.send_message(
            MavlinkMessage(name, 0, 0, 1, AUTOPILOT, json.dumps(fields))
        )

    async def ask(
        self, answer: str, condition: Callable[[Fields], bool], name: str, **fields: Any
    ) -> Fields:
        """Send a message until its answer arrives; ignore further answers. Raises TimeoutError."""
        waiting, attempts = asyncio.create_task(self.next(answer, condition)), 0
        while not waiting.done():
            await self.send(name, **fields)
            attempts += 1
            await asyncio.wait([waiting], timeout=RETRY_S)
        if attempts > 1:
            await asyncio.sleep(RETRY_S)
        return await waiting

    async def request(
        self,
        number: int,
        name: str,
        parameter: float = 0.0,
        condition: Callable[[Fields], bool] = lambda fields: True,
    ) -> Fields:
        """Return a message that REQUEST_MESSAGE asks for; repeat the request until it arrives."""
        return await self.ask(
            name,
            condition,
            "COMMAND_LONG",
            target_system=1,
            target_component=AUTOPILOT,
            command=REQUEST_MESSAGE,
            confirmation=0,
            param1=number,
            param2=parameter,
            param3=0.0,
            param4=0.0,
            param5=0.0,
            param6=0.0,
            param7=0.0,
        )

    async def command(
        self, number: int, *parameters: float | None, component: int = AUTOPILOT
    ) -> int:
        """Return the MAV_RESULT of a COMMAND_LONG.

        None is sent as NaN, and a missing parameter as 0.
        """
        values = {
            f"param{n}": value
            for n, value in enumerate((*parameters, *(0.0,) * (7 - len(parameters))), 1)
        }
        return await self._result("COMMAND_LONG", number, component, confirmation=0, **values)

    async def command_int(
        self, number: int, *parameters: float, x: int = 0, y: int = 0, z: float = 0.0
    ) -> int:
        """Return the MAV_RESULT of a COMMAND_INT."""
        values = {
            f"param{n}": value
            for n, value in enumerate((*parameters, *(0.0,) * (4 - len(parameters))), 1)
        }
        place = {"frame": 2, "current": 0, "autocontinue": 0, "x": x, "y": y, "z": z}
        return await self._result("COMMAND_INT", number, AUTOPILOT, **place, **values)

    async def _result(self, name: str, number: int, component: int, **fields: Any) -> int:
        fields |= {"target_system": 1, "target_component": component, "command": number}
        return int(
            (await self.ask("COMMAND_ACK", lambda ack: ack["command"] == number, name, **fields))[
                "result"
            ]
        )

    async def becomes(self, *, mode: str = "", armed: bool | None = None) -> None:
        """Wait until MAVSDK reports a flight mode, or the vehicle as armed. Raises TimeoutError."""
        deadline_s = time.monotonic() + TIMEOUT_S
        while mode not in ("", self.flight_mode) or armed not in (None, self.armed):
            if time.monotonic() > deadline_s:
                raise TimeoutError(f"mode is {self.flight_mode}, armed is {self.armed}")
            await asyncio.sleep(0.02)


async def connected(address: str, *, speed: float = 1.0, slow: bool = False) -> Client:
    """Connect to the first autopilot at an address. Raises TimeoutError."""
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    await mavsdk.add_any_connection(address)
    system = await mavsdk.first_autopilot(timeout_s=2 * TIMEOUT_S)
    if system is None:
        raise TimeoutError(f"no autopilot on {address}")
    if address.startswith("serial://"):
        _wait_in_read(address.removeprefix("serial://").rsplit(":", 1)[0])
    return Client(mavsdk, system, speed=speed, slow=slow)


def _wait_in_read(device: str) -> None:
    """Let MAVSDK wait for the next byte of a serial line that it has opened.

    MAVSDK 4.1 opens a line with VMIN = 0. A read of the empty line then returns 0 bytes at once
    instead of "try again" (termios(3)), and MAVSDK repeats it without a pause: it used a whole
    core, which the tests of other processes need. Terminal attributes belong to the device, so
    that they can be changed through a second file descriptor.
    """
    line = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    attributes = termios.tcgetattr(line)
    attributes[6][termios.VMIN] = 1
    termios.tcsetattr(line, termios.TCSANOW, attributes)
    os.close(line)
