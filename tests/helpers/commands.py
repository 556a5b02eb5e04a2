"""Commands as pymavlink encodes them, and the results in their acknowledgements."""

import math
from typing import Any

from pymavlink.dialects.v20 import all as mavlink

from mavlink_io.records import GpsFix
from tests.helpers.fake_hil import Harness

NAN = math.nan
FIX = GpsFix(0, 3, 41.5, -70.7, 12.0, 0.0, 0.0, 0.0, 9)
ACCEPTED, REJECTED, DENIED = 0, 1, 2
UNSUPPORTED, FAILED, IN_PROGRESS, CANCELLED = 3, 4, 5, 6
INT32_MAX = 2**31 - 1


def under_way(harness: Harness, depth_m: float = 5.0) -> None:
    harness.vehicle.params.set("FS_DIVE_S", 0.0)  # the depth does not follow the elevator
    harness.command(400, 1)
    harness.command(176, 1, 2)
    harness.tick(200, depth_m=depth_m)


def results(messages: list[Any]) -> list[int]:
    return [m.result for m in messages if m.get_type() == "COMMAND_ACK"]


def long(command: int, *parameters: float, confirmation: int = 0) -> Any:
    filled = [*parameters, *[NAN] * (7 - len(parameters))]
    return mavlink.MAVLink_command_long_message(1, 1, command, confirmation, *filled)
