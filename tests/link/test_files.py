"""A vehicle without files says so at once, in pymavlink's own reading of the FTP payload."""

import struct

import pytest

from link.dialect import constant
from link.files import ACK, NAK, FileServer
from tests.link.lossy import GROUND, VEHICLE, Wire


def ask(opcode: str, path: bytes = b"", sequence: int = 7) -> tuple[int, int, int, int]:
    """Sequence, opcode, requested opcode and error of the answer."""
    request = struct.pack("<HBBBBBBI", sequence, 3, constant(f"MAV_FTP_OPCODE_{opcode}"), len(path), 0, 0, 0, 0) + path
    up, down = Wire(GROUND), Wire(VEHICLE)
    up.send(
        "FILE_TRANSFER_PROTOCOL",
        target_network=0,
        target_system=1,
        target_component=1,
        payload=request.ljust(251, b"\0"),
    )
    (frame,) = up.take()
    FileServer().feed(frame, down.send)
    (answer,) = down.take()
    payload = bytes(answer.decode().payload)
    assert (answer.decode().target_system, answer.decode().target_component) == GROUND
    sequence_back, session, opcode_back, size, requested = struct.unpack_from("<HBBBB", payload)
    assert session == 3
    assert size == (1 if opcode_back == NAK else 0)
    return sequence_back, opcode_back, requested, payload[12]


@pytest.mark.parametrize(
    ("opcode", "path", "error"),
    [
        ("OPENFILERO", b"@PARAM/param.pck?withdefaults=1", "FILENOTFOUND"),
        ("CALCFILECRC", b"/logs/1.mcap", "FILENOTFOUND"),
        ("LISTDIRECTORY", b"/", "EOF"),
        ("LISTDIRECTORY", b"/secret", "FILENOTFOUND"),
        ("CREATEFILE", b"/x", "FILEPROTECTED"),
        ("REMOVEFILE", b"/x", "FILEPROTECTED"),
        ("READFILE", b"", "INVALIDSESSION"),
        ("BURSTREADFILE", b"", "INVALIDSESSION"),
    ],
)
def test_every_request_for_a_file_is_refused_at_once(opcode: str, path: bytes, error: str) -> None:
    expected = constant(f"MAV_FTP_OPCODE_{opcode}"), constant(f"MAV_FTP_ERR_{error}")
    assert ask(opcode, path) == (8, NAK, *expected)


@pytest.mark.parametrize("opcode", ["NONE", "TERMINATESESSION", "RESETSESSION"])
def test_ending_a_session_is_always_granted(opcode: str) -> None:
    assert ask(opcode)[:2] == (8, ACK)


def test_the_sequence_wraps() -> None:
    assert ask("OPENFILERO", b"x", 0xFFFF)[0] == 0


def test_an_answer_is_never_answered() -> None:
    down = Wire(VEHICLE)
    payload = struct.pack("<HBBBBBBI", 1, 0, NAK, 1, 4, 0, 0, 0).ljust(251, b"\0")
    up = Wire(GROUND)
    up.send("FILE_TRANSFER_PROTOCOL", target_network=0, target_system=1, target_component=1, payload=payload)
    FileServer().feed(up.take()[0], down.send)
    assert down.take() == []
