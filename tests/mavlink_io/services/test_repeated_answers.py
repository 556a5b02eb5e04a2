"""Clients end with an error when a vehicle answers for ever without anything new."""

import io
from collections.abc import Callable
from typing import Any, NamedTuple

import pytest

from ground.client.commands import CommandExchange, ModeList
from mavlink_io.mission_items import MissionItem
from mavlink_io.request import Exchange, ExchangeError, Send
from mavlink_io.services.ftp import client as ftp_client
from mavlink_io.services.ftp import payload
from mavlink_io.services.ftp.client import FileClient
from mavlink_io.services.ftp.payload import Packet
from mavlink_io.services.log_transfer.client import LogClient, RemoteLog
from mavlink_io.services.missions import MissionClient
from mavlink_io.services.params import ParamClient
from tests.helpers.lossy_link import GROUND, VEHICLE, Wire

STEP_S = 0.1
MAX_WAIT_S = 700.0
"""Longer than any limit of an exchange."""
TO_GROUND = {"target_system": GROUND.system, "target_component": GROUND.component}
USER_1 = 31010
IN_PROGRESS = 5
SIZE = 100_000


class Answer(NamedTuple):
    """The only answer of a vehicle."""

    name: str
    fields: dict[str, Any]


def mission_client(send: Send) -> Exchange[Any]:
    items = [MissionItem(sequence=n, frame=6, command=16) for n in range(3)]
    return MissionClient(send, GROUND, VEHICLE).upload(items)


def log_download(send: Send) -> Exchange[Any]:
    log = RemoteLog(number=1, bytes=SIZE, began_unix_s=0)
    return LogClient(send, GROUND, VEHICLE).download(log, io.BytesIO())


MODE = {"number_modes": 3, "standard_mode": 0, "custom_mode": 7, "properties": 0, "mode_name": "A"}
PARAMETER = {"param_id": "A", "param_value": 1.0, "param_type": 9, "param_count": 3}
LOG_ENTRY = {"id": 1, "num_logs": 3, "last_log_num": 3, "time_utc": 0, "size": 90}
PIECE = {"id": 1, "count": 90, "data": bytes(90)}
ACK = {"result": IN_PROGRESS, "result_param2": 0, **TO_GROUND}

REPEATS: dict[str, tuple[Callable[[Send], Exchange[Any]], Answer]] = {
    "command in progress": (
        lambda send: CommandExchange(send, GROUND, VEHICLE, USER_1),
        Answer("COMMAND_ACK", {"command": USER_1, "progress": 40, **ACK}),
    ),
    "one mode of three": (
        lambda send: ModeList(send, GROUND, VEHICLE),
        Answer("AVAILABLE_MODES", {"mode_index": 1, **MODE}),
    ),
    "one parameter of three": (
        lambda send: ParamClient(send, GROUND, VEHICLE).list(),
        Answer("PARAM_VALUE", {"param_index": 0, **PARAMETER}),
    ),
    "parameter beyond the count": (
        lambda send: ParamClient(send, GROUND, VEHICLE).list(),
        Answer("PARAM_VALUE", {"param_index": 9, **PARAMETER}),
    ),
    "first mission item": (
        mission_client,
        Answer("MISSION_REQUEST_INT", {"seq": 0, "mission_type": 0, **TO_GROUND}),
    ),
    "one log of three": (
        lambda send: LogClient(send, GROUND, VEHICLE).list(),
        Answer("LOG_ENTRY", LOG_ENTRY),
    ),
    "first piece of a log": (log_download, Answer("LOG_DATA", {"ofs": 0, **PIECE})),
    "piece after a gap": (log_download, Answer("LOG_DATA", {"ofs": 45, **PIECE})),
    "piece after the log": (log_download, Answer("LOG_DATA", {"ofs": 2 * SIZE, **PIECE})),
}


@pytest.mark.parametrize("case", REPEATS)
def test_client_ends_when_an_answer_is_repeated_for_ever(case: str) -> None:
    begin, answer = REPEATS[case]
    up, down = Wire(GROUND), Wire(VEHICLE)
    exchange = begin(up.send)
    for step in range(int(MAX_WAIT_S / STEP_S)):
        exchange.poll(step * STEP_S)
        down.send(answer.name, **answer.fields)
        for frame in down.take():
            exchange.feed(frame)
        if exchange.done:
            break
    with pytest.raises(ExchangeError, match=r"no new answer for \d+ s|after 5 attempts"):
        exchange.result()


