"""The vehicle's side of the MAVLink mission protocol.

Source: https://mavlink.io/en/services/mission.html.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from mavlink_io.codec import Frame
from mavlink_io.dialect import has_location
from mavlink_io.frame_order import MAX_FRAMES_LATE, FrameOrders
from mavlink_io.mission_items import (
    ALL_TYPES,
    FRAME_LOCAL_NED,
    FRAME_MISSION,
    GLOBAL_FRAMES,
    MISSION_TYPE,
    NOT_GIVEN,
    MavCmd,
    MissionItem,
)
from mavlink_io.request import Client, MavlinkId, Send
from mavlink_io.services.missions import (
    ACCEPTED,
    CANCELLED,
    DENIED,
    INVALID_PARAM7,
    INVALID_SEQUENCE,
    NO_SPACE,
    UNSUPPORTED,
    UNSUPPORTED_FRAME,
    item_fields,
    item_from_message,
)

RE_REQUEST_S = 1.5
"""Wall time after which a missing item is requested again, in seconds (the protocol's value)."""
RE_REQUESTS = 5
"""Number of repeated requests for one item before the upload is abandoned."""

_BEGINNINGS = "MISSION_COUNT", "MISSION_WRITE_PARTIAL_LIST"
"""Messages that begin an upload."""
OLD_REQUESTS = 2
"""Number of the last requests for the first item that are sent as MISSION_REQUEST."""
GO_TO, CHANGE_DEPTH = 2, 3
"""Values of ``current`` in an item that is a command and no part of a mission (ArduPilot)."""


class MissionProgress(NamedTuple):
    """Progress of the vehicle's mission: the fields of MISSION_CURRENT."""

    sequence: int
    """Number of the current item, from 0."""
    total: int
    """Number of items of the mission."""
    mission_state: int
    """MISSION_STATE."""
    mission_mode: int
    """1 if the vehicle is in a mode that flies the mission, 2 in another mode."""


class MissionResult(NamedTuple):
    """Result of loading a mission."""

    result: int = ACCEPTED
    """MAV_MISSION_RESULT."""
    text: str = ""
    """Reason of a refusal, for the operator; "" if accepted."""


class StoredPlan(Protocol):
    """A plan of a vehicle: mission, geofence or rally points."""

    @property
    def items(self) -> Sequence[MissionItem]:
        """The current plan."""
        ...

    def load(self, items: tuple[MissionItem, ...]) -> MissionResult:
        """Replace the plan, or refuse all of the items."""
        ...


class MissionStore(StoredPlan, Protocol):
    """The mission of a vehicle, as the autopilot implements it."""

    @property
    def progress(self) -> MissionProgress:
        """Progress of the current mission."""
        ...

    def set_current(self, sequence: int) -> bool:
        """Continue at an item; return False if the mission has no such item."""
        ...

    def go_to(self, item: MissionItem) -> MissionResult:
        """Go to the place of an item now, or to its depth if it has no place."""
        ...

    def explain(self, text: str) -> None:
        """Send the operator the reason of a refusal."""
        ...


@dataclass
class _UploadSession:
    """An upload in progress: its sender and the items received so far."""

    client: Client
    frame_sequence: int
    """Sequence number of the frame that began the upload."""
    first: int
    """Number of the first item of the upload; 0 for a whole mission."""
    stop: int
    """Number after the last item of the upload."""
    due_s: float
    """Wall time at which the next item is requested again."""
    whole: bool
    """Whether the items replace the whole plan."""
    kind: int
    """MAV_MISSION_TYPE of the plan."""
    item_request: str
    """Name of the message that requests an item."""
    re_request_s: float
    """Wall time after which an item is requested again."""
    attempts_left: int = RE_REQUESTS
    items: list[MissionItem] = field(default_factory=list)
    sends_floats: bool = False
    """Whether the sender answers with MISSION_ITEM."""

    def request(self, now_s: float) -> None:
        """Request the next item.

        A sender that does not answer for the first item may know only the deprecated messages.
        """
        self.due_s = now_s + self.re_request_s
        needs_old_request = not self.items and self.attempts_left < OLD_REQUESTS
        self.client.send(
            "MISSION_REQUEST" if self.sends_floats or needs_old_request else self.item_request,
            target_system=self.client.mavlink_id.system,
            target_component=self.client.mavlink_id.component,
            seq=self.next_sequence,
            mission_type=self.kind,
        )

    @property
    def next_sequence(self) -> int:
        """Number of the item that is expected next."""
        return self.first + len(self.items)


class MissionServer:
    """Server of the mission protocol: uploads, downloads, clearing and the current item.

    One upload at a time. The old mission stays until the new one is complete and accepted. Frames
    that a link delivers late are ignored: they may belong to an earlier upload.

    Parameters
    ----------
    store : MissionStore
        The vehicle's mission.
    capacity : int
        Maximum number of items of a plan.
    plans : mapping, optional
        The other plans of the vehicle, by MAV_MISSION_TYPE.
    item_request : str
        Message that requests an item: MISSION_REQUEST_INT, or MISSION_REQUEST as ArduPilot.
    """

    message_names = frozenset(
        (
            "MISSION_COUNT",
            "MISSION_ITEM_INT",
            "MISSION_ITEM",
            "MISSION_REQUEST_LIST",
            "MISSION_REQUEST_INT",
            "MISSION_REQUEST",
            "MISSION_CLEAR_ALL",
            "MISSION_SET_CURRENT",
            "MISSION_WRITE_PARTIAL_LIST",
            "MISSION_ACK",
        )
    )

    def __init__(
        self,
        store: MissionStore,
        capacity: int = 1000,
        plans: Mapping[int, StoredPlan] | None = None,
        item_request: str = "MISSION_REQUEST_INT",
    ) -> None:
        self._item_request, self._re_request_s = item_request, RE_REQUEST_S
        self._store, self._capacity = store, capacity
        self._plans: dict[int, StoredPlan] = {MISSION_TYPE: store, **(plans or {})}
        self._session: _UploadSession | None = None
        self._finished: tuple[_UploadSession, int] | None = None
        self._orders, self._frame_sequence = FrameOrders(), 0
        self._handlers = {
            "MISSION_COUNT": self._count,
            "MISSION_ITEM_INT": self._item,
            "MISSION_ITEM": self._item,
            "MISSION_REQUEST_LIST": self._send_count,
            "MISSION_REQUEST_INT": self._send_item,
            "MISSION_REQUEST": self._send_item,
            "MISSION_CLEAR_ALL": self._clear,
            "MISSION_SET_CURRENT": self._set_current,
            "MISSION_WRITE_PARTIAL_LIST": self._partial,
            "MISSION_ACK": self._cancel,
        }

    def feed(
        self, frame: Frame, send: Send, now_s: float, re_request_s: float = RE_REQUEST_S
    ) -> None:
        """Process one frame that is addressed to this vehicle.

        Parameters
        ----------
        frame : Frame
            The frame; other messages than ``message_names`` are ignored.
        send : Send
            Function that sends on the frame's link: the same object for every frame of a link.
        now_s : float
            Wall clock, in seconds.
        re_request_s : float
            Wall time after which a missing item is requested again over this link, in seconds.
        """
        self._re_request_s = re_request_s
        handler = self._handlers.get(frame.name)
        if handler is None:
            return
        client = Client(MavlinkId(frame.system, frame.component), send)
        order = self._orders.of(client)
        if order.is_late(frame.sequence, now_s):
            if not self._begins_again(frame, client):
                return
            order.restart(frame.sequence, now_s)
        self._frame_sequence = frame.sequence
        handler(frame.decode(), client, now_s)

    def _begins_again(self, frame: Frame, client: Client) -> bool:
        """Return whether a late frame begins the upload in progress again.

        Its number is that of the frame that began the upload, or a later one: a frame of an earlier
        upload has a lower number. Either the link has repeated the beginning, or the client has
        started again and counts from 0.
        """
        session = self._session
        return (
            session is not None
            and session.client == client
            and frame.name in _BEGINNINGS
            and frame.sequence - session.frame_sequence & 0xFF <= MAX_FRAMES_LATE
        )

    def poll(self, now_s: float) -> None:
        """Request a missing item again, or abandon an upload whose sender is silent.

        Parameters
        ----------
        now_s : float
            Wall clock, in seconds.
        """
        session = self._session
        if session is None or now_s < session.due_s:
            return
        if session.attempts_left:
            session.attempts_left -= 1
            session.request(now_s)
        else:
            self._end(
                session,
                MissionResult(CANCELLED, "Mission upload abandoned: its sender fell silent"),
            )

    def _count(self, message: Any, client: Client, now_s: float) -> None:
        """Begin the upload of a whole mission."""
        kind = message.mission_type
        if kind not in self._plans:
            _acknowledge(client, UNSUPPORTED, kind)
        elif message.count > self._capacity:
            self._store.explain(
                f"Mission refused: {message.count} items, room for {self._capacity}"
            )
            _acknowledge(client, NO_SPACE, kind)
        else:
            session = _UploadSession(
                client=client,
                frame_sequence=self._frame_sequence,
                first=0,
                stop=message.count,
                due_s=now_s,
                whole=True,
                kind=kind,
                item_request=self._item_request,
                re_request_s=self._re_request_s,
            )
            self._begin(session, now_s)

    def _partial(self, message: Any, client: Client, now_s: float) -> None:
        """Begin an upload that replaces some items of the mission."""
        kind, first, last = message.mission_type, message.start_index, message.end_index
        if kind not in self._plans:
            _acknowledge(client, UNSUPPORTED, kind)
            return
        count = len(self._plans[kind].items)
        if not 0 <= first <= last < count:
            self._store.explain(f"Mission items {first} to {last} refused: the mission has {count}")
            _acknowledge(client, INVALID_SEQUENCE, kind)
        else:
            session = _UploadSession(
                client=client,
                frame_sequence=self._frame_sequence,
                first=first,
                stop=last + 1,
                due_s=now_s,
                whole=False,
                kind=kind,
                item_request=self._item_request,
                re_request_s=self._re_request_s,
            )
            self._begin(session, now_s)

    def _begin(self, session: _UploadSession, now_s: float) -> None:
        """Begin an upload, unless another client is uploading; the same client may start again."""
        if self._session is not None and self._session.client != session.client:
            self._store.explain("Mission upload refused: another is under way")
            _acknowledge(session.client, DENIED, session.kind)
        else:
            self._session, self._finished = session, None
            self._advance(session, now_s)

    def _item(self, message: Any, client: Client, now_s: float) -> None:
        """Process a MISSION_ITEM_INT or MISSION_ITEM of an upload, or a place to go to."""
        if message.current in (GO_TO, CHANGE_DEPTH):
            self._go_to(message, client)
            return
        session = self._session
        if session is None or session.client != client:
            if self._finished is not None and self._finished[0].client == client:
                # the first acknowledgement was lost
                _acknowledge(client, self._finished[1], self._finished[0].kind)
        elif message.mission_type != session.kind or message.seq != session.next_sequence:
            session.request(now_s)
        else:
            session.sends_floats = isinstance(message.x, float)
            self._add_item(session, item_from_message(message), now_s)

    def _go_to(self, message: Any, client: Client) -> None:
        """Go to the place of an item with ``current`` 2; with 3 only to its depth."""
        item = item_from_message(message)
        if message.current == CHANGE_DEPTH:
            item = item._replace(x=NOT_GIVEN, y=NOT_GIVEN)
        fault = _item_fault(item)
        outcome = self._store.go_to(item) if fault.result == ACCEPTED else fault
        if outcome.text:
            self._store.explain(outcome.text)
        _acknowledge(client, outcome.result, item.mission_type)

    def _add_item(self, session: _UploadSession, item: MissionItem, now_s: float) -> None:
        """Add a valid item to the upload; end the upload at an invalid one."""
        fault = _item_fault(item)
        if fault.result != ACCEPTED:
            self._end(session, fault)
        else:
            session.items.append(item)
            session.attempts_left = RE_REQUESTS
            self._advance(session, now_s)

    def _advance(self, session: _UploadSession, now_s: float) -> None:
        """Request the next item, or load the mission if the upload is complete."""
        if session.next_sequence < session.stop:
            session.request(now_s)
            return
        items, plan = tuple(session.items), self._plans[session.kind]
        if not session.whole:
            present = tuple(plan.items)
            items = present[: session.first] + items + present[session.stop :]
        self._end(session, plan.load(items))

    def _cancel(self, message: Any, client: Client, now_s: float) -> None:
        """End an upload whose sender cancels it.

        Source: https://mavlink.io/en/services/mission.html#canceling-operations.
        """
        session = self._session
        if (
            session is not None
            and session.client == client
            and session.kind == message.mission_type
            and message.type == CANCELLED
        ):
            self._session, self._finished = None, (session, CANCELLED)
            self._store.explain("Mission upload cancelled by its sender")

    def _end(self, session: _UploadSession, outcome: MissionResult) -> None:
        """End an upload, report a refusal and acknowledge."""
        self._session, self._finished = None, (session, outcome.result)
        if outcome.text:
            self._store.explain(outcome.text)
        _acknowledge(session.client, outcome.result, session.kind)

    def _send_count(self, message: Any, client: Client, now_s: float) -> None:
        """Answer MISSION_REQUEST_LIST with the number of items.

        A client that asks for a plan has given up its upload of it.
        """
        session = self._session
        if (
            session is not None
            and session.client == client
            and session.kind == message.mission_type
        ):
            text = "Mission upload abandoned: its sender asks for the mission"
            self._end(session, MissionResult(CANCELLED, text))
        client.send(
            "MISSION_COUNT",
            target_system=client.mavlink_id.system,
            target_component=client.mavlink_id.component,
            count=len(self._items(message.mission_type)),
            mission_type=message.mission_type,
        )

    def _send_item(self, message: Any, client: Client, now_s: float) -> None:
        """Answer MISSION_REQUEST_INT and MISSION_REQUEST with the item."""
        items = self._items(message.mission_type)
        if message.seq < len(items):
            client.send("MISSION_ITEM_INT", **item_fields(items[message.seq], client.mavlink_id))
        else:
            _acknowledge(client, INVALID_SEQUENCE, message.mission_type)

    def _clear(self, message: Any, client: Client, now_s: float) -> None:
        """Remove all items, unless an upload is in progress."""
        kind = message.mission_type
        kinds = list(self._plans) if kind == ALL_TYPES else [kind]
        if not self._plans.keys() >= set(kinds):
            outcome = MissionResult(UNSUPPORTED)
        elif self._session is not None:
            outcome = MissionResult(DENIED, "Mission not cleared: an upload is under way")
        else:
            results = [self._plans[kind].load(()) for kind in kinds]
            outcome = next((one for one in results if one.result != ACCEPTED), results[0])
        if outcome.text:
            self._store.explain(outcome.text)
        _acknowledge(client, outcome.result, message.mission_type)

    def _items(self, kind: int) -> Sequence[MissionItem]:
        """Return the items of a kind of plan; none if the vehicle has no such plan."""
        return self._plans[kind].items if kind in self._plans else ()

    def _set_current(self, message: Any, client: Client, now_s: float) -> None:
        """Continue at another item and answer with MISSION_CURRENT."""
        if not self._store.set_current(message.seq):
            self._store.explain(
                f"No mission item {message.seq}: the mission has {len(self._store.items)}"
            )
        send_progress(client.send, self._store.progress)


def send_progress(send: Send, progress: MissionProgress) -> None:
    """Send MISSION_CURRENT.

    Parameters
    ----------
    send : Send
        Function that sends the message.
    progress : MissionProgress
        Fields of the message.
    """
    send(
        "MISSION_CURRENT",
        seq=progress.sequence,
        total=progress.total,
        mission_state=progress.mission_state,
        mission_mode=progress.mission_mode,
    )


def _item_fault(item: MissionItem) -> MissionResult:
    """Return the fault of an item with an unsupported frame or a position above the water.

    The altitude of a fence item or a rally point has no meaning.
    """
    if item.frame not in GLOBAL_FRAMES and item.frame not in (FRAME_LOCAL_NED, FRAME_MISSION):
        return MissionResult(
            UNSUPPORTED_FRAME, f"Mission item {item.sequence}: frame {item.frame} is not supported"
        )
    if item.mission_type != MISSION_TYPE:
        return MissionResult()
    if not (has_location(item.command) or item.command == MavCmd.CONDITION_CHANGE_ALT):
        return MissionResult()
    if item.frame in GLOBAL_FRAMES and item.z > 0.0:
        text = f"Mission item {item.sequence}: altitude {item.z:g} m; depth is given as <= 0"
        return MissionResult(INVALID_PARAM7, text)
    if item.frame == FRAME_LOCAL_NED and item.z < 0.0:
        return MissionResult(
            INVALID_PARAM7, f"Mission item {item.sequence}: z {item.z:g} m; down is positive"
        )
    return MissionResult()


def _acknowledge(client: Client, result: int, mission_type: int = MISSION_TYPE) -> None:
    """Send MISSION_ACK with a MAV_MISSION_RESULT."""
    client.send(
        "MISSION_ACK",
        target_system=client.mavlink_id.system,
        target_component=client.mavlink_id.component,
        type=result,
        mission_type=mission_type,
    )
