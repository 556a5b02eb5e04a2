"""Link of a command to its vehicle; a long wait for the vehicle is reported on stderr."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from ground.cli.options import remark

if TYPE_CHECKING:
    from ground.client.vehicle import VehicleClient


@contextmanager
def connected(
    address: str, key_file: Path | None, system: int | None = None, modem_s: float | None = None
) -> "Iterator[VehicleClient]":
    """Connect as `ground.client.vehicle.connected`, and remark what the command waits for."""
    from ground.client import vehicle as client

    with client.connected(
        address, key_file=key_file, system=system, modem_s=modem_s, on_remark=remark
    ) as vehicle:
        yield vehicle
