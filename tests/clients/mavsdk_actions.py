"""Check the results of MAVSDK's plugin `action`, method by method; print one JSON object.

Usage: python -m tests.clients.mavsdk_actions ADDRESS

The vehicle must be moored and disarmed. `CALLS` has every method of MAVSDK 4.1 in the order of the
calls, with the state that it needs before and the result that is expected.
"""

import asyncio
import contextlib
import json
import math
import os
import sys
from collections.abc import Awaitable, Callable
from typing import Any, NamedTuple

from mavsdk.exceptions import MavsdkError
from mavsdk.plugins.action.action import OrbitYawBehavior, RelayCommand

from tests.clients.telemetry_recorder import Client, connected

LATITUDE_DEG, LONGITUDE_DEG, DEPTH_AS_ALTITUDE_M = 42.35, -71.05, -3.0
PLACE = (LATITUDE_DEG, LONGITUDE_DEG, DEPTH_AS_ALTITUDE_M)
HOLD, MANUAL = (4, 3), (1 << 16, 0)
"""Main and sub number of the modes in DO_SET_MODE."""
DO_SET_MODE = 176
STATION = "POSCTL"
"""MAVSDK's name of mode STATION."""
TEXT_S = 5.0
WORKS, UNSUPPORTED = ("SUCCESS",), ("UNSUPPORTED",)
NO_TRANSITION = ("NO_VTOL_TRANSITION_SUPPORT", "VTOL_TRANSITION_SUPPORT_UNKNOWN")
"""Time until MAVSDK has received the first EXTENDED_SYS_STATE, in s."""


class Call(NamedTuple):
    """One method with its arguments and expected results."""

    method: str
    arguments: tuple[Any, ...] = ()
    results: tuple[str, ...] = WORKS
    """Accepted results."""
    armed_in: tuple[int, int] | None = None
    """Mode in which the vehicle is armed before the call; None for a disarmed start."""
    mode: str | None = None
    """Flight mode that MAVSDK reports afterwards."""
    armed: bool | None = None
    """Whether the vehicle is armed afterwards; None if the call does not decide it."""
    reason: str = ""
    """Beginning of the text with which the vehicle refuses; "" if it receives no command."""


CALLS = (
    Call("hold", mode="HOLD"),
    Call("return_to_launch", mode="RETURN_TO_LAUNCH"),
    Call("land", mode="LAND"),
    Call("arm", armed=True),
    Call("disarm", armed_in=HOLD, armed=False),
    Call("kill", armed_in=HOLD, armed=False),
    Call("set_actuator", (1, 0.1), armed_in=MANUAL),
    Call("set_current_speed", (1.2,), armed_in=HOLD),
    Call("set_home", (False, LATITUDE_DEG, LONGITUDE_DEG, 0.0)),
    Call("set_gps_global_origin", (LATITUDE_DEG, LONGITUDE_DEG, 0.0)),
    # MAVSDK 4.1 sends COMPONENT_ARM_DISARM with param1 = 0 (disarm) and param2 = 21196 (force)
    Call("arm_force", armed_in=HOLD, armed=False),
    # MAVSDK answers these two itself
    Call("get_takeoff_altitude"),
    Call("set_takeoff_altitude", (1.0,)),
    Call("get_return_to_launch_altitude", results=UNSUPPORTED),
    Call("set_return_to_launch_altitude", (1.0,), UNSUPPORTED),
    Call("takeoff", results=UNSUPPORTED, reason="Takeoff refused"),
    Call("goto_location", (*PLACE, 0.0), armed_in=HOLD, mode=STATION),
    Call("goto_location_fixedwing", (*PLACE, 60.0), armed_in=HOLD, mode=STATION),
    Call(
        "do_orbit",
        (30.0, 1.0, OrbitYawBehavior.HOLD_FRONT_TO_CIRCLE_CENTER, *PLACE),
        armed_in=HOLD,
        mode=STATION,
    ),
    Call("set_relay", (1, RelayCommand.ON), UNSUPPORTED, reason="Relay refused"),
    Call("transition_to_fixedwing", results=NO_TRANSITION),
    Call("transition_to_multicopter", results=NO_TRANSITION),
    Call("terminate", results=UNSUPPORTED, reason="Termination refused"),
    Call("shutdown", results=UNSUPPORTED, reason="Shutdown refused"),
    Call("reboot", mode="HOLD"),  # last: for a moment the vehicle has no sensors and cannot arm
)


async def result_of(awaitable: Awaitable[Any]) -> str:
    """Return the name of MAVSDK's result."""
    try:
        value = await awaitable
    except MavsdkError as error:
        return str(error.result.name)
    return "NOT A NUMBER" if isinstance(value, float) and not math.isfinite(value) else "SUCCESS"


async def prepare(client: Client, call: Call) -> None:
    if client.armed:
        await client.action.kill()
        await client.becomes(armed=False)
    if call.armed_in is not None:
        await client.command(DO_SET_MODE, 1, *call.armed_in)
        await client.action.arm()
        await client.becomes(armed=True)


async def carry_out(client: Client, call: Call) -> dict[str, str]:
    """Return the result of a call, its reason, and the difference from the expected ones."""
    await prepare(client, call)
    method: Callable[..., Awaitable[Any]] = getattr(client.action, call.method)
    before = len(client.texts)
    result, why = await result_of(method(*call.arguments)), ""
    reason = ""
    if call.reason:
        with contextlib.suppress(TimeoutError):  # the vehicle limits the rate of its texts
            reason = await asyncio.wait_for(text_after(client, before, call.reason), TEXT_S)
    try:
        if call.mode is not None:
            await client.becomes(mode=call.mode)
        if call.armed is not None:
            await client.becomes(armed=call.armed)
    except Exception as error:
        why = f"{type(error).__name__}: {error}"
    expected = " or ".join(call.results)
    why = why or ("" if result in call.results else f"not {expected}")
    return {"result": result, "reason": reason, "why": why}


async def text_after(client: Client, before: int, beginning: str) -> str:
    """Return the first new text with this beginning."""
    while True:
        for text in client.texts[before:]:
            if text.startswith(beginning):
                return text
        await asyncio.sleep(0.05)


def methods(client: Client) -> set[str]:
    """Return the methods of the plugin, without its destructor."""
    return {name for name in dir(client.action) if not name.startswith("_")} - {"destroy"}


async def main(address: str) -> None:
    client = await connected(address, speed=1.0, slow=False)
    results = {name: {"result": "", "why": "not called"} for name in methods(client)}
    for call in CALLS:
        results[call.method] = await asyncio.wait_for(carry_out(client, call), 60.0)
    print(json.dumps(results), flush=True)


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1]))
    os._exit(0)  # MAVSDK's own threads need not be waited for
