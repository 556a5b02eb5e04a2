"""The mission protocol over lossy links, with pymavlink as the reference of the wire format."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_io import dialect
from mavlink_io.codec import Frame, Framer, encode
from mavlink_io.mission_items import MissionItem
from mavlink_io.real32 import as_real32
from mavlink_io.request import ExchangeError, MavlinkId
from mavlink_io.services import missions
from mavlink_io.services.mission_server import (
    RE_REQUESTS,
    MissionProgress,
    MissionResult,
    MissionServer,
)
from mavlink_io.services.missions import MissionClient
from tests.helpers.lossy_link import GROUND, VEHICLE, Lost, Wire, nothing, settle

OTHER_GROUND = MavlinkId(255, 230)


class Store:
    def __init__(self) -> None:
        self.items: tuple[MissionItem, ...] = ()
        self.current = 0
        self.texts: list[str] = []
        self.places: list[MissionItem] = []
        self.verdict = MissionResult()

    @property
    def progress(self) -> MissionProgress:
        return MissionProgress(self.current, len(self.items), 2, 2)

    def load(self, items: tuple[MissionItem, ...]) -> MissionResult:
        if self.verdict.result == missions.ACCEPTED:
            self.items = items
        return self.verdict

    def set_current(self, sequence: int) -> bool:
        if sequence >= len(self.items):
            return False
        self.current = sequence
        return True

    def go_to(self, item: MissionItem) -> MissionResult:
        self.places.append(item)
        return self.verdict

    def explain(self, text: str) -> None:
        self.texts.append(text)


class Sea:
    """A client and a server with a lossy link between them."""

    def __init__(self, lost_up: Lost = nothing, lost_down: Lost = nothing) -> None:
        self.up, self.down = Wire(GROUND, lost_up), Wire(VEHICLE, lost_down)
        self.store = Store()
        self.server = MissionServer(self.store)
        self.client = MissionClient(self.up.send, GROUND, VEHICLE)

    def run(self, exchange: Any) -> Any:
        return settle(
            exchange,
            self.up,
            self.down,
            lambda f, now: self.server.feed(f, self.down.send, now),
            self.server.poll,
        )

    def ask(
        self,
        name: str,
        sender: MavlinkId = GROUND,
        now_s: float = 0.0,
        down: Wire | None = None,
        **fields: Any,
    ) -> list[Any]:
        """Send one raw message; return the vehicle's decoded answers on the link ``down``."""
        wire, down = Wire(sender), down or self.down
        wire.send(name, **{"target_system": 1, "target_component": 1, **fields})
        for frame in wire.take():
            self.server.feed(frame, down.send, now_s)
        return [frame.decode() for frame in down.take()]


reals = st.floats(width=32, allow_nan=True, allow_infinity=False)
items = st.builds(
    MissionItem,
    sequence=st.just(0),
    frame=st.sampled_from([1, 2]),
    command=st.integers(0, 65_535),
    current=st.integers(0, 1),
    autocontinue=st.integers(0, 1),
    p1=reals,
    p2=reals,
    p3=reals,
    p4=reals,
    x=st.integers(-(2**31), 2**31 - 1),
    y=st.integers(-(2**31), 2**31 - 1),
    z=reals,
    mission_type=st.just(0),
)
below = items.filter(lambda item: not (item.frame == 1 and item.z < 0.0))
plans = st.lists(below, max_size=12).map(
    lambda plan: [item._replace(sequence=n) for n, item in enumerate(plan)]
)


def leg(count: int = 4) -> list[MissionItem]:
    return [MissionItem(n, 2, 93, p1=10.0 + n) for n in range(count)]


def same(a: Any, b: Any) -> bool:
    """Compare field by field; NaN equals NaN."""
    return repr(tuple(a)) == repr(tuple(b))


@given(plans)
def test_mission_upload_is_downloaded_unchanged(plan: list[MissionItem]) -> None:
    sea = Sea()
    sea.run(sea.client.upload(plan))
    assert same(sea.store.items, plan)
    assert same(sea.run(sea.client.download()), plan)


@given(plans, st.sets(st.integers(0, 12), max_size=2), st.sets(st.integers(0, 12), max_size=2))
def test_mission_lost_messages_are_requested_again(
    plan: list[MissionItem], up: set[int], down: set[int]
) -> None:
    sea = Sea(lambda n, name: n in up, lambda n, name: n in down)
    sea.run(sea.client.upload(plan))
    assert same(sea.store.items, plan)
    assert same(sea.run(sea.client.download()), plan)


