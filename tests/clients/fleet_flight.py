"""Fly several vehicles on one MAVSDK connection at once; print depth and result of each as JSON.

Usage: python -m tests.clients.fleet_flight ADDRESS COUNT
"""

import asyncio
import json
import os
import sys
import time
from typing import Any

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.plugins.mission_raw import MissionItem

TIMEOUT_S = 180.0
THRUST, DEPTH, DELAY = 178, 186, 93
FRAME_MISSION = 2


def mission(depth_m: float) -> list[MissionItem]:
    """Items: thrust 60 %, a depth, and a delay that outlasts the test."""
    rows = (
        (THRUST, 1.0, -1.0, 60.0, 0.0),
        (DEPTH, -depth_m, 3.0, 0.0, 0.0),
        (DELAY, 1e4, -1, -1, -1),
    )
    return [
        MissionItem(n, FRAME_MISSION, command, int(n == 0), 1, *map(float, p), 0, 0, 0.0, 0)
        for n, (command, *p) in enumerate(rows)
    ]


async def insist(attempt: Any) -> None:
    """Repeat a request until it succeeds: a vehicle that starts is not ready at once."""
    deadline_s = time.monotonic() + TIMEOUT_S
    while True:
        try:
            await attempt()
            return
        except Exception:
            if time.monotonic() > deadline_s:
                raise
            await asyncio.sleep(0.5)


async def fly(system: Any, depth_m: float) -> dict[str, Any]:
    """Fly one vehicle to a depth, and surface."""
    missions = MissionRawAsync(system)
    action = ActionAsync(system)
    telemetry = TelemetryAsync(system)
    await insist(lambda: missions.upload_mission(mission(depth_m)))
    await insist(action.arm)
    await insist(missions.start_mission)
    reached_m = 0.0
    async for position in telemetry.subscribe_position():
        reached_m = -position.relative_altitude_m
        if reached_m > 0.8 * depth_m:
            break
    await insist(action.land)
    async for mode in telemetry.subscribe_flight_mode():
        if mode.name == "LAND":
            break
    count = len(await missions.download_mission())
    return {"wanted_m": depth_m, "reached_m": reached_m, "items": count}


async def main(address: str, count: int) -> None:
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    await mavsdk.add_any_connection(address)
    deadline_s = time.monotonic() + TIMEOUT_S
    systems: dict[int, Any] = {}
    while len(systems) < count and time.monotonic() < deadline_s:
        for system in await mavsdk.get_systems():
            if await system.has_autopilot():
                systems[await system.get_system_id()] = system
        await asyncio.sleep(0.2)
    flights = [fly(system, 1.0 + number) for number, system in sorted(systems.items())]
    results = await asyncio.wait_for(asyncio.gather(*flights), TIMEOUT_S)
    print(json.dumps(dict(zip(sorted(systems), results, strict=True))), flush=True)


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], int(sys.argv[2])))
    os._exit(0)  # MAVSDK's own threads need not be waited for
