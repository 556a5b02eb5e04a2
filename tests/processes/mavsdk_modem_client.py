"""Fly a vehicle behind a modem with MAVSDK: parameter, arm, go there, surface.

Usage: python -m tests.processes.mavsdk_modem_client ADDRESS TIMEOUT_S

It prints wall time and results of each call as one JSON object. A modem carries no heartbeats, so
MAVSDK never counts the system as connected, and sends nothing of its own. Its timeout is that of
one attempt; a command has four.
"""

import asyncio
import ctypes
import json
import os
import sys
import time
from collections.abc import Awaitable, Callable
from typing import Any

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.exceptions import MavsdkError

PLACE = (42.3505, -71.0, -2.0)
"""Latitude and longitude (deg) 55 m north of the start, and minus the depth (m)."""
ROUNDS = 5
"""Calls of one method before it counts as failed."""


def set_timeout(client: Any, timeout_s: float) -> None:
    """Set the time until MAVSDK repeats a request; MAVSDK 4.1 has no method for it in Python."""
    raw = client._mavsdk
    raw._lib.mavsdk_set_timeout_s(ctypes.c_void_p(raw._handle), ctypes.c_double(timeout_s))


async def insist(method: Callable[..., Awaitable[Any]], *arguments: Any) -> dict[str, Any]:
    """Call a method until it succeeds; return its wall time (s), number of calls and results."""
    start_s, results = time.monotonic(), []
    for _ in range(ROUNDS):
        try:
            await method(*arguments)
            results.append("SUCCESS")
            break
        except MavsdkError as error:
            results.append(error.result.name)
    return {"s": round(time.monotonic() - start_s), "results": results}


async def main(address: str, timeout_s: float) -> None:
    client = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    set_timeout(client, timeout_s)
    await client.add_any_connection(address)
    start_s = time.monotonic()
    while not (systems := await client.get_systems()):
        await asyncio.sleep(0.1)
    (system,) = systems
    done: dict[str, Any] = {"found": {"s": round(time.monotonic() - start_s), "results": []}}
    action, parameters = ActionAsync(system), ParamAsync(system)
    for method, *arguments in (
        (parameters.set_param_float, "FS_GCS_TIMEOUT", 0.0),
        (action.arm,),
        (action.goto_location, *PLACE, 0.0),
        (action.land,),
    ):
        done[method.__name__] = await insist(method, *arguments)
    print(json.dumps(done), flush=True)


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], float(sys.argv[2])))
    os._exit(0)  # MAVSDK's own threads need not be waited for
