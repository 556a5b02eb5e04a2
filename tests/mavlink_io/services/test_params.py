"""The parameter protocol over lossy links."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_io.codec import Frame
from mavlink_io.request import ExchangeError
from mavlink_io.services.params import (
    DOES_NOT_EXIST,
    OUT_OF_RANGE,
    REAL32,
    ParamClient,
    ParamServer,
    as_real32,
)
from tests.helpers.lossy_link import GROUND, VEHICLE, Lost, Wire, nothing, settle


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


def test_param_integer_type_is_refused() -> None:
    sea = Sea()
    answers = sea.ask("PARAM_SET", param_id="P_07", param_value=4.2e-45, param_type=6)
    assert answers[0].error == OUT_OF_RANGE
    assert sea.texts == ["Parameter P_07: to be sent as REAL32, not as an integer"]
    assert sea.table.values["P_07"] == 0.7
