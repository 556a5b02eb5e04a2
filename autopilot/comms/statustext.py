"""What happened, told to everybody: texts, reached mission items, and the mode and home as soon as
they change."""

from collections.abc import Callable

from autopilot.control.types import US_PER_S, Event, Home, ItemReached, Severity
from autopilot.telemetry import identity
from autopilot.vehicle import Vehicle
from mavlink_io import dialect
from mavlink_io.clock import wall_s
from mavlink_io.dialect import MessageType, Values

STATUSTEXT_BYTES = 50
MAX_BURST, MAX_TEXTS_PER_S = 20, 5.0
"""More texts than that drown a slow link and whoever reads them."""

_STATUSTEXT, _ITEM_REACHED = dialect.by_name("STATUSTEXT"), dialect.by_name("MISSION_ITEM_REACHED")
_SENT_ON_CHANGE = dialect.by_name("CURRENT_MODE"), dialect.by_name("HEARTBEAT")
_HOME = dialect.by_name("HOME_POSITION"), dialect.by_name("GPS_GLOBAL_ORIGIN")

Publish = Callable[[MessageType, Values], None]


class Announcer:
    """Turns the vehicle's events and changes into messages."""

    def __init__(
        self,
        vehicle: Vehicle,
        build: Callable[[MessageType], tuple[Values, ...]],
        broadcast: Publish,
        note: Publish,
    ) -> None:
        """``broadcast`` tells and logs, ``note`` only logs."""
        self._vehicle, self._build, self._broadcast, self._note = vehicle, build, broadcast, note
        self._texts = TextBudget()
        self._long_texts = 0
        self._condition: tuple[int, bool, int] | None = self._seen()
        self._home: Home = vehicle.state.home

    def announce(self) -> None:
        """Tell what happened since the last call, mode and home at once when they changed."""
        for event in self._vehicle.pop_events():
            if isinstance(event, ItemReached):
                self._broadcast(_ITEM_REACHED, (event.sequence,))
            else:
                self._tell_text(event)
        condition, home = self._seen(), self._vehicle.state.home
        if condition != self._condition:
            self._condition = condition
            self._tell(_SENT_ON_CHANGE)
        if home != self._home:
            self._home = home
            self._tell(_HOME)

    def remind(self) -> None:
        """Tell the mode at the next call, changed or not."""
        self._condition = None

    def _seen(self) -> tuple[int, bool, int]:
        state = self._vehicle.state
        return state.mode, state.armed, identity.mav_state(state)

    def _tell(self, messages: tuple[MessageType, ...]) -> None:
        for message in messages:
            for values in self._build(message):
                self._broadcast(message, values)

    def _tell_text(self, event: Event) -> None:
        """Send a text in as many chunks as it needs. The log has it even where there are too many
        to send."""
        left_out = self._texts.left_out
        tell = (
            self._broadcast
            if self._texts.allows(event.severity, self._vehicle.state.time_us)
            else self._note
        )
        if left_out and tell is self._broadcast:
            self._chunks(tell, Event(Severity.NOTICE, f"{left_out} messages left out"))
        self._chunks(tell, event)

    def _chunks(self, tell: Publish, event: Event) -> None:
        text = event.text.encode()
        chunks = [text[at : at + STATUSTEXT_BYTES] for at in range(0, len(text), STATUSTEXT_BYTES)]
        number = 0
        if len(chunks) > 1:
            self._long_texts = self._long_texts % 0xFFFF + 1
            number = self._long_texts
        for position, chunk in enumerate(chunks):
            tell(_STATUSTEXT, (int(event.severity), chunk, number, position))


class TextBudget:
    """How many texts may be sent: by wall or vehicle time, whichever goes faster. What is critical
    always may."""

    def __init__(self) -> None:
        self._left = float(MAX_BURST)
        self._wall_s, self._time_us = wall_s(), 0
        self.left_out = 0
        """Since the last one that was sent."""

    def allows(self, severity: Severity, time_us: int) -> bool:
        """Whether a text may be sent now, which is counted."""
        now_s = wall_s()
        elapsed_s = max(now_s - self._wall_s, (time_us - self._time_us) / US_PER_S)
        self._wall_s, self._time_us = now_s, time_us
        self._left = min(float(MAX_BURST), self._left + MAX_TEXTS_PER_S * elapsed_s)
        if self._left < 1.0 and severity > Severity.CRITICAL:
            self.left_out += 1
            return False
        self._left = max(0.0, self._left - 1.0)
        self.left_out = 0
        return True