def test_command_that_progresses_is_awaited() -> None:
    up, down = Wire(GROUND), Wire(VEHICLE)
    exchange = CommandExchange(up.send, GROUND, VEHICLE, USER_1)
    for second in range(4000):
        exchange.poll(float(second))
        fields = {"command": USER_1, "progress": second // 40, **ACK}
        down.send("COMMAND_ACK", **fields)
        for frame in down.take():
            exchange.feed(frame)
    assert not exchange.done


def serve_files(answer: Callable[[Packet], Packet], begin: Callable[[FileClient], Any]) -> None:
    """Run an exchange with a file server that this function stands for; raise its error."""
    up, down = Wire(GROUND), Wire(VEHICLE)
    exchange = begin(FileClient(up.send, GROUND, VEHICLE))
    for step in range(int(MAX_WAIT_S / STEP_S)):
        exchange.poll(step * STEP_S)
        for frame in up.take():
            reply = answer(payload.decode(bytes(frame.decode().payload)))
            reply = reply._replace(size=len(reply.data))
            fields = {"target_network": 0, **TO_GROUND}
            down.send("FILE_TRANSFER_PROTOCOL", payload=reply.encode(), **fields)
        for frame in down.take():
            exchange.feed(frame)
        if exchange.done:
            break
    exchange.result()


def reply_to(request: Packet, opcode: int, data: bytes, offset: int = 0) -> Packet:
    return Packet(
        sequence=payload.next_sequence(request.sequence),
        session=1,
        opcode=opcode,
        requested=request.opcode,
        offset=offset,
        data=data,
    )


def test_list_of_a_vehicle_that_ignores_the_offset_ends() -> None:
    with pytest.raises(ExchangeError, match="the list of /logs: has more than 10000 entries"):
        serve_files(
            lambda request: reply_to(request, payload.ACK, b"Fa\t1\0" * 40),
            lambda files: files.list("/logs"),
        )


@pytest.mark.parametrize(
    ("opcode", "data"),
    [(payload.ACK, b""), (payload.ACK, b"a"), (payload.NAK, bytes((payload.INVALID_SESSION,)))],
)
def test_download_that_stands_still_ends(opcode: int, data: bytes) -> None:
    def answer(request: Packet) -> Packet:
        if request.opcode == payload.OPEN:
            return reply_to(request, payload.ACK, SIZE.to_bytes(4, "little"))
        return reply_to(request, opcode, data)

    with pytest.raises(ExchangeError, match=r"no new answer|after 5 attempts"):
        serve_files(answer, lambda files: files.download("/a", io.BytesIO()))


def test_download_of_a_file_that_grows_ends_at_its_first_size() -> None:
    def answer(request: Packet) -> Packet:
        is_open = request.opcode == payload.OPEN
        return reply_to(request, payload.ACK, b"\x05\0\0\0" if is_open else b"0123456789")

    sink = io.BytesIO()
    serve_files(answer, lambda files: files.download("/a", sink))
    assert sink.getvalue() == b"01234"


def test_burst_with_a_large_gap_requests_few_pieces_at_once() -> None:
    up, down = Wire(GROUND), Wire(VEHICLE)
    exchange = FileClient(up.send, GROUND, VEHICLE).download("/a", io.BytesIO())
    exchange.poll(0.0)
    for data, number in ((b"\xff\xff\xff\x7f", 0), (bytes(payload.MAX_DATA), 10_000)):
        (request,) = (payload.decode(bytes(f.decode().payload)) for f in up.take())
        reply = reply_to(request, payload.ACK, data, number * payload.MAX_DATA)
        reply = reply._replace(size=len(data), sequence=reply.sequence + number & 0xFFFF)
        fields = {"target_network": 0, **TO_GROUND}
        down.send("FILE_TRANSFER_PROTOCOL", payload=reply.encode(), **fields)
        for frame in down.take():
            exchange.feed(frame)
    assert len(up.take()) == ftp_client.MAX_REPAIRS
