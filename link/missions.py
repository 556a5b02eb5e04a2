"""The MAVLink mission protocol: both ends of it (https://mavlink.io/en/services/mission.html).

Items are stored and given back as they came. What a mission means is the autopilot's business; this file sees to it
that it arrives whole or not at all.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from link.codec import Frame
from link.dialect import constant, enum_names
from link.exchange import Exchange, Party, Send

ACCEPTED = constant("MAV_MISSION_ACCEPTED")
NO_SPACE = constant("MAV_MISSION_NO_SPACE")
UNSUPPORTED = constant("MAV_MISSION_UNSUPPORTED")
UNSUPPORTED_FRAME = constant("MAV_MISSION_UNSUPPORTED_FRAME")
INVALID = constant("MAV_MISSION_INVALID")
INVALID_PARAM7 = constant("MAV_MISSION_INVALID_PARAM7")
INVALID_SEQUENCE = constant("MAV_MISSION_INVALID_SEQUENCE")
DENIED = constant("MAV_MISSION_DENIED")
CANCELLED = constant("MAV_MISSION_OPERATION_CANCELLED")

MISSION_TYPE, ALL_TYPES = 0, 255
"""MAV_MISSION_TYPE: the only kind of plan that is kept here, and the one that means every kind."""

FRAME_LOCAL_NED, FRAME_MISSION = 1, 2
GLOBAL_FRAMES = frozenset((0, 3, 5, 6))
"""Global frames, with and without _INT, absolute and relative: alike to a vehicle whose home is the surface."""

RE_REQUEST_S = 1.5
"""Wall seconds after which an item that did not come is asked for again (the protocol's recommendation)."""
RE_REQUESTS = 5


class MissionItem(NamedTuple):
    """One item as MISSION_ITEM_INT carries it. Parameters may be NaN: not given."""

    sequence: int
    frame: int
    command: int
    current: int = 0
    autocontinue: int = 1
    p1: float = 0.0
    p2: float = 0.0
    p3: float = 0.0
    p4: float = 0.0
    x: int = 0
    """Latitude in 1e-7 degrees, 1e-4 m in local frames, the plain number in commands without a location."""
    y: int = 0
    z: float = 0.0
    """Altitude (minus the depth) in metres in global frames, depth in local ones."""
    mission_type: int = MISSION_TYPE


class MissionProgress(NamedTuple):
    """How far the vehicle has come, as MISSION_CURRENT tells it."""

    sequence: int
    total: int
    mission_state: int
    """MISSION_STATE."""
    mission_mode: int
    """1 in a mode that flies the mission, 2 in another."""


class Verdict(NamedTuple):
    """What became of an offered mission: a MAV_MISSION_RESULT and, where it was refused, why."""

    result: int = ACCEPTED
    text: str = ""


class MissionStore(Protocol):
    """What the vehicle does with missions."""

    @property
    def items(self) -> Sequence[MissionItem]: ...

    @property
    def progress(self) -> MissionProgress: ...

    def load(self, items: tuple[MissionItem, ...]) -> Verdict:
        """Take a whole new mission, or none of it."""
        ...

    def set_current(self, sequence: int) -> bool:
        """Go on from an item; False when there is no such item."""
        ...

    def explain(self, text: str) -> None:
        """Tell people why something was refused."""
        ...


def item_from_message(message: Any) -> MissionItem:
    """The item in a decoded MISSION_ITEM_INT."""
    m = message
    return MissionItem(
        m.seq, m.frame, m.command, m.current, m.autocontinue,
        m.param1, m.param2, m.param3, m.param4, m.x, m.y, m.z, m.mission_type,
    )  # fmt: skip


def item_fields(item: MissionItem, receiver: Party) -> dict[str, Any]:
    """The fields of the MISSION_ITEM_INT that carries an item."""
    return {
        "target_system": receiver.system, "target_component": receiver.component,
        "seq": item.sequence, "frame": item.frame, "command": item.command,
        "current": item.current, "autocontinue": item.autocontinue,
        "param1": item.p1, "param2": item.p2, "param3": item.p3, "param4": item.p4,
        "x": item.x, "y": item.y, "z": item.z, "mission_type": item.mission_type,
    }  # fmt: skip


class MissionClient:
    """The ground's side: each method begins an exchange, to be fed and polled until it is done."""

    def __init__(self, send: Send, own: Party, peer: Party) -> None:
        self._line = send, own, peer

    def upload(self, items: Sequence[MissionItem]) -> Exchange[None]:
        """Replace the vehicle's mission."""
        return _Upload(*self._line, tuple(items))

    def download(self) -> Exchange[tuple[MissionItem, ...]]:
        """Fetch the vehicle's mission."""
        return _Download(*self._line)

    def clear(self) -> Exchange[None]:
        """Empty the vehicle's mission."""
        return _Clear(*self._line)

    def set_current(self, sequence: int) -> Exchange[int]:
        """Have the vehicle go on from an item; the result is the item it reports."""
        return _SetCurrent(*self._line, sequence)


class _Upload(Exchange[None]):
    hears = frozenset(("MISSION_REQUEST_INT", "MISSION_REQUEST", "MISSION_ACK"))

    def __init__(self, send: Send, own: Party, peer: Party, items: tuple[MissionItem, ...]) -> None:
        super().__init__(send, own, peer)
        self._items = tuple(item._replace(sequence=n, mission_type=MISSION_TYPE) for n, item in enumerate(items))
        self._wanted: int | None = None

    def _ask(self) -> None:
        if self._wanted is None:
            self._post("MISSION_COUNT", count=len(self._items), mission_type=MISSION_TYPE)
        else:
            self._send("MISSION_ITEM_INT", **item_fields(self._items[self._wanted], self._peer))

    def _hear(self, name: str, message: Any) -> None:
        if message.mission_type != MISSION_TYPE:
            return
        if name != "MISSION_ACK":
            if message.seq < len(self._items):
                self._wanted = message.seq
                self._ask()
                self._progress()
        elif message.type != ACCEPTED:
            where = "" if self._wanted is None else f" at item {self._wanted}"
            self._fail(f"the vehicle refused the mission{where}: {_result_name(message.type)}")
        elif not self._items or self._wanted == len(self._items) - 1:
            self._finish(None)

    def _question(self) -> str:
        return f"the upload of {len(self._items)} mission items"


class _Download(Exchange[tuple[MissionItem, ...]]):
    hears = frozenset(("MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ACK"))

    def __init__(self, send: Send, own: Party, peer: Party) -> None:
        super().__init__(send, own, peer)
        self._count: int | None = None
        self._items: list[MissionItem] = []

    def _ask(self) -> None:
        if self._count is None:
            self._post("MISSION_REQUEST_LIST", mission_type=MISSION_TYPE)
        else:
            self._post("MISSION_REQUEST_INT", seq=len(self._items), mission_type=MISSION_TYPE)

    def _hear(self, name: str, message: Any) -> None:
        if message.mission_type != MISSION_TYPE:
            return
        if name == "MISSION_ACK":
            if message.type != ACCEPTED:
                self._fail(f"the vehicle did not give its mission: {_result_name(message.type)}")
            return
        if name == "MISSION_COUNT" and self._count is None:
            self._count = message.count
        elif name == "MISSION_ITEM_INT" and self._count is not None and message.seq == len(self._items):
            self._items.append(item_from_message(message))
        else:
            return
        self._progress()
        if len(self._items) < self._count:
            self._ask()
        else:
            self._post("MISSION_ACK", type=ACCEPTED, mission_type=MISSION_TYPE)
            self._finish(tuple(self._items))

    def _question(self) -> str:
        return "the mission download"


class _Clear(Exchange[None]):
    hears = frozenset(("MISSION_ACK",))

    def _ask(self) -> None:
        self._post("MISSION_CLEAR_ALL", mission_type=MISSION_TYPE)

    def _hear(self, name: str, message: Any) -> None:
        if message.type == ACCEPTED:
            self._finish(None)
        else:
            self._fail(f"the vehicle kept its mission: {_result_name(message.type)}")

    def _question(self) -> str:
        return "the clearing of the mission"


class _SetCurrent(Exchange[int]):
    hears = frozenset(("MISSION_CURRENT",))

    def __init__(self, send: Send, own: Party, peer: Party, sequence: int) -> None:
        super().__init__(send, own, peer)
        self._sequence = sequence

    def _ask(self) -> None:
        self._post("MISSION_SET_CURRENT", seq=self._sequence)

    def _hear(self, name: str, message: Any) -> None:
        if message.seq == self._sequence:
            self._finish(message.seq)

    def _question(self) -> str:
        return f"the choice of mission item {self._sequence}"


@dataclass
class _Session:
    """An upload under way: who sends it, how to answer, what has come."""

    sender: Party
    send: Send
    count: int
    due_s: float
    left: int = RE_REQUESTS
    items: list[MissionItem] = field(default_factory=list)

    def request(self, now_s: float) -> None:
        self.due_s = now_s + RE_REQUEST_S
        self.send(
            "MISSION_REQUEST_INT",
            target_system=self.sender.system,
            target_component=self.sender.component,
            seq=len(self.items),
            mission_type=MISSION_TYPE,
        )


class MissionServer:
    """The vehicle's side. One upload at a time; until it is complete and accepted the old mission stays."""

    hears = frozenset((
        "MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_REQUEST_LIST", "MISSION_REQUEST_INT", "MISSION_REQUEST",
        "MISSION_CLEAR_ALL", "MISSION_SET_CURRENT", "MISSION_WRITE_PARTIAL_LIST", "MISSION_ACK",
    ))  # fmt: skip

    def __init__(self, store: MissionStore, capacity: int = 1000) -> None:
        self._store, self._capacity = store, capacity
        self._session: _Session | None = None
        self._finished: tuple[Party, int] | None = None
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
        """Serve one frame that is addressed to this vehicle; ``send`` answers on the link it came by."""
        handler = self._handlers.get(frame.name)
        if handler is not None:
            handler(frame.decode(), Party(frame.system, frame.component), send, now_s)

    def poll(self, now_s: float) -> None:
        """Ask again for an item that did not come, and give an abandoned upload up."""
        session = self._session
        if session is None or now_s < session.due_s:
            return
        if session.left:
            session.left -= 1
            session.request(now_s)
        else:
            self._end(session, Verdict(CANCELLED, "Mission upload abandoned: its sender fell silent"))

    def _count(self, message: Any, sender: Party, send: Send, now_s: float) -> None:
        if message.mission_type != MISSION_TYPE:
            _acknowledge(send, sender, UNSUPPORTED, message.mission_type)
        elif self._session is not None and self._session.sender != sender:
            self._store.explain("Mission upload refused: another is under way")
            _acknowledge(send, sender, DENIED)
        elif message.count > self._capacity:
            self._store.explain(f"Mission refused: {message.count} items, room for {self._capacity}")
            _acknowledge(send, sender, NO_SPACE)
        else:
            self._session, self._finished = _Session(sender, send, message.count, now_s), None
            self._advance(self._session, now_s)

    def _item(self, message: Any, sender: Party, send: Send, now_s: float) -> None:
        session = self._session
        if session is None or session.sender != sender:
            if self._finished is not None and self._finished[0] == sender:
                _acknowledge(send, sender, self._finished[1])  # the first acknowledgement was lost
        elif message.mission_type != MISSION_TYPE or message.seq != len(session.items):
            session.request(now_s)
        else:
            self._take(session, item_from_message(message), now_s)

    def _take(self, session: _Session, item: MissionItem, now_s: float) -> None:
        fault = _fault(item)
        if fault.result != ACCEPTED:
            self._end(session, fault)
        else:
            session.items.append(item)
            session.left = RE_REQUESTS
            self._advance(session, now_s)

    def _advance(self, session: _Session, now_s: float) -> None:
        if len(session.items) < session.count:
            session.request(now_s)
        else:
            self._end(session, self._store.load(tuple(session.items)))

    def _end(self, session: _Session, verdict: Verdict) -> None:
        self._session, self._finished = None, (session.sender, verdict.result)
        if verdict.text:
            self._store.explain(verdict.text)
        _acknowledge(session.send, session.sender, verdict.result)

    def _list(self, message: Any, sender: Party, send: Send, now_s: float) -> None:
        send(
            "MISSION_COUNT",
            target_system=sender.system,
            target_component=sender.component,
            count=len(self._store.items) if message.mission_type == MISSION_TYPE else 0,
            mission_type=message.mission_type,
        )

    def _give(self, message: Any, sender: Party, send: Send, now_s: float) -> None:
        items = self._store.items
        if message.mission_type == MISSION_TYPE and message.seq < len(items):
            send("MISSION_ITEM_INT", **item_fields(items[message.seq], sender))
        else:
            _acknowledge(send, sender, INVALID_SEQUENCE, message.mission_type)

    def _clear(self, message: Any, sender: Party, send: Send, now_s: float) -> None:
        if message.mission_type not in (MISSION_TYPE, ALL_TYPES):
            verdict = Verdict(UNSUPPORTED)
        elif self._session is not None:
            verdict = Verdict(DENIED, "Mission not cleared: an upload is under way")
        else:
            verdict = self._store.load(())
        if verdict.text:
            self._store.explain(verdict.text)
        _acknowledge(send, sender, verdict.result, message.mission_type)

    def _set_current(self, message: Any, sender: Party, send: Send, now_s: float) -> None:
        if not self._store.set_current(message.seq):
            self._store.explain(f"No mission item {message.seq}: the mission has {len(self._store.items)}")
        send_progress(send, self._store.progress)

    def _partial(self, message: Any, sender: Party, send: Send, now_s: float) -> None:
        _acknowledge(send, sender, UNSUPPORTED, message.mission_type)


def send_progress(send: Send, progress: MissionProgress) -> None:
    """Send MISSION_CURRENT."""
    send(
        "MISSION_CURRENT",
        seq=progress.sequence,
        total=progress.total,
        mission_state=progress.mission_state,
        mission_mode=progress.mission_mode,
    )


def _fault(item: MissionItem) -> Verdict:
    """What is wrong with an item whatever the vehicle can do: its frame, or an altitude above the water."""
    if item.frame in GLOBAL_FRAMES:
        if item.z > 0.0:
            text = f"Mission item {item.sequence}: altitude {item.z:g} m; depth is given as <= 0"
            return Verdict(INVALID_PARAM7, text)
    elif item.frame not in (FRAME_LOCAL_NED, FRAME_MISSION):
        return Verdict(UNSUPPORTED_FRAME, f"Mission item {item.sequence}: frame {item.frame} is not supported")
    return Verdict()


def _acknowledge(send: Send, receiver: Party, result: int, mission_type: int = MISSION_TYPE) -> None:
    send(
        "MISSION_ACK",
        target_system=receiver.system,
        target_component=receiver.component,
        type=result,
        mission_type=mission_type,
    )


def _result_name(result: int) -> str:
    return enum_names("MAV_MISSION_RESULT").get(result, f"MAV_MISSION_RESULT {result}")
