"""Who steers by hand: a pilot's stick, or actuators that were set once."""

import math
from typing import Any

from autopilot.control import modes
from autopilot.control.types import AutopilotState, Stick

STICK_TIMEOUT_S = 1.5
"""A pilot's hand that was not heard of for longer has let go."""
_NOT_GIVEN = 32_767
"""MANUAL_CONTROL's mark of an axis that the stick lacks."""
_STICK_FULL = 1000.0
_RELEASED = Stick(0.0, 0.0, 0.0)


class Helm:
    """The last word of whoever steers."""

    def __init__(self) -> None:
        self._stick: tuple[Stick, float] | None = None
        self._fixed: Stick | None = None

    def take(self, message: Any, now_s: float) -> None:
        """A MANUAL_CONTROL: stick forward (x) is nose down, twist (r) is rudder, lever (z) is
        thrust."""
        nose_down, rudder, thrust = (
            0.0 if axis == _NOT_GIVEN else max(-1.0, min(1.0, axis / _STICK_FULL))
            for axis in (message.x, message.r, message.z)
        )
        self._stick, self._fixed = (Stick(rudder, -nose_down, thrust), now_s), None

    def fix(self, rudder: float, elevator: float, thrust: float) -> None:
        """Set the actuators until a stick moves or MANUAL is left; NaN leaves one as it is."""
        was = self._fixed or _RELEASED
        given = zip((rudder, elevator, thrust), was, strict=True)
        self._fixed = Stick(*(old if math.isnan(new) else new for new, old in given))

    def stick(self, state: AutopilotState, now_s: float) -> Stick | None:
        """The pilot's hand, None where there is none."""
        if self._fixed is not None:
            if state.armed and state.mode == modes.MANUAL.number:
                return self._fixed
            self._fixed = None
        if self._stick is None or now_s - self._stick[1] > STICK_TIMEOUT_S:
            return None
        return self._stick[0]
