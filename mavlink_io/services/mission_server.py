"""The vehicle's end of the MAVLink mission protocol
(https://mavlink.io/en/services/mission.html)."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from mavlink_io.codec import Frame
from mavlink_io.dialect import has_location
from mavlink_io.mission_items import (
    ALL_TYPES,
    FRAME_LOCAL_NED,
    FRAME_MISSION,
    GLOBAL_FRAMES,
    MISSION_TYPE,
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
"""Wall seconds after which an item that did not come is asked for again (the protocol's
recommendation)."""
RE_REQUESTS = 5


class MissionProgress(NamedTuple):
    """How far the vehicle has come, as MISSION_CURRENT tells it."""

    sequence: int
    total: int
    mission_state: int
    """MISSION_STATE."""
    mission_mode: int
    """1 in a mode that flies the mission, 2 in another."""


class MissionResult(NamedTuple):
    """What became of an offered mission: a MAV_MISSION_RESULT and, where it was refused, why."""

    result: int = ACCEPTED
    text: str = ""


class MissionStore(Protocol):
    """What the vehicle does with missions."""

    @property
    def items(self) -> Sequence[MissionItem]: ...

    @property
    def progress(self) -> MissionProgress: ...

    def load(self, items: tuple[MissionItem, ...]) -> MissionResult:
        """Take a whole new mission, or none of it."""
        ...

    def set_current(self, sequence: int) -> bool:
        """Go on from an item; False when there is no such item."""
        ...

    def explain(self, text: str) -> None:
        """Tell people why something was refused."""
        ...


@dataclass
class _UploadSession:
    """An upload under way: who sends it, what has come."""

    client: Client
    first: int
    """Of the items that are sent: the whole mission begins with 0."""
    stop: int
    """After their last."""
    due_s: float
    whole: bool
    """Whether the items are all that the mission is to have."""
    left: int = RE_REQUESTS
    items: list[MissionItem] = field(default_factory=list)

    def request(self, now_s: float) -> None:
        self.due_s = now_s + RE_REQUEST_S
        self.client.send(
            "MISSION_REQUEST_INT",
            target_system=self.client.mavlink_id.system,
            target_component=self.client.mavlink_id.component,
            seq=self.wanted,
            mission_type=MISSION_TYPE,
        )

    @property
    def wanted(self) -> int:
        """The item that is due next."""
        return self.first + len(self.items)


class MissionServer:
    """The vehicle's side. One upload at a time; until it is complete and accepted the old mission
    stays."""

    message_names = frozenset(
        (
            "MISSION_COUNT",
            "MISSION_ITEM_INT",
            "MISSION_REQUEST_LIST",
            "MISSION_REQUEST_INT",
            "MISSION_REQUEST",
            "MISSION_CLEAR_ALL",
            "MISSION_SET_CURRENT",
            "MISSION_WRITE_PARTIAL_LIST",
            "MISSION_ACK",
        )
    )

    def __init__(self, store: MissionStore, capacity: int = 1000) -> None:
        self._store, self._capacity = store, capacity
        self._session: _UploadSession | None = None
        self._finished: tuple[_UploadSession, int] | None = None
        self._handlers = {
            "MISSION_COUNT": self._count,
            "MISSION_ITEM_INT": self._item,
            "MISSION_REQUEST_LIST": self._list,
            "MISSION_REQUEST_INT": self._give,
            "MISSION_REQUEST": self._give,
            "MISSION_CLEAR_ALL": self._clear,
            "MISSION_SET_CURRENT": self._set_current,
            "MISSION_WRITE_PARTIAL_LIST": self._partial,
        }

    def feed(self, frame: Frame, send: Send, now_s: float) -> None:
        """Serve one frame that is addressed to this vehicle; ``send``, the same for one link,
        answers on it."""
        handler = self._handlers.get(frame.name)
        if handler is not None:
            handler(frame.decode(), Client(MavlinkId(frame.system, frame.component), send), now_s)

    def poll(self, now_s: float) -> None:
        """Ask again for an item that did not come, and give an abandoned upload up."""
        session = self._session
        if session is None or now_s < session.due_s:
            return
        if session.left:
            session.left -= 1
            session.request(now_s)
        else:
            self._end(
                session,
                MissionResult(CANCELLED, "Mission upload abandoned: its sender fell silent"),
            )

    def _count(self, message: Any, client: Client, now_s: float) -> None:
        if message.mission_type != MISSION_TYPE:
            _acknowledge(client, UNSUPPORTED, message.mission_type)
        elif message.count > self._capacity:
            self._store.explain(
                f"Mission refused: {message.count} items, room for {self._capacity}"
            )
            _acknowledge(client, NO_SPACE)
        else:
            self._begin(_UploadSession(client, 0, message.count, now_s, whole=True), now_s)

    def _partial(self, message: Any, client: Client, now_s: float) -> None:
        """New items in place of some that there are; the rest of the mission stays."""
        there, first, last = len(self._store.items), message.start_index, message.end_index
        if message.mission_type != MISSION_TYPE:
            _acknowledge(client, UNSUPPORTED, message.mission_type)
        elif not 0 <= first <= last < there:
            self._store.explain(f"Mission items {first} to {last} refused: the mission has {there}")
            _acknowledge(client, INVALID_SEQUENCE)
        else:
            self._begin(_UploadSession(client, first, last + 1, now_s, whole=False), now_s)

    def _begin(self, session: _UploadSession, now_s: float) -> None:
        """One upload at a time; its own sender may begin it again."""
        if self._session is not None and self._session.client != session.client:
            self._store.explain("Mission upload refused: another is under way")
            _acknowledge(session.client, DENIED)
        else:
            self._session, self._finished = session, None
            self._advance(session, now_s)

    def _item(self, message: Any, client: Client, now_s: float) -> None:
        session = self._session
        if session is None or session.client != client:
            if self._finished is not None and self._finished[0].client == client:
                _acknowledge(client, self._finished[1])  # the first acknowledgement was lost
        elif message.mission_type != MISSION_TYPE or message.seq != session.wanted:
            session.request(now_s)
        else:
            self._take(session, item_from_message(message), now_s)

    def _take(self, session: _UploadSession, item: MissionItem, now_s: float) -> None:
        fault = _fault(item)
        if fault.result != ACCEPTED:
            self._end(session, fault)
        else:
            session.items.append(item)
            session.left = RE_REQUESTS
            self._advance(session, now_s)

    def _advance(self, session: _UploadSession, now_s: float) -> None:
        if session.wanted < session.stop:
            session.request(now_s)
            return
        items = tuple(session.items)
        if not session.whole:
            there = tuple(self._store.items)
            items = there[: session.first] + items + there[session.stop :]
        self._end(session, self._store.load(items))

    def _end(self, session: _UploadSession, verdict: MissionResult) -> None:
        self._session, self._finished = None, (session, verdict.result)
        if verdict.text:
            self._store.explain(verdict.text)
        _acknowledge(session.client, verdict.result)

    def _list(self, message: Any, client: Client, now_s: float) -> None:
        client.send(
            "MISSION_COUNT",
            target_system=client.mavlink_id.system,
            target_component=client.mavlink_id.component,
            count=len(self._store.items) if message.mission_type == MISSION_TYPE else 0,
            mission_type=message.mission_type,
        )

    def _give(self, message: Any, client: Client, now_s: float) -> None:
        items = self._store.items
        if message.mission_type == MISSION_TYPE and message.seq < len(items):
            client.send("MISSION_ITEM_INT", **item_fields(items[message.seq], client.mavlink_id))
        else:
            _acknowledge(client, INVALID_SEQUENCE, message.mission_type)

    def _clear(self, message: Any, client: Client, now_s: float) -> None:
        if message.mission_type not in (MISSION_TYPE, ALL_TYPES):
            verdict = MissionResult(UNSUPPORTED)
        elif self._session is not None:
            verdict = MissionResult(DENIED, "Mission not cleared: an upload is under way")
        else:
            verdict = self._store.load(())
        if verdict.text:
            self._store.explain(verdict.text)
        _acknowledge(client, verdict.result, message.mission_type)

    def _set_current(self, message: Any, client: Client, now_s: float) -> None:
        if not self._store.set_current(message.seq):
            self._store.explain(
                f"No mission item {message.seq}: the mission has {len(self._store.items)}"
            )
        send_progress(client.send, self._store.progress)


def send_progress(send: Send, progress: MissionProgress) -> None:
    """Send MISSION_CURRENT."""
    send(
        "MISSION_CURRENT",
        seq=progress.sequence,
        total=progress.total,
        mission_state=progress.mission_state,
        mission_mode=progress.mission_mode,
    )


def _fault(item: MissionItem) -> MissionResult:
    """What is wrong with an item whatever the vehicle can do: its frame, or a place above the
    water."""
    if item.frame not in GLOBAL_FRAMES and item.frame not in (FRAME_LOCAL_NED, FRAME_MISSION):
        return MissionResult(
            UNSUPPORTED_FRAME, f"Mission item {item.sequence}: frame {item.frame} is not supported"
        )
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
    client.send(
        "MISSION_ACK",
        target_system=client.mavlink_id.system,
        target_component=client.mavlink_id.component,
        type=result,
        mission_type=mission_type,
    )
