"""Events as messages: STATUSTEXT, reached mission items, and changes of mode and home."""

from collections.abc import Callable

from autopilot.control.types import US_PER_S, Event, Home, ItemReached, Severity
from autopilot.telemetry import identity
from autopilot.vehicle import Vehicle
from mavlink_io import dialect
from mavlink_io.clock import wall_s
from mavlink_io.dialect import MessageType, Values

STATUSTEXT_BYTES = 50
"""Length of STATUSTEXT.text."""
MAX_BURST, MAX_TEXTS_PER_S = 20, 5.0
"""Limits of the text rate: more texts overload a slow link and its reader."""

_STATUSTEXT, _ITEM_REACHED = dialect.by_name("STATUSTEXT"), dialect.by_name("MISSION_ITEM_REACHED")
_CURRENT_MODE, _HEARTBEAT = dialect.by_name("CURRENT_MODE"), dialect.by_name("HEARTBEAT")
_HOME = dialect.by_name("HOME_POSITION"), dialect.by_name("GPS_GLOBAL_ORIGIN")

Publish = Callable[[MessageType, Values], None]


class EventPublisher:
    """Publishes the events and state changes of the vehicle as messages."""

    def __init__(
        self,
        vehicle: Vehicle,
        build: Callable[[MessageType], tuple[Values, ...]],
        broadcast: Publish,
        log: Publish,
    ) -> None:
        """``broadcast`` sends and logs a message, ``log`` only logs it."""
        self._vehicle, self._build, self._broadcast, self._log = vehicle, build, broadcast, log
        self._rate_limiter = TextRateLimiter()
        self._long_texts = 0
        self._changes = -1
        """``Vehicle.changes`` at the last call."""
        self._published: tuple[int, bool, int] | None = self._read_state()
        self._home: Home = vehicle.state.home

    def publish(self) -> None:
        """Publish the events since the last call, and mode and home when they have changed."""
        changes = self._vehicle.changes
        if changes == self._changes and not self._vehicle.has_events:
            return
        self._changes = changes
        for event in self._vehicle.pop_events():
            if isinstance(event, ItemReached):
                self._broadcast(_ITEM_REACHED, (event.sequence,))
            else:
                self._publish_text(event)
        state, published, home = self._read_state(), self._published, self._vehicle.state.home
        self._published = state
        if published is None or state[0] != published[0]:
            self._publish_messages((_CURRENT_MODE,))
        if state != published:
            self._publish_messages((_HEARTBEAT,))
        if home != self._home:
            self._home = home
            self._publish_messages(_HOME)

    def resend_mode(self) -> None:
        """Publish the mode at the next call, changed or not."""
        self._published, self._changes = None, -1

    def _read_state(self) -> tuple[int, bool, int]:
        """Return mode, arming state and MAV_STATE."""
        state = self._vehicle.state
        return state.mode, state.armed, identity.mav_state(state)

    def _publish_messages(self, messages: tuple[MessageType, ...]) -> None:
        """Build and broadcast messages."""
        for message in messages:
            for values in self._build(message):
                self._broadcast(message, values)

    def _publish_text(self, event: Event) -> None:
        """Broadcast a text; only log it when too many texts were sent."""
        dropped = self._rate_limiter.dropped
        publish = (
            self._broadcast
            if self._rate_limiter.allows(event.severity, self._vehicle.time_us)
            else self._log
        )
        if dropped and publish is self._broadcast:
            self._publish_chunks(publish, Event(Severity.NOTICE, f"{dropped} messages left out"))
        self._publish_chunks(publish, event)

    def _publish_chunks(self, publish: Publish, event: Event) -> None:
        """Publish a text in as many STATUSTEXTs as it needs.

        Characters outside ASCII are escaped: a chunk could end within the bytes of one.
        """
        text = event.text.encode("ascii", "backslashreplace")
        starts = range(0, len(text), STATUSTEXT_BYTES)
        chunks = [text[start : start + STATUSTEXT_BYTES] for start in starts]
        number = 0
        if len(chunks) > 1:
            self._long_texts = self._long_texts % 0xFFFF + 1
            number = self._long_texts
            if len(chunks[-1]) == STATUSTEXT_BYTES:
                chunks.append(b"")  # a chunk with a NUL ends the text
        for position, chunk in enumerate(chunks):
            publish(_STATUSTEXT, (int(event.severity), chunk, number, position))


class TextRateLimiter:
    """Rate limit of texts, by wall or vehicle time, whichever is faster.

    Texts of severity CRITICAL and above are always sent.
    """

    def __init__(self) -> None:
        self._available = float(MAX_BURST)
        self._wall_s, self._time_us = wall_s(), 0
        self.dropped = 0
        """Number of texts dropped since the last one that was sent."""

    def allows(self, severity: Severity, time_us: int) -> bool:
        """Count a text; return whether it may be sent now."""
        now_s = wall_s()
        elapsed_s = max(now_s - self._wall_s, (time_us - self._time_us) / US_PER_S)
        self._wall_s, self._time_us = now_s, time_us
        self._available = min(float(MAX_BURST), self._available + MAX_TEXTS_PER_S * elapsed_s)
        if self._available < 1.0 and severity > Severity.CRITICAL:
            self.dropped += 1
            return False
        self._available = max(0.0, self._available - 1.0)
        self.dropped = 0
        return True
