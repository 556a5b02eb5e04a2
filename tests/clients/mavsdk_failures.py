"""A stock MAVSDK program that injects failures and records the texts; prints one JSON object.

Usage: python mavsdk_failures.py ADDRESS simulated|real|listen
"""

import asyncio
import json
import os
import sys
import time
from typing import Any

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.failure import FailureAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.plugins.failure.failure import FailureError, FailureType, FailureUnit

TIMEOUT_S, DIVE_S = 20.0, 50.0
FAILURES = [
    (FailureUnit.SENSOR_GYRO, FailureType.OFF),
    (FailureUnit.SENSOR_MAG, FailureType.STUCK),
    (FailureUnit.SYSTEM_SERVO, FailureType.STUCK),
    (FailureUnit.SYSTEM_MOTOR, FailureType.OFF),
    (FailureUnit.SENSOR_GPS, FailureType.OFF),
]


class Receiver:
    """All received texts."""

    def __init__(self, telemetry: Any) -> None:
        self.texts: list[str] = []
        self.health: Any = None
        self.longest_silence_s = 0.0
        self._received_s = time.monotonic()
        self._tasks = [
            asyncio.create_task(self._read(telemetry.subscribe_status_text())),
            asyncio.create_task(self._store_health(telemetry.subscribe_health())),
            asyncio.create_task(self._watch(telemetry.subscribe_attitude_euler())),
        ]

    async def _read(self, stream: Any) -> None:
        async for text in stream:
            self.texts.append(text.text)

    async def _store_health(self, stream: Any) -> None:
        async for health in stream:
            self.health = health

    async def _watch(self, stream: Any) -> None:
        async for _ in stream:
            now_s = time.monotonic()
            self.longest_silence_s = max(self.longest_silence_s, now_s - self._received_s)
            self._received_s = now_s

    @property
    def silent_s(self) -> float:
        return time.monotonic() - self._received_s

    def healthy(self) -> dict[str, bool]:
        h = self.health
        return {
            "gyro": h.is_gyrometer_calibration_ok,
            "magnetometer": h.is_magnetometer_calibration_ok,
            "accelerometer": h.is_accelerometer_calibration_ok,
        }


async def until(condition: Any, timeout_s: float = TIMEOUT_S) -> bool:
    deadline_s = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > deadline_s:
            return False
        await asyncio.sleep(0.05)
    return True


async def inject(failure: Any, unit: FailureUnit, kind: FailureType, instance: int = 0) -> str:
    try:
        await failure.inject(unit, kind, instance)
    except FailureError as error:
        return str(error.result.name)
    return "SUCCESS"


async def inject_and_clear(failure: Any, params: Any, receiver: Receiver) -> dict[str, Any]:
    seen: dict[str, Any] = {
        "while_off": await inject(failure, FailureUnit.SENSOR_GYRO, FailureType.OFF)
    }
    await params.set_param_float("SYS_FAILURE_EN", 1.0)
    seen["ordered"] = {
        f"{unit.name} {kind.name}": await inject(
            failure, unit, kind, int(unit == FailureUnit.SYSTEM_SERVO)
        )
        for unit, kind in FAILURES
    }
    seen["unsupported"] = await inject(failure, FailureUnit.SENSOR_AIRSPEED, FailureType.OFF)
    await until(lambda: {"Gyro silent", "Magnetometer stuck"} <= set(receiver.texts))
    await until(lambda: not receiver.healthy()["gyro"] and not receiver.healthy()["magnetometer"])
    seen["healthy_while_broken"] = receiver.healthy()
    for unit, _ in FAILURES:
        await inject(failure, unit, FailureType.OK)
    await until(lambda: all(receiver.healthy().values()))
    seen["healthy_when_mended"] = receiver.healthy()
    receiver.longest_silence_s = 0.0
    seen["ordered"]["link"] = await inject(
        failure, FailureUnit.SYSTEM_MAVLINK_SIGNAL, FailureType.OFF
    )
    await until(lambda: receiver.longest_silence_s > 2.0)
    seen["back"] = await until(
        lambda: "Fault over: link off" in receiver.texts and receiver.silent_s < 1.0
    )
    seen["longest_silence_s"] = receiver.longest_silence_s
    return seen


async def main(address: str, plan: str) -> dict[str, Any]:
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    await mavsdk.add_any_connection(address)
    system = await mavsdk.first_autopilot(timeout_s=TIMEOUT_S)
    failure = FailureAsync(system)
    params = ParamAsync(system)
    receiver = Receiver(TelemetryAsync(system))
    if plan == "listen":
        print("listening", flush=True)
        seen: dict[str, Any] = {
            "down": await until(lambda: "Surfaced: disarmed" in receiver.texts, DIVE_S)
        }
    elif plan == "real":
        await params.set_param_float("SYS_FAILURE_EN", 1.0)
        seen = {"real": await inject(failure, FailureUnit.SENSOR_GYRO, FailureType.OFF)}
        await until(lambda: "Failure refused: no simulator answers" in receiver.texts)
    else:
        await until(lambda: receiver.health is not None and all(receiver.healthy().values()))
        seen = await inject_and_clear(failure, params, receiver)
    return {**seen, "texts": receiver.texts}


if __name__ == "__main__":
    print(json.dumps(asyncio.run(main(sys.argv[1], sys.argv[2]))), flush=True)
    os._exit(0)  # MAVSDK's own threads need not be waited for
