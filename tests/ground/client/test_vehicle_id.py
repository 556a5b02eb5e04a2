"""Several vehicles on one link: ``--vehicle-id`` selects one of them."""

from collections.abc import Iterator

import pytest

from ground.client.vehicle import VehicleClient, VehicleClientError
from mavlink_io.endpoint import Endpoint
from mavlink_io.request import MavlinkId
from mavlink_io.transport import open_transport

LINK = "memory:vehicle-id"


@pytest.fixture
def fleet() -> Iterator[tuple[Endpoint, VehicleClient]]:
    """Return the vehicles' end of a link, on which all send, and a client of vehicle 2."""
    far, near = open_transport(LINK), open_transport(LINK)
    client = VehicleClient(near, system=2)
    yield Endpoint(far, 1, 1), client
    client.close()
    far.close()


def send(fleet: Endpoint, system: int, depth_m: float) -> None:
    """Send HEARTBEAT, a position and a text of one vehicle."""
    vehicle = Endpoint(fleet.transport, system, 1)
    vehicle.send(
        "HEARTBEAT",
        type=12,
        autopilot=0,
        base_mode=1,
        custom_mode=system << 16,
        system_status=3,
        mavlink_version=3,
    )
    position = {"time_boot_ms": 0, "x": 0.0, "y": 0.0, "z": depth_m}
    vehicle.send("LOCAL_POSITION_NED", **position, vx=0.0, vy=0.0, vz=0.0)
    vehicle.send("STATUSTEXT", severity=6, text=f"from {system}")


def test_selected_vehicle_is_followed_and_others_are_not(
    fleet: tuple[Endpoint, VehicleClient],
) -> None:
    far, client = fleet
    for system in (1, 2, 3):
        send(far, system, float(system))
    client.connect(5.0)
    client.pump(0.0)
    assert client.vehicle_id == MavlinkId(2, 1)
    position = client.latest("LOCAL_POSITION_NED")
    assert position is not None
    assert (position.z, client.custom_mode) == (2.0, 2 << 16)
    assert [text.text for text in client.texts] == ["from 2"]


def test_first_vehicle_is_followed_without_vehicle_id() -> None:
    far, near = open_transport(LINK), open_transport(LINK)
    client = VehicleClient(near)
    Endpoint(far, 3, 1).send("SYSTEM_TIME", time_unix_usec=0, time_boot_ms=0)
    for system in (1, 2):
        send(Endpoint(far, 1, 1), system, float(system))
    client.connect(5.0)
    client.pump(0.0)
    assert client.vehicle_id == MavlinkId(1, 1)
    position = client.latest("LOCAL_POSITION_NED")
    assert position is not None
    assert (position.z, client.custom_mode) == (1.0, 1 << 16)
    assert [text.text for text in client.texts] == ["from 1"]
    assert client.latest("SYSTEM_TIME") is None
    client.close()
    far.close()


def test_missing_vehicle_is_reported_with_those_received(
    fleet: tuple[Endpoint, VehicleClient],
) -> None:
    far, client = fleet
    for system in (3, 1):
        send(far, system, 0.0)
    with pytest.raises(VehicleClientError, match=r"no vehicle 2 .* received systems: 1, 3$"):
        client.connect(0.2)
