"""The MAVLink mission protocol: its items and ground's end of it
(https://mavlink.io/en/services/mission.html).

Items are stored and given back as they came. What a mission means is the autopilot's business; this
file sees to it that it arrives whole or not at all."""

from collections.abc import Sequence
from typing import Any

from mavlink_io.dialect import constant, enum_names
from mavlink_io.mission_items import (
    MISSION_TYPE,
    MissionItem,
)
from mavlink_io.request import Exchange, MavlinkId, Send

ACCEPTED = constant("MAV_MISSION_ACCEPTED")
NO_SPACE = constant("MAV_MISSION_NO_SPACE")
UNSUPPORTED = constant("MAV_MISSION_UNSUPPORTED")
UNSUPPORTED_FRAME = constant("MAV_MISSION_UNSUPPORTED_FRAME")
INVALID = constant("MAV_MISSION_INVALID")
INVALID_PARAM1 = constant("MAV_MISSION_INVALID_PARAM1")
INVALID_PARAM7 = constant("MAV_MISSION_INVALID_PARAM7")
"""Between the two lie the results for param2 to param4, x (5) and y (6)."""
INVALID_SEQUENCE = constant("MAV_MISSION_INVALID_SEQUENCE")
DENIED = constant("MAV_MISSION_DENIED")
CANCELLED = constant("MAV_MISSION_OPERATION_CANCELLED")


def item_from_message(message: Any) -> MissionItem:
    """The item in a decoded MISSION_ITEM_INT."""
    m = message
    return MissionItem(
        m.seq,
        m.frame,
        m.command,
        m.current,
        m.autocontinue,
        m.param1,
        m.param2,
        m.param3,
        m.param4,
        m.x,
        m.y,
        m.z,
        m.mission_type,
    )


def item_fields(item: MissionItem, receiver: MavlinkId) -> dict[str, Any]:
    """The fields of the MISSION_ITEM_INT that carries an item."""
    return {
        "target_system": receiver.system,
        "target_component": receiver.component,
        "seq": item.sequence,
        "frame": item.frame,
        "command": item.command,
        "current": item.current,
        "autocontinue": item.autocontinue,
        "param1": item.p1,
        "param2": item.p2,
        "param3": item.p3,
        "param4": item.p4,
        "x": item.x,
        "y": item.y,
        "z": item.z,
        "mission_type": item.mission_type,
    }


class MissionClient:
    """The ground's side: each method begins an exchange, to be fed and polled until it is done."""

    def __init__(self, send: Send, own: MavlinkId, peer: MavlinkId) -> None:
        self._line = send, own, peer

    def upload(self, items: Sequence[MissionItem]) -> Exchange[None]:
        """Replace the vehicle's mission."""
        return _Upload(*self._line, tuple(items))

    def download(self) -> Exchange[tuple[MissionItem, ...]]:
        """Fetch the vehicle's mission."""
        return _MissionDownload(*self._line)

    def clear(self) -> Exchange[None]:
        """Empty the vehicle's mission."""
        return _Clear(*self._line)

    def set_current(self, sequence: int) -> Exchange[int]:
        """Have the vehicle go on from an item; the result is the item it reports."""
        return _SetCurrent(*self._line, sequence)


class _Upload(Exchange[None]):
    message_names = frozenset(("MISSION_REQUEST_INT", "MISSION_REQUEST", "MISSION_ACK"))

    def __init__(
        self, send: Send, own: MavlinkId, peer: MavlinkId, items: tuple[MissionItem, ...]
    ) -> None:
        super().__init__(send, own, peer)
        self._items = tuple(
            item._replace(sequence=n, mission_type=MISSION_TYPE) for n, item in enumerate(items)
        )
        self._wanted: int | None = None

    def _send_request(self) -> None:
        if self._wanted is None:
            self._send_to_peer("MISSION_COUNT", count=len(self._items), mission_type=MISSION_TYPE)
        else:
            self._send("MISSION_ITEM_INT", **item_fields(self._items[self._wanted], self._peer))

    def _handle_message(self, name: str, message: Any) -> None:
        if message.mission_type != MISSION_TYPE:
            return
        if name != "MISSION_ACK":
            if message.seq < len(self._items):
                self._wanted = message.seq
                self._send_request()
                self._note_progress()
        elif message.type != ACCEPTED:
            where = "" if self._wanted is None else f" at item {self._wanted}"
            self._fail(f"the vehicle refused the mission{where}: {_result_name(message.type)}")
        elif not self._items or self._wanted == len(self._items) - 1:
            self._finish(None)

    def _describe(self) -> str:
        return f"the upload of {len(self._items)} mission items"


class _MissionDownload(Exchange[tuple[MissionItem, ...]]):
    message_names = frozenset(("MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ACK"))

    def __init__(self, send: Send, own: MavlinkId, peer: MavlinkId) -> None:
        super().__init__(send, own, peer)
        self._count: int | None = None
        self._items: list[MissionItem] = []

    def _send_request(self) -> None:
        if self._count is None:
            self._send_to_peer("MISSION_REQUEST_LIST", mission_type=MISSION_TYPE)
        else:
            self._send_to_peer(
                "MISSION_REQUEST_INT", seq=len(self._items), mission_type=MISSION_TYPE
            )

    def _handle_message(self, name: str, message: Any) -> None:
        if message.mission_type != MISSION_TYPE:
            return
        if name == "MISSION_ACK":
            if message.type != ACCEPTED:
                self._fail(f"the vehicle did not give its mission: {_result_name(message.type)}")
            return
        if name == "MISSION_COUNT" and self._count is None:
            self._count = message.count
        elif (
            name == "MISSION_ITEM_INT"
            and self._count is not None
            and message.seq == len(self._items)
        ):
            self._items.append(item_from_message(message))
        else:
            return
        self._note_progress()
        if len(self._items) < self._count:
            self._send_request()
        else:
            self._send_to_peer("MISSION_ACK", type=ACCEPTED, mission_type=MISSION_TYPE)
            self._finish(tuple(self._items))

    def _describe(self) -> str:
        return "the mission download"


class _Clear(Exchange[None]):
    message_names = frozenset(("MISSION_ACK",))

    def _send_request(self) -> None:
        self._send_to_peer("MISSION_CLEAR_ALL", mission_type=MISSION_TYPE)

    def _handle_message(self, name: str, message: Any) -> None:
        if message.type == ACCEPTED:
            self._finish(None)
        else:
            self._fail(f"the vehicle kept its mission: {_result_name(message.type)}")

    def _describe(self) -> str:
        return "the clearing of the mission"


class _SetCurrent(Exchange[int]):
    message_names = frozenset(("MISSION_CURRENT",))

    def __init__(self, send: Send, own: MavlinkId, peer: MavlinkId, sequence: int) -> None:
        super().__init__(send, own, peer)
        self._sequence = sequence

    def _send_request(self) -> None:
        self._send_to_peer("MISSION_SET_CURRENT", seq=self._sequence)

    def _handle_message(self, name: str, message: Any) -> None:
        if message.seq == self._sequence:
            self._finish(message.seq)

    def _describe(self) -> str:
        return f"the choice of mission item {self._sequence}"


def _result_name(result: int) -> str:
    return enum_names("MAV_MISSION_RESULT").get(result, f"MAV_MISSION_RESULT {result}")
