"""MAV_CMD_INJECT_FAILURE on its way through: the autopilot breaks nothing, it passes the wish on to
a simulator.

Off unless the parameter SYS_FAILURE_EN says otherwise. Whoever asked hears IN_PROGRESS until the
simulator's verdict is there, and UNSUPPORTED where none answers: a real vehicle has nobody to break
her."""

from collections.abc import Callable
from typing import Any, NamedTuple

from autopilot.commands.jobs import PROGRESS_PERIOD_S
from autopilot.control.types import DENIED, IN_PROGRESS, UNSUPPORTED
from mavlink_io.request import MavlinkId

ANSWER_TIMEOUT_S = 3.0
"""Wall time for the simulator's verdict."""

InjectionOrder = tuple[float, float, float, float]
"""Unit, type, instance and size: param1 to param4. NaN where not given."""
InjectionAnswer = Callable[[int], None]
"""Acknowledges the command to whoever asked, with a MAV_RESULT."""


class Pending(NamedTuple):
    order: InjectionOrder
    asker: MavlinkId
    answer: InjectionAnswer
    asked_s: float
    told_s: float
    """When the asker was last told something."""


class FailureRelay:
    """The orders under way: out to the simulator, verdicts back, in the order in which they were
    given."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._pending: list[Pending] = []
        self._outgoing: list[InjectionOrder] = []

    def ask(
        self, command: Any, asker: MavlinkId, answer: InjectionAnswer, enabled: bool, now_s: float
    ) -> None:
        """Take an order; one that is repeated while it is under way goes out once."""
        if not enabled:
            self._say("Failure refused: SYS_FAILURE_EN is 0")
            answer(DENIED)
            return
        order = command.p1, command.p2, command.p3, command.p4
        if any(repr((each.order, each.asker)) == repr((order, asker)) for each in self._pending):
            answer(IN_PROGRESS)
            return
        self._outgoing.append(order)
        self._pending.append(Pending(order, asker, answer, now_s, now_s))

    def take_orders(self) -> list[InjectionOrder]:
        """What is to go to the simulator since the last call."""
        taken, self._outgoing = self._outgoing, []
        return taken

    def judged(self, result: int) -> None:
        """The simulator's verdict on the oldest order that is under way."""
        if self._pending:
            self._pending.pop(0).answer(result)

    def poll(self, now_s: float) -> None:
        """Reassure those who wait, and give up on a simulator that does not answer."""
        waiting: list[Pending] = []
        for each in self._pending:
            if now_s - each.asked_s > ANSWER_TIMEOUT_S:
                self._say("Failure refused: no simulator answers")
                each.answer(UNSUPPORTED)
            elif now_s - each.told_s > PROGRESS_PERIOD_S:
                each.answer(IN_PROGRESS)
                waiting.append(each._replace(told_s=now_s))
            else:
                waiting.append(each)
        self._pending = waiting
