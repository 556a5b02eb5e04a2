"""Message intervals, requested messages and the rate limit of texts."""

from collections.abc import Callable

import pytest
from pymavlink.dialects.v20 import all as mavlink

from autopilot.control.types import Severity
from tests.helpers.commands import ACCEPTED, DENIED, results, under_way
from tests.helpers.fake_hil import Harness, only, texts


def test_heartbeat_interval_is_readable_but_constant(harness: Harness) -> None:
    assert only(harness.command(510, 0), "MESSAGE_INTERVAL").interval_us == 1_000_000
    assert results(harness.command(511, 0, 0)) == [ACCEPTED]
    assert results(harness.command(511, 0, 1_000_000)) == [ACCEPTED]
    for interval in (-1, 200_000):
        assert results(harness.command(511, 0, interval)) == [DENIED]


def test_interval_is_also_read_by_request_message(harness: Harness) -> None:
    """common.xml: REQUEST_MESSAGE with param1 244 and param2 the message; 510 is deprecated."""
    harness.command(511, 30, 500_000)
    for number, interval_us in ((30, 500_000), (0, 1_000_000), (77, 0)):
        answer = only(harness.command(512, 244, number), "MESSAGE_INTERVAL")
        assert (answer.message_id, answer.interval_us) == (number, interval_us)


def test_request_data_stream_has_no_effect_and_no_reply(harness: Harness) -> None:
    before = [link.schedule.interval_us(30) for link in harness.server.links]
    answers = harness.ask(mavlink.MAVLink_request_data_stream_message(1, 1, 0, 4, 1))
    assert [m.get_type() for m in answers] == ["HEARTBEAT"], "only the heartbeat for a new sender"
    assert [link.schedule.interval_us(30) for link in harness.server.links] == before


def test_requested_loop_signals_match_trace(harness: Harness) -> None:
    under_way(harness)
    harness.command(511, 251, 100_000)
    harness.command(511, 350, 100_000)
    harness.station.pop_received()
    harness.tick(10, depth_m=5.0)
    received = harness.station.pop_received()
    named = {m.name: m.value for m in received if m.get_type() == "NAMED_VALUE_FLOAT"}
    assert set(named) == {"DPT_ERR", "PTCH_ERR", "HDG_ERR", "SID_IN", "SID_FREQ"}
    trace = harness.vehicle.snapshot().trace
    assert named["DPT_ERR"] == pytest.approx(trace.depth_error_m, abs=0.05)
    arrays = [m for m in received if m.get_type() == "DEBUG_FLOAT_ARRAY"]
    assert len(arrays) == 2
    assert (arrays[-1].name, arrays[-1].array_id) == ("TRACE", 1)
    assert arrays[-1].data[: len(trace)] == pytest.approx(list(trace), abs=0.05)


def test_text_rate_limit_drops_texts_but_not_critical_ones(
    harness: Harness, pass_time: Callable[[float], None]
) -> None:
    for number in range(100):
        harness.vehicle.send_statustext(f"text {number}")
    harness.vehicle.send_statustext("Leak detected", Severity.EMERGENCY)
    harness.serve()
    sent_texts = texts(harness.station.pop_received())
    assert sent_texts[:3] == ["text 0", "text 1", "text 2"]
    assert 15 <= len(sent_texts) <= 25
    assert sent_texts[-1] == "Leak detected"
    assert f"{100 - (len(sent_texts) - 2)} messages left out" in sent_texts
    pass_time(10.0)
    harness.vehicle.send_statustext("later")
    harness.serve()
    assert texts(harness.station.pop_received()) == ["later"]
