"""Manual control: stick messages of a pilot, or actuator positions set once."""

import math
from typing import Any

from autopilot.control import modes
from autopilot.control.types import AutopilotState, Stick

STICK_TIMEOUT_S = 1.5
"""Wall time without a stick message after which there is no manual control."""
_NOT_GIVEN = 32_767
"""Value of an axis that the sender does not have (MANUAL_CONTROL)."""
_STICK_FULL = 1000.0
"""Full deflection of an axis (MANUAL_CONTROL)."""
_RELEASED = Stick(0.0, 0.0, 0.0)


class Helm:
    """Latest manual control input."""

    def __init__(self) -> None:
        self._stick: tuple[Stick, float] | None = None
        self._fixed: Stick | None = None

    @property
    def in_use(self) -> bool:
        """Whether there may be manual control."""
        return self._stick is not None or self._fixed is not None

    def take(self, message: Any, now_s: float) -> None:
        """Take a MANUAL_CONTROL message: x forward is nose down, r is rudder, z is thrust.

        Parameters
        ----------
        message
            Decoded message with the axes x, r and z, each in [-1000, 1000].
        now_s
            Wall time.
        """
        nose_down, rudder, thrust = (
            0.0 if axis == _NOT_GIVEN else max(-1.0, min(1.0, axis / _STICK_FULL))
            for axis in (message.x, message.r, message.z)
        )
        self._stick, self._fixed = (Stick(rudder, -nose_down, thrust), now_s), None

    def fix(self, rudder: float, elevator: float, thrust: float) -> None:
        """Set the actuators until a stick message comes or mode MANUAL ends.

        Parameters
        ----------
        rudder, elevator, thrust
            Commands in [-1, 1]; NaN keeps the present command.
        """
        previous = self._fixed or _RELEASED
        pairs = zip((rudder, elevator, thrust), previous, strict=True)
        self._fixed = Stick(*(old if math.isnan(new) else new for new, old in pairs))

    def stick(self, state: AutopilotState, now_s: float) -> Stick | None:
        """Return the manual control at wall time ``now_s``; None if there is none."""
        if self._fixed is not None:
            if state.armed and state.mode == modes.MANUAL.number:
                return self._fixed
            self._fixed = None
        if self._stick is None or now_s - self._stick[1] > STICK_TIMEOUT_S:
            return None
        return self._stick[0]
