"""The file server with requests in pymavlink's packing of the FTP payload."""

from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from pymavlink.mavftp import FTP_OP

from mavlink_io.dialect import constant
from mavlink_io.request import MavlinkId
from mavlink_io.services.ftp.payload import crc32
from mavlink_io.services.ftp.server import (
    BURST_PACKETS,
    MAX_SESSIONS,
    SESSION_IDLE_S,
    FileServer,
)
from mavlink_io.services.ftp.tree import FileTree
from tests.helpers.lossy_link import GROUND, VEHICLE, Wire

ACK, NAK = 128, 129
CONTENT = bytes(range(256)) * 400
SECRET = b"what nobody may read"


def opcode(name: str) -> int:
    return constant(f"MAV_FTP_OPCODE_{name}")


def error(name: str) -> bytes:
    return bytes((constant(f"MAV_FTP_ERR_{name}"),))


def build(folder: Path) -> FileServer:
    """A server of one folder with a secret file beside the folder."""
    logs = folder / "logs"
    (logs / "inner").mkdir(parents=True, exist_ok=True)
    (logs / "one.mcap").write_bytes(CONTENT)
    (logs / "two.mcap").write_bytes(b"short")
    (logs / "inner" / "deep").write_bytes(SECRET)
    (folder / "secret").write_bytes(SECRET)
    for name, target in (("link", folder / "secret"), ("up", folder)):
        if not (logs / name).is_symlink():
            (logs / name).symlink_to(target)
    tree = FileTree()
    tree.add_folder("/logs", logs)
    tree.add_file("/params/current.param", lambda: b"HDG_P,0.65\n")
    return FileServer(tree)


class Client:
    """A client that sends requests and reads the answers."""

    def __init__(self, server: FileServer, party: MavlinkId = GROUND) -> None:
        self.server, self.party = server, party
        self.room = 10**9
        self.down = Wire(VEHICLE)
        self.sequence = 100

    def send(
        self,
        name: str | int,
        data: bytes = b"",
        offset: int = 0,
        session: int = 0,
        size: int | None = None,
    ) -> None:
        number = name if isinstance(name, int) else opcode(name)
        length = len(data) if size is None else size
        self.sequence = (self.sequence + 1) & 0xFFFF
        self.put(
            FTP_OP(self.sequence, session, number, length, 0, 0, offset, bytearray(data)).pack()
        )

    def put(self, payload: bytes) -> None:
        up = Wire(self.party)
        padded = bytes(payload).ljust(251, b"\0")
        up.send(
            "FILE_TRANSFER_PROTOCOL",
            target_network=0,
            target_system=1,
            target_component=1,
            payload=padded,
        )
        self.server.feed(up.take()[0], self.down.send, lambda: self.room, 0.0)

    def answers(self, polls: int = 1) -> list[FTP_OP]:
        for _ in range(polls):
            self.server.poll(0.0)
        found = []
        for frame in self.down.take():
            message = frame.decode()
            assert (message.target_system, message.target_component) == self.party
            found.append(read(bytes(message.payload)))
        return found

    def ask(
        self,
        name: str | int,
        data: bytes = b"",
        offset: int = 0,
        session: int = 0,
        size: int | None = None,
    ) -> Any:
        self.send(name, data, offset, session, size)
        (answer,) = self.answers()
        assert answer.seq == (self.sequence + 1) & 0xFFFF
        assert answer.req_opcode == (name if isinstance(name, int) else opcode(name))
        assert answer.session == session
        return answer


def read(payload: bytes) -> FTP_OP:
    head = payload[:12]
    size = head[4]
    return FTP_OP(
        int.from_bytes(head[:2], "little"),
        head[2],
        head[3],
        size,
        head[5],
        head[6],
        int.from_bytes(head[8:12], "little"),
        payload[12 : 12 + size],
    )


@pytest.fixture
def client(tmp_path: Path) -> Client:
    return Client(build(tmp_path))


