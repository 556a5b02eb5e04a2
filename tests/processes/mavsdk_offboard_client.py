"""A stock MAVSDK program that sends offboard setpoints; prints one JSON object.

It begins with the snippet of docs/navigation.md.

Usage: python mavsdk_offboard_client.py udpin://127.0.0.1:PORT
"""

import ast
import asyncio
import json
import os
import sys
from typing import Any

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.offboard import OffboardAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.plugins.offboard import Attitude, PositionNedYaw

from tests.helpers.docs_blocks import python_of

TIMEOUT_S = 30.0


async def until(stream: Any, condition: Any) -> Any:
    async def take() -> Any:
        async for value in stream:
            if condition(value):
                return value

    return await asyncio.wait_for(take(), TIMEOUT_S)


async def run_snippet(offboard: OffboardAsync) -> None:
    """Run the snippet of the page, which awaits outside of a function."""
    code = compile(
        python_of("navigation.md"), "navigation.md", "exec", ast.PyCF_ALLOW_TOP_LEVEL_AWAIT
    )
    await eval(code, {"offboard": offboard})


async def steer(address: str) -> dict[str, Any]:
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    await mavsdk.add_any_connection(address)
    system = await mavsdk.first_autopilot(timeout_s=TIMEOUT_S)
    action, offboard, telemetry = ActionAsync(system), OffboardAsync(system), TelemetryAsync(system)
    results: dict[str, Any] = {}
    await until(telemetry.subscribe_health_all_ok(), lambda healthy: healthy)
    await action.arm()
    await run_snippet(offboard)
    under_way = await until(
        telemetry.subscribe_position_velocity_ned(), lambda o: o.position.down_m > 1.0
    )
    results["depth_of_snippet_m"] = under_way.position.down_m
    await offboard.set_attitude(Attitude(0.0, -8.0, 40.0, 0.6))
    await offboard.start()
    results["mode"] = (
        await until(telemetry.subscribe_flight_mode(), lambda m: m.name == "OFFBOARD")
    ).name
    turned_attitude = await until(
        telemetry.subscribe_attitude_euler(), lambda a: abs(a.yaw_deg - 40.0) < 12.0
    )
    results["attitude"] = [turned_attitude.yaw_deg, turned_attitude.pitch_deg]
    dived = await until(telemetry.subscribe_position(), lambda p: p.relative_altitude_m < -2.0)
    results["altitude_m"] = dived.relative_altitude_m
    await offboard.set_position_ned(PositionNedYaw(60.0, 0.0, 3.0, 0.0))
    near = await until(
        telemetry.subscribe_position_velocity_ned(),
        lambda o: (
            abs(o.position.north_m - 60.0) + abs(o.position.east_m) < 12.0
            and abs(o.position.down_m - 3.0) < 0.5
        ),
    )
    results["position"] = [near.position.north_m, near.position.east_m, near.position.down_m]
    odometry = telemetry.subscribe_odometry()  # the Doppler log's own too: it knows no position
    odometry = await until(
        odometry, lambda o: next(iter(o.pose_covariance.covariance_matrix)) > 0.0
    )
    results["variance"] = next(iter(odometry.pose_covariance.covariance_matrix))
    await offboard.stop()
    results["after"] = (
        await until(telemetry.subscribe_flight_mode(), lambda m: m.name == "HOLD")
    ).name
    await action.return_to_launch()
    results["home"] = (
        await until(telemetry.subscribe_flight_mode(), lambda m: m.name == "RETURN_TO_LAUNCH")
    ).name
    results["disarmed"] = not await until(telemetry.subscribe_armed(), lambda armed: not armed)
    return results


if __name__ == "__main__":
    print(json.dumps(asyncio.run(steer(sys.argv[1]))), flush=True)
    os._exit(0)  # MAVSDK's own threads need not be waited for