@pytest.mark.parametrize(
    "lost", ["MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_REQUEST_INT", "MISSION_ACK"]
)
def test_mission_dead_link_raises_error(lost: str) -> None:
    sea = Sea(lambda n, name: name == lost, lambda n, name: name == lost)
    with pytest.raises(ExchangeError, match=r"no answer to the upload of 4|OPERATION_CANCELLED"):
        sea.run(sea.client.upload(leg()))


def test_mission_server_sends_request_int_only() -> None:
    sea = Sea()
    sea.run(sea.client.upload(leg()))
    assert sea.down.names == ["MISSION_REQUEST_INT"] * 4 + ["MISSION_ACK"]


def test_mission_abandoned_upload_keeps_old_mission() -> None:
    sea = Sea()
    sea.run(sea.client.upload(leg(3)))
    sea.ask("MISSION_COUNT", count=5, mission_type=0)
    request_count = 0
    for tenth in range(200):
        sea.server.poll(tenth * 0.1)
        for frame in sea.down.take():
            request_count += frame.name in ("MISSION_REQUEST_INT", "MISSION_REQUEST")
            last = frame
    assert request_count == RE_REQUESTS
    assert last.decode().type == missions.CANCELLED
    assert sea.store.items == tuple(leg(3))
    sea.run(sea.client.upload(leg(2)))
    assert sea.store.items == tuple(leg(2))


def test_mission_second_uploader_is_denied() -> None:
    sea = Sea()
    (request,) = sea.ask("MISSION_COUNT", count=1, mission_type=0)
    assert (request.seq, request.target_system) == (0, GROUND.system)
    (denied,) = sea.ask("MISSION_COUNT", OTHER_GROUND, count=9, mission_type=0)
    assert (denied.type, denied.target_system) == (missions.DENIED, OTHER_GROUND.system)
    fields = missions.item_fields(leg(1)[0], VEHICLE)
    del fields["target_system"], fields["target_component"]
    (accepted,) = sea.ask("MISSION_ITEM_INT", **fields)
    assert accepted.type == missions.ACCEPTED
    assert sea.store.items == tuple(leg(1))


@pytest.mark.parametrize(
    ("sender", "result", "kind", "second_upload"),
    [
        (GROUND, missions.CANCELLED, 0, "MISSION_REQUEST_INT"),
        (GROUND, missions.ACCEPTED, 0, "MISSION_ACK"),
        (GROUND, missions.CANCELLED, 1, "MISSION_ACK"),
        (OTHER_GROUND, missions.CANCELLED, 0, "MISSION_ACK"),
    ],
)
def test_mission_upload_is_cancelled_by_its_sender_only(
    sender: MavlinkId, result: int, kind: int, second_upload: str
) -> None:
    """MAVSDK cancels an upload by a MISSION_ACK with MAV_MISSION_OPERATION_CANCELLED."""
    sea = Sea()
    sea.run(sea.client.upload(leg(3)))
    sea.ask("MISSION_COUNT", count=2, mission_type=0)
    assert sea.ask("MISSION_ACK", sender, type=result, mission_type=kind) == []
    sea.ask("MISSION_COUNT", OTHER_GROUND, count=1, mission_type=0)
    assert sea.down.names[-1] == second_upload
    assert sea.store.items == tuple(leg(3))


def test_mission_second_uploader_with_same_ids_is_denied() -> None:
    """Every MAVSDK program has the ids 245/190."""
    sea, elsewhere = Sea(), Wire(VEHICLE)
    sea.ask("MISSION_COUNT", count=1, mission_type=0)
    (denied,) = sea.ask("MISSION_COUNT", down=elsewhere, count=9, mission_type=0)
    assert denied.type == missions.DENIED
    fields = missions.item_fields(leg(1)[0], VEHICLE)
    del fields["target_system"], fields["target_component"]
    assert sea.ask("MISSION_ITEM_INT", down=elsewhere, **{**fields, "param1": 77.0}) == []
    (accepted,) = sea.ask("MISSION_ITEM_INT", **fields)
    assert accepted.type == missions.ACCEPTED
    assert sea.store.items == tuple(leg(1))


