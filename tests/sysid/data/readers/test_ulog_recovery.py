"""Single damaged messages of a .ulg are reported."""

from pathlib import Path

import pytest

from sysid.data import readers
from sysid.data.readers.ulog_recovery import keep_sound_messages
from tests.fuzz.files import FILES


@pytest.mark.parametrize(("byte", "bit"), [(2, 3), (2, 1), (3, 4)], ids=["text", "format", "topic"])
def test_ulog_sample_with_flipped_type_or_topic_is_reported(
    byte: int, bit: int, tmp_path: Path
) -> None:
    """Before, the sample was missing in silence: as a text, as a format, or of an unknown topic."""
    path = tmp_path / "dive.ulg"
    data = bytearray(FILES["ulog"].seeds(tmp_path)[0])
    sample = data.rindex(b"D") - 2
    while keep_sound_messages(bytes(data[:sample]))[1].trailing_bytes:  # a D within a message
        sample = data.rindex(b"D", 0, sample) - 2
    data[sample + byte] ^= 1 << bit
    path.write_bytes(data)
    assert readers.read(path).damage


def change(path: Path, kind: bytes, offset: int, mask: int, nth: int = -1) -> str:
    """Flip bits of one message of a sound .ulg and return the damage that the reader reports."""
    data = bytearray(FILES["ulog"].seeds(path.parent)[0])
    path.write_bytes(data)
    assert readers.read(path).damage == ""
    starts, at = [], 16
    while at < len(data):
        if data[at + 2 : at + 3] == kind:
            starts.append(at)
        at += 3 + int.from_bytes(data[at : at + 2], "little")
    data[starts[nth] + 3 + offset] ^= mask
    path.write_bytes(data)
    return readers.read(path).damage


CASES = {
    "topic of another size": (b"D", 0, 1),
    "type that ULog does not have": (b"D", -1, 0x10),
    "length of a parameter's name": (b"P", 0, 0x80),
    "text 0.13 s ahead": (b"L", 3, 2),
    "text in the far future": (b"L", 5, 0x08),
    "character of a text": (b"L", 9, 1),
    "character that is no UTF-8": (b"L", 12, 0x80),
}


@pytest.mark.parametrize("name", CASES)
def test_flipped_bit_of_a_message_is_reported(name: str, tmp_path: Path) -> None:
    kind, offset, mask = CASES[name]
    assert change(tmp_path / "dive.ulg", kind, offset, mask)


def test_flipped_bit_of_a_field_name_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "dive.ulg"
    data = FILES["ulog"].seeds(tmp_path)[0]
    path.write_bytes(data.replace(b"float vx", b"float vp"))
    assert "1 name or text is damaged" in readers.read(path).damage
