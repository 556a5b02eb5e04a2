"""What a stock MAVSDK program sees of the vehicle: prints one JSON object. Run as a program of its own.

Usage: python mavsdk_client.py udpin://127.0.0.1:PORT
"""

import asyncio
import json
import os
import sys
from typing import Any

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.info import InfoAsync
from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.plugins.mission_raw import MissionItem

PATIENCE_S = 15.0


def leg() -> list[MissionItem]:
    """Thrust, depth, heading and ten seconds, as raw items."""
    rows = [(178, 1.0, -1.0, 58.0), (186, -3.0, 3.0, 0.0), (115, 40.0, 0.0, 0.0), (93, 10.0, -1.0, -1.0)]
    return [
        MissionItem(n, 2, command, int(n == 0), 1, p1, p2, p3, 0.0, 0, 0, 0.0, 0)
        for n, (command, p1, p2, p3) in enumerate(rows)
    ]


async def first(stream: Any) -> Any:
    async def take() -> Any:
        async for value in stream:
            return value

    return await asyncio.wait_for(take(), PATIENCE_S)


async def until(stream: Any, wanted: Any) -> Any:
    async def take() -> Any:
        async for value in stream:
            if wanted(value):
                return value

    return await asyncio.wait_for(take(), PATIENCE_S)


async def look(address: str) -> dict[str, Any]:
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    await mavsdk.add_any_connection(address)
    system = await mavsdk.first_autopilot(timeout_s=PATIENCE_S)
    if system is None:
        return {"discovered": False}
    seen: dict[str, Any] = {"discovered": True, "system_id": await system.get_system_id()}
    params, telemetry = ParamAsync(system), TelemetryAsync(system)
    missions, action, info = MissionRawAsync(system), ActionAsync(system), InfoAsync(system)

    seen["version"] = (await info.get_version()).flight_sw_major is not None
    every = await params.get_all_params()
    seen["parameters"] = {p.name: p.value for p in every.float_params}
    seen["integer_parameters"] = len(every.int_params)
    await params.set_param_float("HDG_P", 0.75)
    seen["set"] = await params.get_param_float("HDG_P")

    attitude = await first(telemetry.subscribe_attitude_euler())
    seen["attitude_deg"] = [attitude.roll_deg, attitude.pitch_deg, attitude.yaw_deg]
    position = await first(telemetry.subscribe_position())
    seen["altitude_m"] = position.relative_altitude_m
    outputs = await first(telemetry.subscribe_actuator_output_status())
    seen["actuators"] = len(list(outputs.actuator))
    seen["healthy"] = await until(telemetry.subscribe_health_all_ok(), lambda healthy: healthy)

    await missions.upload_mission(leg())
    fetched = await missions.download_mission()
    seen["mission"] = [[i.command, i.param1, i.param2, i.param3] for i in fetched]
    await missions.start_mission()
    seen["mode"] = (await until(telemetry.subscribe_flight_mode(), lambda m: m.name == "MISSION")).name
    await action.arm()
    seen["armed"] = await until(telemetry.subscribe_armed(), lambda armed: armed)
    progress = await until(missions.subscribe_mission_progress(), lambda p: p.current >= 3)
    seen["progress"] = [progress.current, progress.total]
    await action.hold()
    seen["mode_after"] = (await until(telemetry.subscribe_flight_mode(), lambda m: m.name == "HOLD")).name
    await action.kill()
    seen["disarmed"] = not await until(telemetry.subscribe_armed(), lambda armed: not armed)
    return seen


if __name__ == "__main__":
    print(json.dumps(asyncio.run(look(sys.argv[1]))), flush=True)
    os._exit(0)  # MAVSDK's own threads need not be waited for
