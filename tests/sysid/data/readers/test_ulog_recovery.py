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
