"""The ground's side of the MAVLink mission protocol, and the messages of mission items.

Source: https://mavlink.io/en/services/mission.html.

Items are transferred unchanged: the autopilot interprets them. A mission arrives completely or not
at all.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeVar

from mavlink_io.dialect import constant, enum_names
from mavlink_io.frame_order import FrameOrder
from mavlink_io.mission_items import (
    FENCE_TYPE,
    FRAME_LOCAL_NED,
    GLOBAL_FRAMES,
    GLOBAL_SCALE,
    LOCAL_SCALE,
    MISSION_TYPE,
    NOT_GIVEN,
    RALLY_TYPE,
    MissionItem,
)
from mavlink_io.request import Exchange, MavlinkId, Send

T = TypeVar("T")

ACCEPTED = constant("MAV_MISSION_ACCEPTED")
NO_SPACE = constant("MAV_MISSION_NO_SPACE")
UNSUPPORTED = constant("MAV_MISSION_UNSUPPORTED")
UNSUPPORTED_FRAME = constant("MAV_MISSION_UNSUPPORTED_FRAME")
INVALID = constant("MAV_MISSION_INVALID")
INVALID_PARAM1 = constant("MAV_MISSION_INVALID_PARAM1")
INVALID_PARAM7 = constant("MAV_MISSION_INVALID_PARAM7")
"""INVALID_PARAM1 + n - 1 is the result for parameter n; x is 5, y is 6 and z is 7."""
INVALID_SEQUENCE = constant("MAV_MISSION_INVALID_SEQUENCE")
DENIED = constant("MAV_MISSION_DENIED")
CANCELLED = constant("MAV_MISSION_OPERATION_CANCELLED")


_PLAN_NAMES = {MISSION_TYPE: "mission", FENCE_TYPE: "geofence", RALLY_TYPE: "rally points"}


def item_from_message(message: Any) -> MissionItem:
    """Return the item in a MISSION_ITEM_INT, or in the deprecated MISSION_ITEM.

    Parameters
    ----------
    message : namedtuple
        Decoded message; x and y of a MISSION_ITEM are degrees, metres or plain numbers.

    Returns
    -------
    MissionItem
        The item, unchanged except for the unit of x and y; a number that does not fit is
        NOT_GIVEN.
    """
    x, y = message.x, message.y
    if isinstance(x, float):
        scale = GLOBAL_SCALE if message.frame in GLOBAL_FRAMES else 1
        scale = LOCAL_SCALE if message.frame == FRAME_LOCAL_NED else scale
        x, y = (_scaled(value, scale) for value in (x, y))
    return MissionItem(
        sequence=message.seq,
        frame=message.frame,
        command=message.command,
        current=message.current,
        autocontinue=message.autocontinue,
        p1=message.param1,
        p2=message.param2,
        p3=message.param3,
        p4=message.param4,
        x=x,
        y=y,
        z=message.z,
        mission_type=message.mission_type,
    )


def _scaled(value: float, scale: int) -> int:
    """Return a coordinate as an integer; NOT_GIVEN for NaN or a number beyond int32."""
    number = value * scale
    return round(number) if abs(number) < NOT_GIVEN else NOT_GIVEN


def item_fields(item: MissionItem, receiver: MavlinkId) -> dict[str, Any]:
    """Return the fields of the MISSION_ITEM_INT that carries an item.

    Parameters
    ----------
    item : MissionItem
        The item.
    receiver : MavlinkId
        Target of the message.

    Returns
    -------
    dict
        Field values by name.
    """
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
    """Client of the mission protocol; each method returns an exchange that has not started.

    Feed and poll the exchange until it is done (``request.run``).

    Parameters
    ----------
    send : Send
        Function that sends a message to the vehicle.
    own, peer : MavlinkId
        Ids of this program and of the vehicle.
    """

    def __init__(self, send: Send, own: MavlinkId, peer: MavlinkId) -> None:
        self._participants = send, own, peer
        self._order = FrameOrder()
        self._last_upload: _Upload | None = None

    def upload(
        self, items: Sequence[MissionItem], mission_type: int = MISSION_TYPE
    ) -> Exchange[None]:
        """Replace the vehicle's mission, geofence or rally points.

        Parameters
        ----------
        items : sequence of MissionItem
            The new plan. The items are renumbered from 0.
        mission_type : int
            MAV_MISSION_TYPE of the plan.

        Returns
        -------
        Exchange
            It fails if the vehicle refuses the mission.
        """
        last = self._last_upload
        self._last_upload = _Upload(
            *self._participants,
            _Plan(mission_type, self._order),
            tuple(items),
            after_failure=last is not None and not last.accepted,
        )
        return self._last_upload

    def download(self, mission_type: int = MISSION_TYPE) -> Exchange[tuple[MissionItem, ...]]:
        """Read a plan of the vehicle.

        Parameters
        ----------
        mission_type : int
            MAV_MISSION_TYPE of the plan: mission (default), fence or rally points.

        Returns
        -------
        Exchange
            Its result is the tuple of items.
        """
        return _PlanDownload(*self._participants, _Plan(mission_type, self._order))

    def clear(self) -> Exchange[None]:
        """Remove all items of the vehicle's mission.

        Returns
        -------
        Exchange
            It fails if the vehicle refuses.
        """
        return _Clear(*self._participants)

    def set_current(self, sequence: int) -> Exchange[int]:
        """Make the vehicle continue its mission at an item.

        Parameters
        ----------
        sequence : int
            Number of the item, from 0.

        Returns
        -------
        Exchange
            Its result is the number of the item that the vehicle reports as current.
        """
        return _SetCurrent(*self._participants, sequence)


class _Plan(NamedTuple):
    """Plan of an exchange, and the order of the vehicle's frames."""

    mission_type: int
    """MAV_MISSION_TYPE."""
    order: FrameOrder
    """Order of the vehicle's frames over all uploads and downloads: an answer to an earlier one is
    late."""


