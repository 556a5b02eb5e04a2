"""The parameter protocol over lossy links."""

import math
import re
import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_io import dialect
from mavlink_io.codec import Frame, Framer, encode, encode_payload
from mavlink_io.frame_order import MAX_LATE_S
from mavlink_io.real32 import as_real32
from mavlink_io.request import ExchangeError
from mavlink_io.services.params import (
    DOES_NOT_EXIST,
    OUT_OF_RANGE,
    REAL32,
    ParamClient,
    ParamServer,
    ValueOrder,
    requested_value,
)
from tests.helpers.lossy_link import GROUND, VEHICLE, Lost, Wire, nothing, settle
from tests.helpers.px4_params import INT32, Px4Params


class Table:
    """Fifty parameters with the range 0 to 10."""

    def __init__(self) -> None:
        self.values = {f"P_{n:02}": n / 10 for n in range(50)}

    def names(self) -> list[str]:
        return sorted(self.values)

    def get(self, name: str) -> float:
        return self.values[name]

    def set(self, name: str, value: float) -> float:
        if not 0.0 <= value <= 10.0:
            raise ValueError(f"{name} = {value:g}: must be 0 to 10")
        self.values[name] = value
        return value


class Sea:
    def __init__(self, lost_up: Lost = nothing, lost_down: Lost = nothing) -> None:
        self.up, self.down = Wire(GROUND, lost_up), Wire(VEHICLE, lost_down)
        self.other_link = Wire(VEHICLE)
        self.table = Table()
        self.texts: list[str] = []
        self.room = 1000
        self.server = ParamServer(self.table, self._broadcast, self.texts.append)
        self.client = ParamClient(self.up.send, GROUND, VEHICLE)

    def _broadcast(self, name: str, **fields: Any) -> None:
        self.down.send(name, **fields)
        self.other_link.send(name, **fields)

    def run(self, exchange: Any) -> Any:
        return settle(exchange, self.up, self.down, self._serve, lambda _: self.server.poll())

    def _serve(self, frame: Frame, now_s: float = 0.0) -> None:
        self.server.feed(frame, self.down.send, lambda: self.room)

    def ask(self, name: str, **fields: Any) -> list[Any]:
        wire = Wire(GROUND)
        wire.send(name, target_system=1, target_component=1, **fields)
        for frame in wire.take():
            self._serve(frame)
        self.server.poll()
        return [frame.decode() for frame in self.down.take()]


def expected(sea: Sea) -> dict[str, float]:
    return {name: as_real32(value) for name, value in sorted(sea.table.values.items())}


def test_param_list_waits_for_room() -> None:
    sea = Sea()
    sea.room = 0
    assert sea.ask("PARAM_REQUEST_LIST") == []
    sea.room = 1000
    for _ in range(5):
        sea.server.poll()
    assert [frame.decode().param_id for frame in sea.down.take()] == sorted(sea.table.values)


def test_param_clients_with_same_ids_get_whole_list() -> None:
    sea = Sea()
    request = Wire(GROUND)
    request.send("PARAM_REQUEST_LIST", target_system=1, target_component=1)
    (frame,) = request.take()
    for link in (sea.down, sea.other_link):
        sea.server.feed(frame, link.send, lambda: 1000)
    for _ in range(5):
        sea.server.poll()
    for link in (sea.down, sea.other_link):
        assert [frame.decode().param_id for frame in link.take()] == sorted(sea.table.values)


def test_param_list_is_complete_and_sorted() -> None:
    sea = Sea()
    listed = sea.run(sea.client.list())
    assert list(listed.items()) == list(expected(sea).items())
    assert sea.up.names == ["PARAM_REQUEST_LIST"]


@given(st.sets(st.integers(0, 60), max_size=30), st.sets(st.integers(1, 4), max_size=2))
def test_param_lost_values_are_requested_by_index(down: set[int], up: set[int]) -> None:
    sea = Sea(lambda n, name: n in up, lambda n, name: n in down)
    assert sea.run(sea.client.list()) == expected(sea)


