"""A stock MAVSDK program that executes commands from stdin and prints their results as JSON.

Usage: python -m tests.clients.client_process ADDRESS, then lines on stdin: see
``COMMANDS``.
"""

import asyncio
import json
import os
import sys
from collections.abc import Awaitable, Callable
from typing import Any

from mavsdk.exceptions import MavsdkError
from mavsdk.plugins.mission_raw import MissionItem

from tests.clients.telemetry_recorder import Client, connected

TIMEOUT_S = 40.0
POLL_S = 0.02
DELAY = 93


def mission(count: int, base: int) -> list[MissionItem]:
    """Items with delays (ms) that identify the mission and the position of the item."""
    return [
        MissionItem(n, 2, DELAY, int(n == 0), 1, (base + n) / 1000.0, -1, -1, 0, 0, 0, 0.0, 0)
        for n in range(count)
    ]


async def upload(c: Client, count: str, base: str) -> str:
    await c.missions.upload_mission(mission(int(count), int(base)))
    return "SUCCESS"


async def download(c: Client) -> list[int]:
    return [round(1000.0 * item.param1) for item in await c.missions.download_mission()]


async def read(c: Client, name: str) -> float:
    return float(await c.params.get_param_float(name))


async def write(c: Client, name: str, value: str) -> str:
    await c.params.set_param_float(name, float(value))
    return "SUCCESS"


async def count(c: Client) -> int:
    return len((await c.params.get_all_params()).float_params)


async def await_parameter(c: Client, name: str, value: str) -> bool:
    """Wait until a parameter that another client has set is reported."""
    while c.parameters.get(name) != float(value):
        await asyncio.sleep(POLL_S)
    return True


async def hold(c: Client) -> str:
    await c.action.hold()
    return "SUCCESS"


async def await_connection(c: Client, connection: str) -> bool:
    """Wait until MAVSDK reports the vehicle as ``connected`` or ``lost``."""
    while await c.system.is_connected() != (connection == "connected"):
        await asyncio.sleep(POLL_S)
    return True


COMMANDS: dict[str, Callable[..., Awaitable[Any]]] = {
    command.__name__: command
    for command in (upload, download, read, write, count, await_parameter, hold, await_connection)
}


async def serve(address: str) -> None:
    client = await connected(address)
    print(json.dumps({"result": "connected"}), flush=True)
    while line := await asyncio.to_thread(sys.stdin.readline):
        name, *words = line.split()
        try:
            answer = {"result": await asyncio.wait_for(COMMANDS[name](client, *words), TIMEOUT_S)}
        except MavsdkError as error:
            answer = {"result": error.result.name}
        except TimeoutError:
            answer = {"result": "no result in time"}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    asyncio.run(serve(sys.argv[1]))
    os._exit(0)  # MAVSDK's own threads need not be waited for
