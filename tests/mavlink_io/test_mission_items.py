"""Mission items and command numbers."""

import pytest

from mavlink_io.dialect import constant
from mavlink_io.mission_items import MavCmd


@pytest.mark.parametrize("command", MavCmd, ids=lambda command: command.name)
def test_mav_cmd_number_equals_dialect(command: MavCmd) -> None:
    """Verifies: every MavCmd entry. Reference: pymavlink's dialect `all`. Tolerance: none."""
    assert command == constant(f"MAV_CMD_{command.name}")
