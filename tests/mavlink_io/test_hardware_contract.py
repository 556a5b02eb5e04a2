"""docs/hardware.md, from which users build vehicles, agrees with the code."""

import re
from pathlib import Path

from autopilot.control.params import PARAMETERS
from mavlink_io import device_messages, dialect
from sitl.backends.messages import COMPONENT
from sitl.backends.wall_clock import ACTUATOR_TIMEOUT_S, timestep_for_line

TEXT = (Path(__file__).parents[2] / "docs" / "hardware.md").read_text(encoding="utf-8")


def test_messages_have_their_numbers_and_seeds() -> None:
    documented = re.findall(r"([A-Z_]+) \((\d+), (\d+)\)", TEXT)
    assert len(documented) == 9
    for name, number, seed in documented:
        message = dialect.by_name(name)
        assert (int(number), int(seed)) == (message.message_id, message.crc_extra), name


def test_components_have_their_ids() -> None:
    documented = dict(
        re.findall(r"^\| ([^|`\n]+) \| (\d+)(?: \([A-Z0-9_]+\))? \|$", TEXT, re.MULTILINE)
    )
    assert documented == {
        "autopilot": "1",
        "interface computer: inertial, magnetic, pressure, GPS, altimeter": str(COMPONENT),
        "DVL": str(device_messages.DVL_COMPONENT),
        "battery monitor": str(device_messages.BATTERY_COMPONENT),
        "leak detector": str(device_messages.LEAK_COMPONENT),
        "duct encoders": str(device_messages.DUCT_COMPONENT),
    }


def test_line_rates_match_the_table() -> None:
    documented = re.findall(r"\| (\d+) \| (\d+) Hz \|", TEXT)
    assert len(documented) == 3
    for baud, rate_hz in documented:
        assert timestep_for_line(f"serial:x:{baud}").tick_us == 1_000_000 / int(rate_hz)


def test_message_sizes_match_the_wire() -> None:
    sizes = {
        name: dialect.by_name(name).struct.size + 12
        for name in ("HIL_SENSOR", "HIL_ACTUATOR_CONTROLS")
    }
    assert f"{sizes['HIL_SENSOR']} bytes (HIL_SENSOR)" in TEXT
    assert f"{sizes['HIL_ACTUATOR_CONTROLS']} (HIL_ACTUATOR_CONTROLS)" in TEXT


def test_documented_parameters_exist() -> None:
    known = {parameter.name for parameter in PARAMETERS}
    named = set(re.findall(r"`((?:MAV|FS|ACT|TRIM|HLTH|EST)_[A-Z_]+)`", TEXT))
    assert len(named) >= 8
    assert named <= known


def test_watchdog_matches_the_document() -> None:
    assert f"received nothing for {ACTUATOR_TIMEOUT_S:g} s**" in TEXT
