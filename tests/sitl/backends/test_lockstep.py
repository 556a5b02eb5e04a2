"""Timeouts of the lockstep without an autopilot, on a link inside the process."""

import pytest

from mavlink_io.transport import Transport
from sitl.backends import lockstep
from sitl.backends.hil import HilClient
from sitl.backends.lockstep import AutopilotTimeoutError, Lockstep


def test_timeout_before_first_answer_is_reported(
    ends: tuple[Transport, Transport], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lockstep, "FIRST_ANSWER_TIMEOUT_S", 0.1)
    with pytest.raises(AutopilotTimeoutError, match="no autopilot has answered on memory:backend"):
        Lockstep(HilClient(ends[0]), lambda: False).exchange(b"sensors", 0)
    assert ends[1].receive() == b"sensors"
    assert ends[1].receive() == b"sensors"


def test_stop_request_ends_the_wait(ends: tuple[Transport, Transport]) -> None:
    answers = iter([False, False, True])
    assert Lockstep(HilClient(ends[0]), lambda: next(answers)).exchange(b"sensors", 0) is None