@pytest.mark.parametrize("frame", [0, 3, 5, 6])
def test_mission_altitude_above_water_is_refused(frame: int) -> None:
    sea = Sea()
    sea.run(sea.client.upload(leg(2)))
    plan = [*leg(1), MissionItem(1, frame, 16, z=3.0)]
    with pytest.raises(
        ExchangeError, match="refused the mission after item 1: MAV_MISSION_INVALID_PARAM7"
    ):
        sea.run(sea.client.upload(plan))
    assert sea.store.texts == ["Mission item 1: altitude 3 m; depth is given as <= 0"]
    assert sea.store.items == tuple(leg(2))


@pytest.mark.parametrize("command", [16, 113])
def test_mission_negative_local_depth_is_refused(command: int) -> None:
    sea = Sea()
    with pytest.raises(ExchangeError, match="MAV_MISSION_INVALID_PARAM7"):
        sea.run(sea.client.upload([MissionItem(0, 1, command, z=-1.0)]))
    assert sea.store.texts == ["Mission item 0: z -1 m; down is positive"]


@pytest.mark.parametrize("command", [31_010, 115, 178])
def test_mission_z_without_position_is_not_checked(command: int) -> None:
    sea = Sea()
    plan = [MissionItem(0, frame, command, z=2.0) for frame in (0, 3)]
    sea.run(sea.client.upload(plan))
    assert [item.z for item in sea.store.items] == [2.0, 2.0]


@pytest.mark.parametrize(
    ("frame", "z"), [(0, 0.0), (3, -5.0), (6, math.nan), (5, -1.0), (1, 7.0), (2, 7.0)]
)
def test_mission_depth_is_accepted_in_every_frame(frame: int, z: float) -> None:
    sea = Sea()
    plan = [MissionItem(0, frame, 16, z=z)]
    sea.run(sea.client.upload(plan))
    assert same(sea.store.items, plan)


@pytest.mark.parametrize("frame", [4, 10, 11, 8])
def test_mission_other_frames_are_refused(frame: int) -> None:
    sea = Sea()
    with pytest.raises(ExchangeError, match="UNSUPPORTED_FRAME"):
        sea.run(sea.client.upload([MissionItem(0, frame, 16)]))
    assert sea.store.items == ()


def test_mission_vehicle_refusal_reaches_client() -> None:
    sea = Sea()
    sea.store.verdict = MissionResult(
        missions.UNSUPPORTED, "command 22 is not one this vehicle flies"
    )
    with pytest.raises(ExchangeError, match="MAV_MISSION_UNSUPPORTED"):
        sea.run(sea.client.upload(leg()))
    assert sea.store.texts == ["command 22 is not one this vehicle flies"]


def test_mission_clear_gives_empty_mission() -> None:
    sea = Sea()
    sea.run(sea.client.upload(leg()))
    sea.run(sea.client.clear())
    assert sea.store.items == ()
    assert sea.run(sea.client.download()) == ()
    sea.run(sea.client.upload(leg()))
    sea.run(sea.client.upload([]))
    assert sea.store.items == ()


def test_mission_set_current_is_answered() -> None:
    sea = Sea()
    sea.run(sea.client.upload(leg()))
    assert sea.run(sea.client.set_current(2)) == 2
    (answer,) = sea.ask("MISSION_SET_CURRENT", seq=9)
    assert (answer.seq, answer.total) == (2, 4)
    assert sea.store.texts == ["No mission item 9: the mission has 4"]


@pytest.mark.parametrize("kind", [1, 2])
def test_mission_fence_and_rally_lists_are_empty(kind: int) -> None:
    sea = Sea()
    sea.run(sea.client.upload(leg()))
    (count,) = sea.ask("MISSION_REQUEST_LIST", mission_type=kind)
    assert (count.count, count.mission_type) == (0, kind)
    (refusal,) = sea.ask("MISSION_COUNT", count=3, mission_type=kind)
    assert (refusal.type, refusal.mission_type) == (missions.UNSUPPORTED, kind)
    (answer,) = sea.ask("MISSION_CLEAR_ALL", mission_type=kind)
    assert answer.type == missions.UNSUPPORTED
    assert sea.store.items == tuple(leg())


