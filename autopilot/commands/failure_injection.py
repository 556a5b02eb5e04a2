"""Relay of MAV_CMD_INJECT_FAILURE: the autopilot passes the order to the simulator.

The parameter SYS_FAILURE_EN enables it. The requester receives IN_PROGRESS until the simulator
replies, and UNSUPPORTED without a reply: a real vehicle does not reply.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from autopilot.commands.jobs import PROGRESS_PERIOD_S
from autopilot.control.types import DENIED, IN_PROGRESS, UNSUPPORTED
from mavlink_io.request import MavlinkId

ANSWER_TIMEOUT_S = 3.0
"""Wall time within which the simulator must reply."""

InjectionOrder = tuple[float, float, float, float]
"""Unit, type, instance and size: param1 to param4; NaN where not given."""
InjectionAnswer = Callable[[int], None]
"""Function that acknowledges the command to its requester with a MAV_RESULT."""


class PendingOrder(NamedTuple):
    """An order without a final reply."""

    order: InjectionOrder
    requester: MavlinkId
    answer: InjectionAnswer
    requested_s: float
    acknowledged_s: float
    """Wall time of the last acknowledgement."""


class FailureRelay:
    """Pending orders: sent to the simulator, and matched with its replies in the same order."""

    def __init__(self, report: Callable[[str], None]) -> None:
        self._report = report
        self._pending: list[PendingOrder] = []
        self._outgoing: list[InjectionOrder] = []

    def submit(
        self,
        command: Any,
        requester: MavlinkId,
        answer: InjectionAnswer,
        enabled: bool,
        now_s: float,
    ) -> None:
        """Accept an order; an order repeated while it is pending is sent once."""
        if not enabled:
            self._report("Failure refused: SYS_FAILURE_EN is 0")
            answer(DENIED)
            return
        order = command.p1, command.p2, command.p3, command.p4
        if any(repr((p.order, p.requester)) == repr((order, requester)) for p in self._pending):
            answer(IN_PROGRESS)
            return
        self._outgoing.append(order)
        self._pending.append(
            PendingOrder(
                order=order,
                requester=requester,
                answer=answer,
                requested_s=now_s,
                acknowledged_s=now_s,
            )
        )

    def pop_orders(self) -> list[InjectionOrder]:
        """Return the orders to send to the simulator since the last call."""
        orders, self._outgoing = self._outgoing, []
        return orders

    def on_result(self, result: int) -> None:
        """Pass the simulator's MAV_RESULT to the requester of the oldest pending order."""
        if self._pending:
            self._pending.pop(0).answer(result)

    def poll(self, now_s: float) -> None:
        """Send IN_PROGRESS to requesters, and UNSUPPORTED after ANSWER_TIMEOUT_S."""
        still_pending: list[PendingOrder] = []
        for pending in self._pending:
            if now_s - pending.requested_s > ANSWER_TIMEOUT_S:
                self._report("Failure refused: no simulator answers")
                pending.answer(UNSUPPORTED)
            elif now_s - pending.acknowledged_s > PROGRESS_PERIOD_S:
                pending.answer(IN_PROGRESS)
                still_pending.append(pending._replace(acknowledged_s=now_s))
            else:
                still_pending.append(pending)
        self._pending = still_pending