def test_ftp_file_is_opened_read_and_closed(client: Client) -> None:
    opened = client.ask("OPENFILERO", b"/logs/one.mcap", session=5)
    assert (opened.opcode, int.from_bytes(opened.payload, "little")) == (ACK, len(CONTENT))
    assert client.ask("READFILE", offset=1000, size=80, session=5).payload == CONTENT[1000:1080]
    assert (
        client.ask("READFILE", offset=len(CONTENT) - 3, size=239, session=5).payload == CONTENT[-3:]
    )
    beyond = client.ask("READFILE", offset=len(CONTENT), size=239, session=5)
    assert (beyond.opcode, beyond.payload) == (NAK, error("EOF"))
    assert client.ask("TERMINATESESSION", session=5).opcode == ACK
    assert client.ask("READFILE", size=9, session=5).payload == error("INVALIDSESSION")


def test_ftp_generated_text_is_read_as_file(client: Client) -> None:
    client.ask("OPENFILERO", b"params/current.param\0")
    assert client.ask("READFILE", size=239).payload == b"HDG_P,0.65\n"


@pytest.mark.parametrize(
    ("path", "lines"),
    [
        (b"/", [b"Dlogs", b"Dparams"]),
        (b"", [b"Dlogs", b"Dparams"]),
        (b"/logs", [b"Fone.mcap\t102400", b"Ftwo.mcap\t5"]),
        (b"logs/", [b"Fone.mcap\t102400", b"Ftwo.mcap\t5"]),
        (b"/params", [b"Fcurrent.param\t11"]),
    ],
)
def test_ftp_directory_is_listed_from_any_entry(
    client: Client, path: bytes, lines: list[bytes]
) -> None:
    for start in range(len(lines)):
        assert (
            client.ask("LISTDIRECTORY", path, offset=start).payload.split(b"\0")[:-1]
            == lines[start:]
        )
    assert client.ask("LISTDIRECTORY", path, offset=len(lines)).payload == error("EOF")


def test_ftp_long_listing_is_sent_in_parts(tmp_path: Path) -> None:
    client = Client(build(tmp_path))
    for number in range(100):
        (tmp_path / "logs" / f"{number:03d}").write_bytes(b"x" * number)
    (tmp_path / "logs" / ("z" * 250)).write_bytes(b"a name that no message holds")
    found: list[bytes] = []
    while (answer := client.ask("LISTDIRECTORY", b"/logs", offset=len(found))).opcode == ACK:
        assert len(answer.payload) <= 239
        found += bytes(answer.payload).split(b"\0")[:-1]
    assert answer.payload == error("EOF")
    assert found[:3] == [b"F000\t0", b"F001\t1", b"F002\t2"]
    assert len(found) == 103
    assert found[-1] == b"S"


def test_ftp_burst_sends_rest_of_file(client: Client) -> None:
    client.ask("OPENFILERO", b"/logs/one.mcap")
    data, offset = b"", 500
    for _ in range(3):
        client.send("BURSTREADFILE", offset=offset, size=239)
        burst = client.answers()
        sequences = [(answer.seq - client.sequence) & 0xFFFF for answer in burst]
        assert sequences == list(range(1, len(burst) + 1))
        parts = [answer for answer in burst if answer.opcode == ACK]
        assert len(parts) <= BURST_PACKETS
        for answer in parts:
            assert answer.offset == offset + len(data)
            data += answer.payload
        if burst[-1].opcode == NAK:
            assert (burst[-1].payload, burst[-1].offset) == (error("EOF"), len(CONTENT))
            break
        assert [answer.burst_complete for answer in parts] == [0] * (len(parts) - 1) + [1]
        offset, data, done = offset + len(data), b"", data
        assert done == CONTENT[offset - len(done) : offset]
    assert offset + len(data) == len(CONTENT)


def test_ftp_burst_stays_within_link_room(client: Client) -> None:
    client.ask("OPENFILERO", b"/logs/one.mcap")
    client.room = 278
    client.send("BURSTREADFILE", size=239)
    assert client.answers() == []
    client.room = 10**9
    assert len(client.answers()) == BURST_PACKETS


