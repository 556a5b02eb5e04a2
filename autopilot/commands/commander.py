"""Carries commands out.

Clients fill every parameter they do not mean with NaN, repeat a command whose acknowledgement was
lost, and send some commands to component 0: every handler is indifferent to all three, but for
those whose repetition would do more than the first. Those are remembered."""

from typing import NamedTuple

from autopilot.commands import actuators, flight, maintenance, messages, sysid_commands
from autopilot.commands.jobs import AnswerCallback, Jobs
from autopilot.commands.types import CommandResult, Desk, Handler, JobProgress, MavCommand
from autopilot.comms.stream_rates import Schedule
from autopilot.control.requests import StopTest
from autopilot.control.types import ACCEPTED, UNSUPPORTED
from mavlink_io.mission_items import MavCmd
from mavlink_io.request import MavlinkId

_TABLE: dict[int, Handler] = {
    command: handler
    for part in (flight, sysid_commands, actuators, messages, maintenance)
    for command, handler in part.HANDLERS.items()
}
_NOT_IDEMPOTENT = frozenset(
    (
        MavCmd.CONDITION_YAW,
        MavCmd.MISSION_START,
        MavCmd.DO_SET_MISSION_CURRENT,
        MavCmd.PREFLIGHT_REBOOT_SHUTDOWN,
    )
)
"""Turn by so much, go to that item: the second time means more than the first."""
REPEATED_WITHIN_S = 0.9
"""Wall time in which the same words from the same sender are the same command: MAVSDK repeats after
half a second."""


class _LastCommand(NamedTuple):
    """What a sender asked last, and what came of it."""

    command: MavCommand
    mode: int
    heard_s: float


class Commander:
    """The vehicle's end of the command protocol."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._jobs = Jobs()
        self._heard: dict[MavlinkId, _LastCommand] = {}

    def execute(
        self,
        command: MavCommand,
        asker: MavlinkId,
        schedule: Schedule,
        answer: AnswerCallback,
        now_s: float,
    ) -> CommandResult:
        """Carry a command out and acknowledge it by ``answer``, a long job until its end.

        ``schedule`` is that of the link it came by. What is left to the caller is to send the
        outcome's messages."""
        words = command._replace(repetition=False)
        if seen := self._jobs.progress(asker, words, command.repetition, now_s):
            answer(seen)
            return CommandResult(seen.result)
        outcome = self._once(words, command.repetition, asker, schedule, now_s)
        answer(JobProgress(outcome.result))
        if outcome.job is not None:
            self._jobs.begin(asker, words, outcome.job, answer, now_s)
        return outcome

    def cancel(self, number: int, now_s: float) -> None:
        """COMMAND_CANCEL: end a long job, which whoever asked for it is told. Without one there is
        nothing to do."""
        if self._jobs.cancel(number, now_s):
            self._desk.vehicle.request(StopTest())

    def poll(self, now_s: float) -> None:
        self._jobs.poll(now_s)

    def _once(
        self,
        command: MavCommand,
        repetition: bool,
        asker: MavlinkId,
        schedule: Schedule,
        now_s: float,
    ) -> CommandResult:
        """Carry a command out, unless it is the same one again and must not be done twice."""
        handler = _TABLE.get(command.number)
        if handler is None:
            return CommandResult(UNSUPPORTED)
        if command.number not in _NOT_IDEMPOTENT:
            return handler(self._desk, command, schedule)
        if self._done(command, repetition, asker, now_s):
            return CommandResult(ACCEPTED)
        outcome = handler(self._desk, command, schedule)
        if outcome.result == ACCEPTED:
            self._heard[asker] = _LastCommand(command, self._desk.vehicle.state.mode, now_s)
        return outcome

    def _done(self, command: MavCommand, repetition: bool, asker: MavlinkId, now_s: float) -> bool:
        """Whether a command was carried out before. In another mode it is a new wish: somebody left
        the old one."""
        before = self._heard.get(asker)
        if (
            before is None
            or before.mode != self._desk.vehicle.state.mode
            or repr(before.command) != repr(command)
        ):
            return False
        return repetition or now_s - before.heard_s < REPEATED_WITHIN_S
