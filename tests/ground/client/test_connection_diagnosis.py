"""Error messages if no vehicle is found on a link."""

import os
from collections.abc import Iterator
from contextlib import closing
from typing import NamedTuple

import pytest

from ground.client.connection_diagnosis import MAX_FRAMES, receive_all
from ground.client.vehicle import VehicleClient, VehicleClientError
from mavlink_io.endpoint import Endpoint
from mavlink_io.signing import Signing, Timestamp, key_from_passphrase
from mavlink_io.transport import Transport, open_transport

CHATTER = bytes(range(256)) * 8


class Line(NamedTuple):
    """A serial line that ground listens on, and its other end."""

    ground: Transport
    far_end: int


@pytest.fixture
def line() -> Iterator[Line]:
    far_end, device = os.openpty()
    with closing(open_transport(f"serial:{os.ttyname(device)}:57600")) as transport:
        yield Line(transport, far_end)
    os.close(far_end)
    os.close(device)


def complaint(transport: Transport, signing: Signing | None = None) -> str:
    with pytest.raises(VehicleClientError) as refusal:
        VehicleClient(transport, signing=signing).connect(timeout_s=0.3)
    return str(refusal.value)


def test_silent_serial_line_hints_at_power_and_wiring(line: Line) -> None:
    told = complaint(line.ground)
    assert told.startswith(
        f"no vehicle on {line.ground.address} within 0.3 s: nothing was received: "
    )
    assert "switched on" in told
    assert "TX wired to RX" in told


def test_bytes_without_mavlink_hint_at_baud_rate(line: Line) -> None:
    os.write(line.far_end, CHATTER)
    told = complaint(line.ground)
    assert "bytes were received and no MAVLink in them: is 57600 the vehicle's baud rate?" in told


def test_senders_without_autopilot_are_named() -> None:
    with (
        closing(open_transport("memory:others")) as near,
        closing(open_transport("memory:others")) as far,
    ):
        Endpoint(far, 255, 190).send(
            "PING", time_usec=0, seq=0, target_system=0, target_component=0
        )
        Endpoint(far, 1, 100).send("SYSTEM_TIME", time_unix_usec=0, time_boot_ms=0)
        told = complaint(near)
        assert "no HEARTBEAT of an autopilot" in told
        assert "received from 1/100, 255/190 (system/component)" in told


def test_silent_udp_link_has_no_wiring_hint() -> None:
    with closing(open_transport("memory:nobody")) as near:
        assert complaint(near).endswith(": nothing was received")


def signing(passphrase: str) -> Signing:
    return Signing(key_from_passphrase(passphrase), 1, Timestamp())


@pytest.mark.parametrize(
    ("vehicle_key", "reason"),
    [
        (signing("other"), "messages with another signature were received: is the key of --sign"),
        (None, "messages without a signature were received: leave --sign out"),
    ],
)
def test_frames_of_another_or_no_key_are_named(vehicle_key: Signing | None, reason: str) -> None:
    with (
        closing(open_transport("memory:keys")) as near,
        closing(open_transport("memory:keys")) as far,
    ):
        vehicle = Endpoint(far, 1, 1, vehicle_key)
        vehicle.send("SYSTEM_TIME", time_unix_usec=0, time_boot_ms=0)
        assert reason in complaint(near, signing("own"))


def test_request_without_key_on_a_signed_link_names_sign() -> None:
    with (
        closing(open_transport("memory:signed")) as near,
        closing(open_transport("memory:signed")) as far,
    ):
        vehicle = Endpoint(far, 1, 1, signing("own"))
        client = VehicleClient(near)
        vehicle.send(
            "HEARTBEAT",
            type=12,
            autopilot=0,
            base_mode=0,
            custom_mode=0,
            system_status=4,
            mavlink_version=3,
        )
        client.connect()
        exchange = client._params.get("HDG_P")
        exchange.repeat_every(0.0, 1)
        exchange._retry_s = 0.1
        with pytest.raises(VehicleClientError, match=r"no answer .*give the key of .* by --sign"):
            client._run(exchange)


def test_backlog_is_read_in_parts_that_do_not_block_the_caller() -> None:
    """Eight vehicles in lockstep reported once in seconds: a read took megabytes of a stream."""
    heartbeat = bytes.fromhex("fe0900010100000000000c0300030377a1")
    with (
        closing(open_transport("memory:backlog")) as near,
        closing(open_transport("memory:backlog")) as far,
    ):
        for _ in range(12):
            far.send(heartbeat * 500)
        endpoint = Endpoint(near, 255, 190)
        first, rest = receive_all(endpoint), receive_all(endpoint)
    assert (len(first.frames), first.is_all) == (MAX_FRAMES, False)
    assert (len(rest.frames), rest.is_all) == (6000 - MAX_FRAMES, True)