def test_param_silent_vehicle_raises_error() -> None:
    sea = Sea(lost_down=lambda n, name: True)
    with pytest.raises(ExchangeError, match="no answer to the parameter list after 5 attempts"):
        sea.run(sea.client.list())


def test_param_list_is_sent_in_parts() -> None:
    sea = Sea()
    first = sea.ask("PARAM_REQUEST_LIST")
    assert 0 < len(first) < 50
    assert all((value.param_count, value.param_type) == (50, REAL32) for value in first)


@given(st.floats(0.0, 10.0, allow_subnormal=False))
def test_param_set_value_is_reported_back(value: float) -> None:
    sea = Sea()
    assert sea.run(sea.client.set("P_07", value)) == as_real32(value)
    assert sea.table.values["P_07"] == as_real32(value)
    assert sea.run(sea.client.get("P_07")) == as_real32(value)


def test_param_change_is_sent_on_every_link() -> None:
    sea = Sea()
    sea.run(sea.client.set("P_07", 3.5))
    (announced,) = [frame.decode() for frame in sea.other_link.take()]
    assert (announced.param_id, announced.param_value, announced.param_index) == ("P_07", 3.5, 7)


def test_param_read_is_answered_on_its_link_only() -> None:
    sea = Sea()
    sea.run(sea.client.get("P_07"))
    assert sea.other_link.take() == []


def report(sea: Sea, value: float) -> Frame:
    """Return a frame that reports a value of P_03."""
    sea.other_link.send(
        "PARAM_VALUE",
        param_id="P_03",
        param_value=value,
        param_type=REAL32,
        param_count=50,
        param_index=3,
    )
    (frame,) = sea.other_link.take()
    return frame


def test_param_set_outlives_late_reports_of_an_earlier_value() -> None:
    sea = Sea()
    setting = sea.client.set("P_03", 2.5)
    setting.poll(0.0)
    for _ in range(3):
        setting.feed(report(sea, 0.5))
    setting.poll(1.1)
    setting.feed(report(sea, 0.5))
    assert not setting.done
    setting.feed(report(sea, 2.5))
    assert setting.result() == 2.5


def test_param_list_ignores_late_report_of_an_earlier_request() -> None:
    message = dialect.by_name("PARAM_VALUE")

    def value_frame(sequence: int, index: int, value: float) -> Frame:
        fields = {"param_id": f"P_{index:02}", "param_type": REAL32, "param_value": value}
        values = message.values(param_index=index, param_count=2, **fields)
        (frame,) = Framer().feed(encode(message, values, sequence, *VEHICLE))
        return frame

    sea = Sea()
    setting = sea.client.set("P_01", 2.5)
    setting.poll(0.0)
    setting.feed(value_frame(255, 1, 2.5))
    assert setting.result() == 2.5
    listing = sea.client.list()
    listing.poll(0.1)
    listing.feed(value_frame(254, 1, 0.5))
    listing.feed(value_frame(0, 0, 7.0))
    assert not listing.done
    listing.feed(value_frame(1, 1, 2.5))
    assert listing.result() == {"P_00": 7.0, "P_01": 2.5}


def test_param_value_of_a_restarted_vehicle_counts_after_a_while() -> None:
    sea, order = Sea(), ValueOrder()
    frames = [report(sea, 0.5)._replace(sequence=number) for number in (9, 3, 3)]
    late = [
        order.is_old(frame, now_s)
        for frame, now_s in zip(frames, (0.0, 0.1, MAX_LATE_S), strict=True)
    ]
    assert late == [False, True, False]


def test_param_set_fails_if_the_vehicle_keeps_its_value() -> None:
    sea = Sea()
    setting = sea.client.set("P_03", 2.5)
    for second in range(3):
        setting.poll(1.1 * second)
        setting.feed(report(sea, 0.5))
    with pytest.raises(ExchangeError, match=r"P_03: the vehicle keeps 0\.5 and not 2\.5"):
        setting.result()


