"""Routing of frames between ground links, by the systems and components received on each.

The rules are those of https://mavlink.io/en/guide/routing.html: a broadcast goes to every other
link; a message with a target goes to the links on which that system and component was received,
and to none before that. No frame is sent back on the link it came from, and frames of the vehicle
itself are not forwarded.
"""

from collections.abc import Sequence
from functools import cache
from typing import Generic, TypeVar

from mavlink_io import dialect
from mavlink_io.codec import Frame
from mavlink_io.request import MavlinkId

T = TypeVar("T")

BROADCAST = 0
"""Target id of a message for every system or component."""
_SIZES = {f"{sign}int{8 * size}_t": size for size in (1, 2, 4, 8) for sign in ("", "u")}
_SIZES |= {"float": 4, "double": 8, "char": 1}
"""Size of each field type in bytes."""
_NOT_FORWARDED = frozenset(
    dialect.by_name(name).message_id for name in ("SETUP_SIGNING", "RADIO_STATUS")
)
"""A signing key is only for its receiver; RADIO_STATUS describes the line it arrives on."""


class Router(Generic[T]):
    """Routing table learned from received frames. ``T`` is the type of a link."""

    def __init__(self, own: MavlinkId) -> None:
        self._own = own
        self._links_by_sender: dict[MavlinkId, list[T]] = {}

    def learn(self, sender: MavlinkId, link: T) -> None:
        """Record that a frame of ``sender`` arrived on a link."""
        links = self._links_by_sender.setdefault(sender, [])
        if link not in links:
            links.append(link)

    def forget(self, link: T) -> None:
        """Remove a link that is lost."""
        for links in self._links_by_sender.values():
            if link in links:
                links.remove(link)

    def destinations(self, frame: Frame, source_link: T, links: Sequence[T]) -> list[T]:
        """Return the links on which a received frame is forwarded."""
        target = target_of(frame)
        if (
            frame.message_id in _NOT_FORWARDED
            or target == self._own
            or (frame.system, frame.component) == self._own
        ):
            return []
        if target.system == BROADCAST:
            return [link for link in links if link is not source_link]
        reached = [
            link
            for sender, sender_links in self._links_by_sender.items()
            if _is_addressed_to(target, sender)
            for link in sender_links
        ]
        return [link for link in links if link is not source_link and link in reached]


def target_of(frame: Frame) -> MavlinkId:
    """Return the target of a frame; 0 for a broadcast, and for a message without target fields."""
    system_offset, component_offset = _target_offsets(frame.message_id)
    return MavlinkId(_byte(frame.payload, system_offset), _byte(frame.payload, component_offset))


def _is_addressed_to(target: MavlinkId, station: MavlinkId) -> bool:
    """Return whether a target includes a system and component."""
    return target.system == station.system and target.component in (BROADCAST, station.component)


def _byte(payload: bytes, offset: int | None) -> int:
    """Return a byte of a payload; 0 without an offset and where trailing zeros were cut off."""
    return payload[offset] if offset is not None and offset < len(payload) else 0


@cache
def _target_offsets(message_id: int) -> tuple[int | None, int | None]:
    """Return the payload offsets of target system and target component; None without the field."""
    message = dialect.by_id(message_id)
    if message is None:
        return None, None
    return _field_offset(message, ("target_system", "target")), _field_offset(
        message, ("target_component",)
    )


def _field_offset(message: dialect.MessageType, names: tuple[str, ...]) -> int | None:
    """Return the payload offset of the first uint8_t field with one of the names."""
    offset = 0
    for field in message.fields:
        if field.name in names and field.type == "uint8_t" and not field.array_length:
            return offset
        offset += _SIZES[field.type] * max(1, field.array_length)
    return None