@pytest.mark.parametrize("kind", [1, 2])
def test_plans_are_kept_apart_by_type(kind: int) -> None:
    """pymavlink's messages carry the type; the other plan of the vehicle is not changed."""
    sea, plan = Sea(), Store()
    sea.server = MissionServer(sea.store, plans={kind: plan})
    sea.run(sea.client.upload(leg()))
    points = [MissionItem(n, 0, 5100, x=10 * n, z=50.0, mission_type=kind) for n in range(2)]
    (first,) = sea.ask("MISSION_COUNT", count=2, mission_type=kind)
    assert (first.seq, first.mission_type) == (0, kind)
    (wrong,) = sea.ask("MISSION_ITEM_INT", **missions.item_fields(leg()[0], VEHICLE))
    assert (wrong.seq, wrong.mission_type) == (0, kind), "an item of another plan is not taken"
    (second,) = sea.ask("MISSION_ITEM_INT", **missions.item_fields(points[0], VEHICLE))
    assert second.seq == 1
    (done,) = sea.ask("MISSION_ITEM_INT", **missions.item_fields(points[1], VEHICLE))
    assert (done.type, done.mission_type) == (missions.ACCEPTED, kind)
    assert plan.items == tuple(points)
    (count,) = sea.ask("MISSION_REQUEST_LIST", mission_type=kind)
    assert count.count == 2
    (back,) = sea.ask("MISSION_REQUEST_INT", seq=1, mission_type=kind)
    assert (back.x, back.mission_type) == (10, kind)
    (cleared,) = sea.ask("MISSION_CLEAR_ALL", mission_type=kind)
    assert (cleared.type, cleared.mission_type) == (missions.ACCEPTED, kind)
    assert plan.items == ()
    assert sea.store.items == tuple(leg())


def test_mission_clear_all_types_is_accepted() -> None:
    sea = Sea()
    sea.run(sea.client.upload(leg()))
    (cleared,) = sea.ask("MISSION_CLEAR_ALL", mission_type=255)
    assert (cleared.type, cleared.mission_type) == (missions.ACCEPTED, 255)
    assert sea.store.items == ()


def test_mission_partial_upload_keeps_other_items() -> None:
    sea = Sea()
    sea.run(sea.client.upload(leg(5)))
    new = [item._replace(p1=100.0 + item.sequence) for item in leg(5)]
    (request_count,) = sea.ask("MISSION_WRITE_PARTIAL_LIST", start_index=2, end_index=3)
    assert request_count.seq == 2
    (request_count,) = sea.ask("MISSION_ITEM_INT", **missions.item_fields(new[2], VEHICLE))
    assert request_count.seq == 3
    assert sea.store.items == tuple(leg(5))
    (accepted,) = sea.ask("MISSION_ITEM_INT", **missions.item_fields(new[3], VEHICLE))
    assert accepted.type == missions.ACCEPTED
    assert [item.p1 for item in sea.store.items] == [10.0, 11.0, 102.0, 103.0, 14.0]
    assert [item.sequence for item in sea.store.items] == [0, 1, 2, 3, 4]


@pytest.mark.parametrize(("first", "last"), [(-1, 0), (3, 2), (4, 5), (0, 5)])
def test_mission_partial_upload_out_of_range_is_refused(first: int, last: int) -> None:
    sea = Sea()
    sea.run(sea.client.upload(leg(5)))
    (refused,) = sea.ask("MISSION_WRITE_PARTIAL_LIST", start_index=first, end_index=last)
    assert refused.type == missions.INVALID_SEQUENCE
    assert sea.store.texts == [f"Mission items {first} to {last} refused: the mission has 5"]


def test_mission_unknown_item_is_invalid_sequence() -> None:
    (refusal,) = Sea().ask("MISSION_REQUEST_INT", seq=0, mission_type=0)
    assert refusal.type == missions.INVALID_SEQUENCE


def test_mission_too_long_is_refused() -> None:
    sea = Sea()
    (refusal,) = sea.ask("MISSION_COUNT", count=1001, mission_type=0)
    assert refusal.type == missions.NO_SPACE


def test_mission_parameters_are_float32() -> None:
    sea = Sea()
    sea.run(sea.client.upload([MissionItem(0, 2, 93, p1=0.1)]))
    assert sea.store.items[0].p1 == as_real32(0.1)


def upload_frames(items: list[MissionItem], first: int) -> list[Frame]:
    """Return the frames of an upload, numbered from ``first``."""
    framer, target = Framer(), {"target_system": 1, "target_component": 1}
    messages = [("MISSION_COUNT", {"count": len(items), **target})]
    messages += [("MISSION_ITEM_INT", missions.item_fields(item, VEHICLE)) for item in items]
    frames = list[Frame]()
    for number, (name, fields) in enumerate(messages, first):
        message = dialect.by_name(name)
        frames += framer.feed(encode(message, message.values(**fields), number & 0xFF, *GROUND))
    return frames