def test_param_name_longer_than_the_field_does_not_exist() -> None:
    """The message has 16 bytes for a name; the answer to a shortened one is that of another."""
    sea = Sea()
    for exchange in (sea.client.get("P_03" + "x" * 13), sea.client.set("P_03" + "x" * 13, 1.0)):
        assert exchange.does_not_exist
        with pytest.raises(ExchangeError, match=r"^parameter P_03x+: there is no such parameter$"):
            sea.run(exchange)
    assert not sea.up.names


def test_param_unknown_name_raises_error() -> None:
    sea = Sea()
    with pytest.raises(ExchangeError, match=r"^parameter P_99: there is no such parameter$"):
        sea.run(sea.client.get("P_99"))
    with pytest.raises(ExchangeError, match=r"^parameter P_99: there is no such parameter$"):
        sea.run(sea.client.set("P_99", 1.0))
    assert sea.down.names == ["PARAM_ERROR", "PARAM_ERROR"]
    (error,) = sea.ask("PARAM_REQUEST_READ", param_id="", param_index=50)
    assert (error.error, error.target_system) == (DOES_NOT_EXIST, GROUND.system)


def test_param_out_of_range_is_refused_with_reason() -> None:
    sea = Sea()
    with pytest.raises(ExchangeError, match="out of range"):
        sea.run(sea.client.set("P_07", 11.0))
    assert sea.texts == ["P_07 = 11: must be 0 to 10"]
    assert sea.table.values["P_07"] == 0.7
    assert sea.down.names == ["PARAM_ERROR", "PARAM_VALUE"]


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_param_non_finite_value_is_refused_at_both_ends(value: float) -> None:
    sea = Sea()
    with pytest.raises(ValueError, match="no finite number"):
        sea.client.set("P_07", value)
    answers = sea.ask("PARAM_SET", param_id="P_07", param_value=value, param_type=REAL32)
    assert answers[0].error == OUT_OF_RANGE
    assert sea.table.values["P_07"] == 0.7


def as_bytes(code: str, value: int) -> float:
    """Return an integer as PX4's clients put it into param_value."""
    padded = struct.pack(code, value).ljust(4, b"\0")
    return float(struct.unpack("<f", padded)[0])


@pytest.mark.parametrize(
    ("param_type", "code", "value"),
    [
        (1, "<B", 200),
        (2, "<b", -7),
        (3, "<H", 60_000),
        (4, "<h", -300),
        (5, "<I", 7),
        (6, "<i", -1),
    ],
)
def test_typed_integer_is_read_as_advertised(param_type: int, code: str, value: int) -> None:
    """PARAM_ENCODE_BYTEWISE copies the bytes, PARAM_ENCODE_C_CAST converts the number."""
    sent = as_bytes(code, value)
    assert requested_value("P", sent, param_type, bytewise=True) == value
    assert requested_value("P", float(value), param_type, bytewise=False) == value


def test_typed_integer_is_stored_and_reported() -> None:
    sea = Sea()
    (answer,) = sea.ask(
        "PARAM_SET", param_id="P_07", param_value=as_bytes("<i", 3), param_type=INT32
    )
    assert (answer.param_value, answer.param_type) == (3.0, REAL32)
    assert sea.table.values["P_07"] == 3.0


@pytest.mark.parametrize(
    ("value", "param_type", "reason"),
    [
        (3.0, INT32, r"P_07 = 1.0779\de\+09: must be 0 to 10"),
        (0.0, 8, "an integer of 64 bits does not fit"),
    ],
)
def test_integer_of_wrong_encoding_is_refused(value: float, param_type: int, reason: str) -> None:
    """A number that was converted and not copied is far outside the range."""
    sea = Sea()
    answers = sea.ask("PARAM_SET", param_id="P_07", param_value=value, param_type=param_type)
    assert answers[0].error == OUT_OF_RANGE
    assert re.search(reason, sea.texts[0])
    assert sea.table.values["P_07"] == 0.7


