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
_ARDUSUB_NEUTRAL, _ARDUSUB_FULL = 500.0, 500.0
"""Neutral value and full deflection of ArduSub's axis z, 0 (dive) to 1000 (climb)."""

CHANNEL_TIMEOUT_S = 3.0
"""Wall time after which RC_CHANNELS_OVERRIDE is released (ArduPilot's RC_OVERRIDE_TIME)."""
_NEUTRAL_US, _FULL_US = 1500, 400
"""Neutral pulse width and full deflection of a channel."""
_RELEASE_US, _KEEP_US = 0, 65_535
"""Values of a channel that release it, and that leave it unchanged (RC_CHANNELS_OVERRIDE)."""
_PITCH, _HEAVE, _YAW, _FORWARD = 0, 2, 3, 4
"""Index of ArduSub's channels 1, 3, 4 and 5; roll and lateral (2, 6) have no actuator here."""
_OVERRIDE_CHANNELS = 8
"""Number of channels that may be overridden."""


class Helm:
    """Latest manual control input."""

    def __init__(self) -> None:
        self._stick: tuple[Stick, float] | None = None
        """Stick, and the wall time until which it is valid."""
        self._channels_us = [_RELEASE_US] * _OVERRIDE_CHANNELS
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
        nose_down, rudder, thrust = map(_deflection, (message.x, message.r, message.z))
        self._hold(Stick(rudder, -nose_down, thrust), now_s + STICK_TIMEOUT_S)

    def take_ardusub(self, message: Any, now_s: float) -> None:
        """Take a MANUAL_CONTROL message with ArduSub's axes: z is neutral at 500.

        x forward is thrust, r is rudder, z above 500 is nose up. Parameters as in ``take``.
        """
        thrust, rudder = map(_deflection, (message.x, message.r))
        nose_up = 0.0
        if message.z != _NOT_GIVEN:
            nose_up = _limited((message.z - _ARDUSUB_NEUTRAL) / _ARDUSUB_FULL)
        self._hold(Stick(rudder, nose_up, thrust), now_s + STICK_TIMEOUT_S)

    def take_channels(self, message: Any, now_s: float) -> None:
        """Take RC_CHANNELS_OVERRIDE with ArduSub's channels.

        Channel 5 is thrust, 4 is rudder, 1 (pitch) and 3 (heave) are the elevator, nose up above
        1500 us. When every channel is released there is no manual control.

        Parameters
        ----------
        message
            Decoded message with pulse widths (us); 0 releases a channel, 65535 leaves it unchanged.
        now_s
            Wall time.
        """
        if self._stick is None or now_s > self._stick[1]:
            self._channels_us = [_RELEASE_US] * _OVERRIDE_CHANNELS
        for index in range(_OVERRIDE_CHANNELS):
            pulse_us = getattr(message, f"chan{index + 1}_raw")
            if pulse_us != _KEEP_US:
                self._channels_us[index] = pulse_us
        if not any(self._channels_us):
            self._stick = None
            return
        pitch, heave, rudder, thrust = (
            0.0 if pulse_us == _RELEASE_US else _limited((pulse_us - _NEUTRAL_US) / _FULL_US)
            for pulse_us in (self._channels_us[n] for n in (_PITCH, _HEAVE, _YAW, _FORWARD))
        )
        self._hold(Stick(rudder, _limited(pitch + heave), thrust), now_s + CHANNEL_TIMEOUT_S)

    def _hold(self, stick: Stick, until_s: float) -> None:
        """Use a stick until a wall time; it replaces fixed actuators."""
        self._stick, self._fixed = (stick, until_s), None

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
        if self._stick is None or now_s > self._stick[1]:
            return None
        return self._stick[0]


def channels_of(stick: Stick) -> tuple[int, ...]:
    """Return a stick as the pulse widths (us) of ArduSub's first eight channels."""
    channels_us = [_NEUTRAL_US] * _OVERRIDE_CHANNELS
    for index, deflection in (
        (_HEAVE, stick.elevator),
        (_YAW, stick.rudder),
        (_FORWARD, stick.thrust),
    ):
        channels_us[index] = round(_NEUTRAL_US + _FULL_US * deflection)
    return tuple(channels_us)


def _deflection(axis: int) -> float:
    """Return an axis of MANUAL_CONTROL in [-1, 1]; 0 if it is not given."""
    return 0.0 if axis == _NOT_GIVEN else _limited(axis / _STICK_FULL)


def _limited(deflection: float) -> float:
    """Return a deflection limited to [-1, 1]."""
    return max(-1.0, min(1.0, deflection))