class _PlanExchange(Exchange[T]):
    """Exchange of the items of a plan, which ignores frames that the link has delivered late."""

    in_order = True

    def __init__(self, send: Send, own: MavlinkId, peer: MavlinkId, plan: _Plan) -> None:
        super().__init__(send, own, peer)
        self._type, self._order = plan


class _Upload(_PlanExchange[None]):
    """Announce the number of items, then send each item that the vehicle requests.

    After an upload that failed, the vehicle may still receive a late MISSION_COUNT of it, and would
    load as many items of this one. Therefore this upload begins with MISSION_REQUEST_LIST: the
    answer shows that the vehicle has received a newer frame than all of the failed upload.

    The vehicle requests the items in order. A request that skips an item belongs to an upload of
    another program or with another number of items: the number is announced again.
    """

    message_names = frozenset(
        ("MISSION_COUNT", "MISSION_REQUEST_INT", "MISSION_REQUEST", "MISSION_ACK")
    )

    def __init__(
        self,
        send: Send,
        own: MavlinkId,
        peer: MavlinkId,
        plan: _Plan,
        items: tuple[MissionItem, ...],
        *,
        after_failure: bool,
    ) -> None:
        super().__init__(send, own, peer, plan)
        self._awaits_count = after_failure
        self._items = tuple(
            item._replace(sequence=n, mission_type=self._type) for n, item in enumerate(items)
        )
        self._requested_item: int | None = None
        self._last_item = -1
        """Largest number of an item that the vehicle has requested."""

    @property
    def accepted(self) -> bool:
        """Whether the vehicle has accepted the items."""
        return self.done and not self._error

    def _send_request(self) -> None:
        """Send the number of items, or the item that the vehicle has requested."""
        if self._awaits_count:
            self._send_to_peer("MISSION_REQUEST_LIST", mission_type=self._type)
        elif self._requested_item is None:
            self._send_to_peer("MISSION_COUNT", count=len(self._items), mission_type=self._type)
        else:
            item = self._items[self._requested_item]
            self._send("MISSION_ITEM_INT", **item_fields(item, self._peer))

    def _handle_message(self, name: str, message: Any) -> None:
        """Send a requested item; finish or fail with the vehicle's MISSION_ACK."""
        if message.mission_type != self._type or self._awaits_count != (name == "MISSION_COUNT"):
            return
        if name == "MISSION_COUNT":
            self._awaits_count = False
            self._send_request()
            self._note_progress()
        elif name != "MISSION_ACK":
            self._send_requested(message.seq)
        elif message.type != ACCEPTED:
            position = "" if self._requested_item is None else f" after item {self._requested_item}"
            plan, result = _PLAN_NAMES[self._type], _result_name(message.type)
            self._fail(f"the vehicle refused the {plan}{position}: {result}")
        elif not self._items or self._requested_item == len(self._items) - 1:
            self._finish(None)
        elif self._requested_item is not None:
            # The vehicle has asked by the number of items of an earlier upload, and has fewer.
            self._requested_item = None
            self._send_request()

    def _send_requested(self, sequence: int) -> None:
        """Send an item, or the number of items if the request does not belong to this upload."""
        next_item = 0 if self._requested_item is None else self._requested_item + 1
        if sequence > min(next_item, len(self._items) - 1):
            self._requested_item = None
        else:
            self._requested_item = sequence
            self._note_progress(is_new=sequence > self._last_item)
            self._last_item = max(self._last_item, sequence)
        self._send_request()

    def _describe(self) -> str:
        return f"the upload of {len(self._items)} items of the {_PLAN_NAMES[self._type]}"


class _PlanDownload(_PlanExchange[tuple[MissionItem, ...]]):
    """Request the number of items, then each item in order."""

    message_names = frozenset(("MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ACK"))

    def __init__(self, send: Send, own: MavlinkId, peer: MavlinkId, plan: _Plan) -> None:
        super().__init__(send, own, peer, plan)
        self._count: int | None = None
        self._items: list[MissionItem] = []

    def _send_request(self) -> None:
        """Request the number of items, or the next item."""
        if self._count is None:
            self._send_to_peer("MISSION_REQUEST_LIST", mission_type=self._type)
        else:
            self._send_to_peer("MISSION_REQUEST_INT", seq=len(self._items), mission_type=self._type)

    def _handle_message(self, name: str, message: Any) -> None:
        """Store the number of items or the next item; finish when all have arrived."""
        if message.mission_type != self._type:
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
            self._send_to_peer("MISSION_ACK", type=ACCEPTED, mission_type=self._type)
            self._finish(tuple(self._items))

    def _describe(self) -> str:
        return "the mission download"


class _Clear(Exchange[None]):
    """Send MISSION_CLEAR_ALL until it is acknowledged."""

    message_names = frozenset(("MISSION_ACK",))

    def _send_request(self) -> None:
        self._send_to_peer("MISSION_CLEAR_ALL", mission_type=MISSION_TYPE)

    def _handle_message(self, name: str, message: Any) -> None:
        """Finish or fail with the vehicle's MISSION_ACK."""
        if message.type == ACCEPTED:
            self._finish(None)
        else:
            self._fail(f"the vehicle kept its mission: {_result_name(message.type)}")

    def _describe(self) -> str:
        return "the clearing of the mission"


class _SetCurrent(Exchange[int]):
    """Send MISSION_SET_CURRENT until MISSION_CURRENT reports the item."""

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
    """Return the name of a MAV_MISSION_RESULT."""
    return enum_names("MAV_MISSION_RESULT").get(result, f"MAV_MISSION_RESULT {result}")