def test_fraction_with_integer_type_is_refused_by_c_cast() -> None:
    with pytest.raises(ValueError, match="not a whole number"):
        requested_value("P", 2.5, INT32, bytewise=False)
    with pytest.raises(ValueError, match="not finite"):
        requested_value("P", math.nan, INT32, bytewise=False)


def test_param_set_that_arrives_late_is_ignored() -> None:
    """Before, a late PARAM_SET put the older value back after the newer one was confirmed."""
    table = Table()
    name = next(iter(table.values))
    server = ParamServer(table, Wire(VEHICLE).send, lambda _: None)
    send = Wire(VEHICLE).send
    message, framer = dialect.by_name("PARAM_SET"), Framer()
    target = {"target_system": 1, "target_component": 1, "param_id": name, "param_type": 9}
    old, new = (
        framer.feed(encode(message, message.values(param_value=value, **target), number, *GROUND))
        for number, value in ((7, 1.0), (8, 2.0))
    )
    for frame in (*old, *new, *old):
        server.feed(frame, send, lambda: 1000)
    assert table.values[name] == 2.0


class Px4Sea:
    """A client of a fake PX4 vehicle."""

    def __init__(self) -> None:
        self.up, self.down = Wire(GROUND), Wire(VEHICLE)
        self.vehicle = Px4Params()
        self.client = ParamClient(self.up.send, GROUND, VEHICLE, bytewise=True)

    def run(self, exchange: Any) -> Any:
        return settle(exchange, self.up, self.down, self._serve, lambda _: None)

    def _serve(self, frame: Frame, now_s: float) -> None:
        self.vehicle.feed(frame, self.down.send, lambda: 1000)


def test_px4_integers_are_listed_as_numbers() -> None:
    sea = Px4Sea()
    listed = sea.run(sea.client.list())
    assert listed == {"BAT_N": -1.0, "MPC_XY_P": 0.5, "SYS_AUTOSTART": 4001.0}
    assert sea.run(sea.client.get("SYS_AUTOSTART")) == 4001.0


@pytest.mark.parametrize("value", [60_500, -3, 0, 16_777_217, -(2**31)])
def test_px4_integer_is_set_with_its_type(value: int) -> None:
    """The type is read first; 16,777,217 is no float32."""
    sea = Px4Sea()
    assert sea.run(sea.client.set("SYS_AUTOSTART", value)) == value
    assert sea.vehicle.values["SYS_AUTOSTART"] == value
    assert sea.up.names == ["PARAM_REQUEST_READ", "PARAM_SET"]
    assert sea.run(sea.client.set("SYS_AUTOSTART", 4001)) == 4001
    assert sea.up.names[2:] == ["PARAM_SET"]


def test_px4_float_is_set() -> None:
    sea = Px4Sea()
    assert sea.run(sea.client.set("MPC_XY_P", 0.95)) == as_real32(0.95)
    assert sea.vehicle.values["MPC_XY_P"] == as_real32(0.95)


@pytest.mark.parametrize(
    ("value", "reason"),
    [
        (2.5, "2.5 is not a whole number"),
        (2.0**31, "out of the range of its type"),
        (0x7F800001, "its bytes change in a float"),
    ],
)
def test_px4_integer_that_cannot_be_sent_is_refused(value: float, reason: str) -> None:
    sea = Px4Sea()
    with pytest.raises(ExchangeError, match=f"parameter BAT_N: .*{reason}"):
        sea.run(sea.client.set("BAT_N", value))
    assert sea.vehicle.values["BAT_N"] == -1


def test_px4_integer_with_bytes_of_a_signalling_nan_is_read() -> None:
    """A float changes these bytes, so that they are taken from the payload."""
    sea, message = Px4Sea(), dialect.by_name("PARAM_VALUE")
    payload = struct.pack("<iHH16sB", 0x7F800001, 3, 0, b"BAT_N", INT32)
    (frame,) = Framer().feed(encode_payload(message, payload, 0, *VEHICLE))
    request = sea.client.get("BAT_N")
    request.poll(0.0)
    request.feed(frame)
    assert request.result() == 0x7F800001