def test_mission_late_frames_on_one_link_leave_the_new_mission() -> None:
    """Before, a repeated count began another upload, of the first mission's length."""
    store, send = Store(), Wire(VEHICLE).send
    server = MissionServer(store)
    first = [MissionItem(0, 2, 93, p1=1.0)]
    second = [MissionItem(n, 2, 93, p1=2.0) for n in range(2)]
    early, now = upload_frames(first, 0), upload_frames(second, 10)
    for frame in (*early, now[0], *early, now[1], *early, now[2], *early):
        server.feed(frame, send, 0.0)
    assert store.items == tuple(second)


@pytest.mark.parametrize(("first", "again"), [(1, 1), (1, 2), (254, 0)])
def test_mission_upload_of_a_ground_station_that_restarts_is_a_new_one(
    first: int, again: int
) -> None:
    """It counts from 0 again: before, its MISSION_COUNT was ignored as a late one."""
    store, send = Store(), Wire(VEHICLE).send
    server = MissionServer(store)
    old = upload_frames([MissionItem(n, 2, 93, p1=1.0) for n in range(4)], first)
    new = upload_frames([MissionItem(n, 2, 93, p1=2.0) for n in range(3)], again)
    for frame in (*old[:4], *new):
        server.feed(frame, send, 0.0)
    assert store.items == tuple(MissionItem(n, 2, 93, p1=2.0) for n in range(3))


def test_mission_late_count_of_a_complete_upload_begins_no_other() -> None:
    store, down = Store(), Wire(VEHICLE)
    server = MissionServer(store)
    frames = upload_frames([MissionItem(n, 2, 93, p1=1.0) for n in range(2)], 1)
    for frame in (*frames, frames[0]):
        server.feed(frame, down.send, 0.0)
    server.poll(60.0)
    assert down.names == ["MISSION_REQUEST_INT", "MISSION_REQUEST_INT", "MISSION_ACK"]


def test_mission_acknowledged_with_fewer_items_is_sent_again() -> None:
    """The vehicle took a late count of an earlier upload for this one."""
    sent: list[str] = []
    client = MissionClient(lambda name, **_: sent.append(name), GROUND, VEHICLE)
    upload = client.upload([MissionItem(n, 2, 93) for n in range(3)])
    upload.poll(0.0)
    wire = Wire(VEHICLE)
    target = {"target_system": GROUND.system, "target_component": GROUND.component}
    wire.send("MISSION_REQUEST_INT", seq=0, **target)
    wire.send("MISSION_ACK", type=missions.ACCEPTED, **target)
    for frame in wire.take():
        upload.feed(frame)
    assert not upload.done
    assert sent == ["MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_COUNT"]


def test_mission_download_ignores_the_late_count_of_an_earlier_exchange() -> None:
    """The vehicle had no mission before the upload, and a late answer said so after it."""
    client, wire = MissionClient(lambda *_, **__: None, GROUND, VEHICLE), Wire(VEHICLE)
    target = {"target_system": GROUND.system, "target_component": GROUND.component}
    wire.send("MISSION_COUNT", count=0, **target)
    wire.send("MISSION_REQUEST_INT", seq=0, **target)
    wire.send("MISSION_ACK", type=missions.ACCEPTED, **target)
    wire.send("MISSION_COUNT", count=1, **target)
    wire.send("MISSION_ITEM_INT", **missions.item_fields(leg(1)[0], GROUND))
    frames = [frame._replace(sequence=number) for number, frame in enumerate(wire.take())]
    late, *answers, count, item = frames
    upload = client.upload(leg(1))
    upload.poll(0.0)
    for frame in answers:
        upload.feed(frame)
    assert upload.done
    download = client.download()
    download.poll(0.1)
    download.feed(late)
    assert not download.done
    download.feed(count)
    download.feed(item)
    assert download.result() == tuple(leg(1))