def test_ftp_checksum_equals_mavlink_crc32(client: Client) -> None:
    client.send("CALCFILECRC", b"/logs/one.mcap")
    (answer,) = client.answers(3)
    assert int.from_bytes(answer.payload, "little") == bitwise_crc(CONTENT)
    assert crc32(CONTENT[77:], crc32(CONTENT[:77])) == bitwise_crc(CONTENT)
    client.send("CALCFILECRC", b"/logs/three.mcap")
    assert client.answers(3)[0].payload == error("FILENOTFOUND")


def bitwise_crc(data: bytes) -> int:
    """Reflected polynomial 0x04C11DB7, start 0, no inversion (mavlink.io/en/guide/crc.html)."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xEDB88320 if crc & 1 else 0)
    return crc


@pytest.mark.parametrize(
    "name", ["READFILE", "OPENFILERO", "LISTDIRECTORY", "CALCFILECRC", "TERMINATESESSION"]
)
def test_ftp_repeated_request_gets_same_answer(client: Client, tmp_path: Path, name: str) -> None:
    client.ask("OPENFILERO", b"/logs/two.mcap")
    data = {"READFILE": b"", "TERMINATESESSION": b"", "LISTDIRECTORY": b"/logs"}.get(
        name, b"/logs/two.mcap"
    )
    payload = FTP_OP(7, 0, opcode(name), len(data) or 5, 0, 0, 0, bytearray(data)).pack()
    client.put(payload)
    first = client.answers(3)
    (tmp_path / "logs" / "two.mcap").write_bytes(b"something else")
    client.put(payload)
    again = client.answers(3)
    assert [str(a) for a in again] == [str(a) for a in first] != []


@pytest.mark.parametrize("party", [MavlinkId(255, 190), GROUND])
def test_ftp_sessions_are_separate_per_client(tmp_path: Path, party: MavlinkId) -> None:
    """Clients with the same ids on two links have separate sessions too."""
    server = build(tmp_path)
    one, other = Client(server), Client(server, party)
    one.ask("OPENFILERO", b"/logs/one.mcap")
    other.ask("OPENFILERO", b"/logs/two.mcap")
    assert one.ask("READFILE", size=5).payload == CONTENT[:5]
    assert other.ask("READFILE", size=5).payload == b"short"
    other.ask("RESETSESSION")
    assert other.ask("READFILE", size=5).opcode == NAK
    assert one.ask("READFILE", size=5).payload == CONTENT[:5]


def test_ftp_idle_session_is_closed_for_new_one(client: Client) -> None:
    for session in range(MAX_SESSIONS):
        assert client.ask("OPENFILERO", b"/logs/two.mcap", session=session).opcode == ACK
    assert client.ask("OPENFILERO", b"/logs/two.mcap", session=99).payload == error(
        "NOSESSIONSAVAILABLE"
    )
    client.server._now_s = 0.0
    later = Wire(GROUND)
    payload = bytes(
        FTP_OP(1, 99, opcode("OPENFILERO"), 14, 0, 0, 0, bytearray(b"/logs/two.mcap")).pack()
    )
    later.send(
        "FILE_TRANSFER_PROTOCOL",
        target_network=0,
        target_system=1,
        target_component=1,
        payload=payload.ljust(251, b"\0"),
    )
    client.server.feed(later.take()[0], client.down.send, lambda: 0, SESSION_IDLE_S + 1.0)
    assert read(bytes(client.down.take()[-1].decode().payload)).opcode == ACK


def test_ftp_server_closes_files(client: Client) -> None:
    before = open_files()
    for _ in range(20):
        client.ask("OPENFILERO", b"/logs/one.mcap")
        client.send("BURSTREADFILE", size=239)
        client.send("CALCFILECRC", b"/logs/one.mcap")
        client.send("CALCFILECRC", b"/logs/two.mcap")
        client.answers(4)
    client.ask("RESETSESSION")
    assert open_files() == before


def open_files() -> int:
    """Return the open files of this process; 0 if the system does not report them."""
    listing = Path("/proc/self/fd")
    return len(list(listing.iterdir())) if listing.exists() else 0


@pytest.mark.parametrize(
    ("name", "path", "refusal"),
    [
        ("OPENFILERO", b"@PARAM/param.pck?withdefaults=1", "FILENOTFOUND"),
        ("OPENFILERO", b"/logs", "FILENOTFOUND"),
        ("OPENFILERO", b"/", "FILENOTFOUND"),
        ("OPENFILERO", b"\xff\xfe", "FILENOTFOUND"),
        ("LISTDIRECTORY", b"/secret", "FILENOTFOUND"),
        ("CREATEFILE", b"/x", "FILEPROTECTED"),
        ("REMOVEFILE", b"/logs/one.mcap", "FILEPROTECTED"),
        ("RENAME", b"/logs/one.mcap\0/x", "FILEPROTECTED"),
        ("READFILE", b"", "INVALIDSESSION"),
        ("BURSTREADFILE", b"", "INVALIDSESSION"),
    ],
)
def test_ftp_impossible_request_is_refused(
    client: Client, name: str, path: bytes, refusal: str
) -> None:
    answer = client.ask(name, path, session=9)
    assert (answer.opcode, answer.payload) == (NAK, error(refusal))


def test_ftp_unknown_opcode_refused_answer_ignored(client: Client) -> None:
    assert client.ask(77).payload == error("UNKNOWNCOMMAND")
    client.send(ACK)
    client.send(NAK)
    assert client.answers() == []


STEP = st.sampled_from(
    [
        "..",
        ".",
        "",
        "logs",
        "link",
        "up",
        "inner",
        "deep",
        "secret",
        "one.mcap",
        "\\",
        "etc",
        "~",
        "\0",
    ]
)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@example(["logs", "link"], False, False)
@example(["logs", "up", "secret"], True, False)
@example(["logs", "..", "secret"], True, False)
@example(["logs", "inner", "deep"], True, False)
@example(["secret"], True, True)
@given(st.lists(STEP, max_size=8), st.booleans(), st.booleans())
def test_ftp_path_never_leaves_tree(
    tmp_path: Path, steps: list[str], absolute: bool, from_disk: bool
) -> None:
    client = Client(build(tmp_path))
    start = str(tmp_path) if from_disk else ""
    path = ("/" if absolute else "") + start + "/".join(steps)
    data = path.encode()[:239]
    opened = client.ask("OPENFILERO", data)
    if opened.opcode == ACK:
        assert client.ask("READFILE", size=239).payload == CONTENT[:239]
    client.send("CALCFILECRC", data)
    for answer in client.answers(3):
        assert answer.opcode == NAK or int.from_bytes(answer.payload, "little") == crc32(CONTENT)
    listed = client.ask("LISTDIRECTORY", data)
    assert b"secret" not in bytes(listed.payload)
    assert b"deep" not in bytes(listed.payload)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.binary(min_size=0, max_size=251), min_size=1, max_size=12))
def test_ftp_any_payload_gets_one_answer_or_a_burst(tmp_path: Path, payloads: list[bytes]) -> None:
    client = Client(build(tmp_path))
    for payload in payloads:
        client.put(payload)
        answers = client.answers(2)
        if payload[3:4] not in (bytes((ACK,)), bytes((NAK,)), bytes((opcode("BURSTREADFILE"),))):
            assert len(answers) == 1
        for answer in answers:
            assert answer.opcode in (ACK, NAK)


FIELDS = st.tuples(
    st.integers(0, 3),
    st.integers(0, 3),
    st.integers(0, 16),
    st.integers(0, 255),
    st.integers(0, 60_000),
)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(
        st.tuples(
            FIELDS, st.sampled_from([b"/logs/one.mcap", b"/logs", b"", b"/params/current.param"])
        ),
        max_size=30,
    )
)
def test_ftp_any_request_order_does_not_raise(
    tmp_path: Path, requests: list[tuple[tuple[int, ...], bytes]]
) -> None:
    client = Client(build(tmp_path))
    for (sequence, session, number, size, offset), path in requests:
        client.put(
            bytes(FTP_OP(sequence, session, number, size, 0, 0, offset, bytearray(path)).pack())
        )
        client.answers()
