"""Who is reached by which link: what arrives on one goes on to those on the others that it is meant
for.

The rules are those of https://mavlink.io/en/guide/routing.html: a message for everybody goes to
every other link; one for somebody goes to the links on which that system and component was heard,
and nowhere while it was not; none goes back to where it came from, and the vehicle's own words,
should they come back, are not repeated."""

from collections.abc import Sequence
from functools import cache
from typing import Generic, TypeVar

from mavlink_io import dialect
from mavlink_io.codec import Frame
from mavlink_io.request import MavlinkId

T = TypeVar("T")

BROADCAST = 0
_SIZES = {f"{sign}int{8 * size}_t": size for size in (1, 2, 4, 8) for sign in ("", "u")}
_SIZES |= {"float": 4, "double": 8, "char": 1}
_NOT_FORWARDED = frozenset(
    dialect.by_name(name).message_id for name in ("SETUP_SIGNING", "RADIO_STATUS")
)
"""A key is for the ears of its receiver alone; and a radio speaks of the line that it stands on."""


class Router(Generic[T]):
    """What was learnt from the traffic. ``T`` is a link."""

    def __init__(self, own: MavlinkId) -> None:
        self._own = own
        self._heard: dict[MavlinkId, list[T]] = {}

    def learn(self, sender: MavlinkId, link: T) -> None:
        """``sender`` was heard on a link."""
        links = self._heard.setdefault(sender, [])
        if link not in links:
            links.append(link)

    def forget(self, link: T) -> None:
        """A link is gone."""
        for links in self._heard.values():
            if link in links:
                links.remove(link)

    def onward(self, frame: Frame, arrival: T, links: Sequence[T]) -> list[T]:
        """Those of the links by which a frame goes on."""
        target = target_of(frame)
        if (
            frame.message_id in _NOT_FORWARDED
            or target == self._own
            or (frame.system, frame.component) == self._own
        ):
            return []
        if target.system == BROADCAST:
            return [link for link in links if link is not arrival]
        reached = [
            link
            for party, heard in self._heard.items()
            if _is_addressed_to(target, party)
            for link in heard
        ]
        return [link for link in links if link is not arrival and link in reached]


def target_of(frame: Frame) -> MavlinkId:
    """Whom a frame is for; 0 stands for everybody, and for a message that names nobody."""
    at_system, at_component = _target_offsets(frame.message_id)
    return MavlinkId(_byte(frame.payload, at_system), _byte(frame.payload, at_component))


def _is_addressed_to(target: MavlinkId, party: MavlinkId) -> bool:
    return target.system == party.system and target.component in (BROADCAST, party.component)


def _byte(payload: bytes, at: int | None) -> int:
    """A payload's byte; where it was cut off, or there is none, 0."""
    return payload[at] if at is not None and at < len(payload) else 0


@cache
def _target_offsets(message_id: int) -> tuple[int | None, int | None]:
    """Where in its payload a message names its target system and component."""
    message = dialect.by_id(message_id)
    if message is None:
        return None, None
    return _field_offset(message, ("target_system", "target")), _field_offset(
        message, ("target_component",)
    )


def _field_offset(message: dialect.MessageType, names: tuple[str, ...]) -> int | None:
    """The offset of the first byte field of one of these names."""
    at = 0
    for field in message.fields:
        if field.name in names and field.type == "uint8_t" and not field.array_length:
            return at
        at += _SIZES[field.type] * max(1, field.array_length)
    return None