def test_mission_upload_after_failed_one_ignores_its_late_count() -> None:
    """Before, the vehicle loaded as many items of the second upload as the first one had."""
    sea = Sea()
    sea.run(sea.client.upload(leg(4)))
    sea.up._lost = lambda count, name: True
    with pytest.raises(ExchangeError):
        sea.run(sea.client.upload(leg(2)))
    sea.up._lost = nothing
    sea.ask("MISSION_COUNT", count=2, mission_type=0)  # the late one
    sent_before = len(sea.up.names)
    sea.up._lost = lambda count, name: name == "MISSION_COUNT"
    with pytest.raises(ExchangeError):
        sea.run(sea.client.upload(leg(3)))
    first, *others = sea.up.names[sent_before:]
    assert first == "MISSION_REQUEST_LIST"
    assert set(others) == {"MISSION_COUNT"}
    assert sea.store.items == tuple(leg(4))
    assert sea.store.texts == ["Mission upload abandoned: its sender asks for the mission"]


@pytest.mark.parametrize("first_requested", [1, 3])
def test_mission_request_that_skips_items_is_answered_by_the_count(first_requested: int) -> None:
    """The vehicle continues the upload of a program that was ended, or has another number."""
    sent: list[str] = []
    client = MissionClient(lambda name, **_: sent.append(name), GROUND, VEHICLE)
    upload = client.upload(leg(3))
    upload.poll(0.0)
    wire = Wire(VEHICLE)
    target = {"target_system": GROUND.system, "target_component": GROUND.component}
    wire.send("MISSION_REQUEST_INT", seq=first_requested, **target)
    for frame in wire.take():
        upload.feed(frame)
    assert sent == ["MISSION_COUNT", "MISSION_COUNT"]


def old_item(n: int, **changes: Any) -> dict[str, Any]:
    """Return the fields of a MISSION_ITEM, with degrees as floats."""
    fields = {"seq": n, "frame": 3, "command": 16, "current": 0, "autocontinue": 1}
    numbers = {"param1": 0.0, "param2": 0.0, "param3": 0.0, "param4": 0.0}
    place = {"x": 47.5, "y": -8.25, "z": -3.0, "mission_type": 0}
    return {**fields, **numbers, **place, **changes}


def test_upload_by_deprecated_float_items_is_accepted() -> None:
    """An old client ignores MISSION_REQUEST_INT; MISSION_REQUEST is asked for after 4.5 s."""
    sea = Sea()
    assert [type(m).__name__ for m in sea.ask("MISSION_COUNT", count=3, mission_type=0)] == [
        "MISSION_REQUEST_INT"
    ]
    requested: list[tuple[float, str]] = []
    for tenth in range(100):
        sea.server.poll(tenth * 0.1)
        requested += [(tenth * 0.1, frame.name) for frame in sea.down.take()]
        if requested and requested[-1][1] == "MISSION_REQUEST":
            break
    assert requested[-1][0] == pytest.approx(6.0, abs=0.2)
    (second,) = sea.ask("MISSION_ITEM", now_s=6.1, **old_item(0))
    assert (type(second).__name__, second.seq) == ("MISSION_REQUEST", 1)
    sea.ask("MISSION_ITEM", now_s=6.2, **old_item(1, frame=1, x=1.5, y=-2.25, z=3.0))
    (ack,) = sea.ask("MISSION_ITEM", now_s=6.3, **old_item(2, frame=2, command=93, x=7.0, y=0.0))
    assert ack.type == missions.ACCEPTED
    assert [(item.frame, item.x, item.y) for item in sea.store.items] == [
        (3, 475_000_000, -82_500_000),
        (1, 15_000, -22_500),
        (2, 7, 0),
    ]


def test_float_item_without_number_is_not_given() -> None:
    sea = Sea()
    sea.ask("MISSION_COUNT", count=1, mission_type=0)
    sea.ask("MISSION_ITEM", **old_item(0, x=math.nan, y=1e30))
    (item,) = sea.store.items
    assert (item.x, item.y) == (2**31 - 1, 2**31 - 1)


def test_item_to_go_to_is_no_part_of_an_upload() -> None:
    sea = Sea()
    sea.ask("MISSION_COUNT", count=1, mission_type=0)
    (ack,) = sea.ask("MISSION_ITEM", **old_item(0, current=2))
    assert ack.type == missions.ACCEPTED
    assert [item.x for item in sea.store.places] == [475_000_000]
    assert sea.store.items == ()
    (refusal,) = sea.ask("MISSION_ITEM", **old_item(0, current=2, z=5.0))
    assert refusal.type == missions.INVALID_PARAM7
    (ack,) = sea.ask("MISSION_ITEM", **old_item(0))
    assert (ack.type, len(sea.store.items)) == (missions.ACCEPTED, 1)
