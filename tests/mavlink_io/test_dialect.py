"""The messages that pymavlink lacks, compared with the output of its generator."""

import importlib.util
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink
from pymavlink.generator import mavgen

from mavlink_io import dialect
from mavlink_io.codec import encode

DEFINITION = """<?xml version="1.0"?>
<mavlink><version>3</version><dialect>0</dialect><messages>
<message id="80" name="COMMAND_CANCEL"><description/>
<field type="uint8_t" name="target_system">-</field>
<field type="uint8_t" name="target_component">-</field>
<field type="uint16_t" name="command">-</field></message>
<message id="397" name="COMPONENT_METADATA"><description/>
<field type="uint32_t" name="time_boot_ms">-</field><field type="uint32_t" name="file_crc">-</field>
<field type="char[100]" name="uri">-</field></message>
<message id="111" name="TIMESYNC"><description/>
<field type="int64_t" name="tc1">-</field><field type="int64_t" name="ts1">-</field><extensions/>
<field type="uint8_t" name="target_system">-</field>
<field type="uint8_t" name="target_component">-</field></message>
</messages></mavlink>"""
"""Numbers, names, types and order of common.xml (https://mavlink.io/en/messages/common.html)."""


@pytest.fixture(scope="module")
def generated(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    """Return the dialect of these messages alone, as pymavlink would generate it."""
    folder: Path = tmp_path_factory.mktemp("dialect")
    (folder / "added.xml").write_text(DEFINITION)
    options = mavgen.Opts(
        str(folder / "added"), wire_protocol="2.0", language="Python3", validate=False
    )
    mavgen.mavgen(options, [str(folder / "added.xml")])
    specification = importlib.util.spec_from_file_location("added", folder / "added.py")
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("name", "fields"),
    [
        ("COMMAND_CANCEL", {"target_system": 1, "target_component": 2, "command": 31_010}),
        (
            "COMPONENT_METADATA",
            {"time_boot_ms": 12_345, "file_crc": 0xDEADBEEF, "uri": "mftp:///general.json"},
        ),
        ("TIMESYNC", {"tc1": 1 << 40, "ts1": -5, "target_system": 3, "target_component": 4}),
    ],
)
def test_added_message_equals_pymavlink_generator(
    generated: ModuleType, name: str, fields: dict[str, Any]
) -> None:
    known = getattr(mavlink, f"MAVLink_{name.lower()}_message", None)
    assert known is None or set(fields) - set(known.fieldnames), (
        "pymavlink knows it now: drop the addition"
    )
    message = dialect.by_name(name)
    for values in fields, dict.fromkeys(fields, 0) | ({"uri": ""} if "uri" in fields else {}):
        raw = {
            field: value.encode() if isinstance(value, str) else value
            for field, value in values.items()
        }
        peer = generated.MAVLink(None, srcSystem=7, srcComponent=9)
        frame = getattr(generated, f"MAVLink_{name.lower()}_message")(**raw).pack(peer)
        assert encode(message, message.values(**values), 0, 7, 9) == frame
        assert message.unpack(frame[10:-2])._asdict() == values


def test_has_location_follows_the_command() -> None:
    assert [n for n in (16, 20, 21, 93, 115, 178, 31_010, 65_535) if dialect.has_location(n)] == [
        16,
        21,
    ]
