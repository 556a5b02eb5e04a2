"""Execution of received commands.

Clients fill unused parameters with NaN, repeat a command whose acknowledgement was lost, and send
some commands to component 0. Handlers accept all three. A command that must not be executed twice
is recorded, so that its repetition is only acknowledged.
"""

from typing import NamedTuple

from autopilot.commands import actuators, flight, maintenance, messages, sysid_commands
from autopilot.commands.jobs import AnswerCallback, Jobs
from autopilot.commands.types import CommandContext, CommandResult, Handler, JobProgress, MavCommand
from autopilot.comms.stream_rates import Schedule
from autopilot.control.requests import StopTest
from autopilot.control.types import ACCEPTED, UNSUPPORTED
from mavlink_io.mission_items import MavCmd
from mavlink_io.request import MavlinkId

HANDLERS: dict[int, Handler] = {
    command: handler
    for part in (flight, sysid_commands, actuators, messages, maintenance)
    for command, handler in part.HANDLERS.items()
}
"""Handler of each command."""
_NOT_IDEMPOTENT = frozenset(
    (
        MavCmd.CONDITION_YAW,
        MavCmd.MISSION_START,
        MavCmd.DO_SET_MISSION_CURRENT,
        MavCmd.PREFLIGHT_REBOOT_SHUTDOWN,
    )
)
"""Commands whose second execution has a further effect, for example a relative turn."""
REPETITION_TIMEOUT_S = 0.9
"""Wall time within which the same command of the same sender is a repetition.

MAVSDK repeats a command after 0.5 s."""


class _LastCommand(NamedTuple):
    """Last accepted command of a sender that must not be executed twice."""

    command: MavCommand
    mode: int
    """Mode after the command."""
    received_s: float


class Commander:
    """Vehicle side of the command protocol."""

    def __init__(self, context: CommandContext) -> None:
        self._context = context
        self._jobs = Jobs()
        self._last_commands: dict[MavlinkId, _LastCommand] = {}

    def execute(
        self,
        command: MavCommand,
        requester: MavlinkId,
        schedule: Schedule,
        answer: AnswerCallback,
        now_s: float,
    ) -> CommandResult:
        """Execute a command and acknowledge it; the caller sends the messages of the result.

        Parameters
        ----------
        command : MavCommand
            Received command.
        requester : MavlinkId
            Its sender.
        schedule : Schedule
            Telemetry schedule of the link of the command.
        answer : callable
            Sends an acknowledgement; for a long job it is called until the job ends.
        now_s : float
            Wall time.
        """
        original = command._replace(repetition=False)
        if progress := self._jobs.progress(requester, original, command.repetition, now_s):
            answer(progress)
            return CommandResult(progress.result)
        outcome = self._execute_once(original, command.repetition, requester, schedule, now_s)
        answer(JobProgress(outcome.result))
        if outcome.job is not None:
            self._jobs.begin(requester, original, outcome.job, answer, now_s)
        return outcome

    def cancel(self, number: int, now_s: float) -> None:
        """COMMAND_CANCEL: end a long job and acknowledge this to its requester, if there is one."""
        if self._jobs.cancel(number, now_s):
            self._context.vehicle.handle_request(StopTest())

    def poll(self, now_s: float) -> None:
        """Acknowledge the progress of long jobs."""
        self._jobs.poll(now_s)

    def _execute_once(
        self,
        command: MavCommand,
        repetition: bool,
        requester: MavlinkId,
        schedule: Schedule,
        now_s: float,
    ) -> CommandResult:
        """Execute a command, unless it is a repetition that must not be executed twice."""
        handler = HANDLERS.get(command.number)
        if handler is None:
            return CommandResult(UNSUPPORTED)
        if command.number not in _NOT_IDEMPOTENT:
            return handler(self._context, command, schedule)
        if self._was_executed(command, repetition, requester, now_s):
            return CommandResult(ACCEPTED)
        outcome = handler(self._context, command, schedule)
        if outcome.result == ACCEPTED:
            self._last_commands[requester] = _LastCommand(
                command, self._context.vehicle.state.mode, now_s
            )
        return outcome

    def _was_executed(
        self, command: MavCommand, repetition: bool, requester: MavlinkId, now_s: float
    ) -> bool:
        """Return whether a command was executed before; after a change of mode it is a new one."""
        previous = self._last_commands.get(requester)
        if (
            previous is None
            or previous.mode != self._context.vehicle.state.mode
            or repr(previous.command) != repr(command)
        ):
            return False
        return repetition or now_s - previous.received_s < REPETITION_TIMEOUT_S
