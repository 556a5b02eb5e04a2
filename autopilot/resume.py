"""State on disk: the mission of the last run, and the state to continue a dive from after a crash.

Two files in the state folder, each with the vehicle's system id in its name:

- ``mission-1.json``: the loaded mission, written when it changes, loaded at every start.
- ``checkpoint-1.json``: the complete state of the tick while the vehicle is armed, written several
  times per second and removed when the vehicle is disarmed or the program ends on a signal. A
  start under supervision (``autopilot --supervised``) that finds one continues the dive from it.

A separate thread writes, so that a slow disk never delays a tick.
"""

import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from autopilot.comms.sensor_clock import SensorClock
from autopilot.control.sensor_health.types import Ahrs, Health
from autopilot.control.types import AutopilotState, MissionState
from autopilot.record_json import RecordError, from_json, to_json
from mavlink_io.clock import Interval
from mavlink_io.mission_items import MissionItem
from mavlink_io.text_files import read_text
from mavlink_io.user_data_dir import replace_file

CHECKPOINT_S = 0.2
"""Wall time between two checkpoints; the first tick after a crash continues from the last one."""
MAX_AGE_S = 10.0
"""Age above which a checkpoint is not continued: the vehicle has surfaced or was recovered.

The position does not advance while no program runs, and a vehicle without commands floats up."""


class Checkpoint(NamedTuple):
    """What a new process needs to continue a dive."""

    written_unix_s: float
    hil: str
    """Address of the HIL link: a checkpoint belongs to the vehicle on that link."""
    state: AutopilotState
    """State of the last tick, without mission items, sensor memory and faults."""
    clock: SensorClock
    intended_mode: int
    ground_was_received: bool
    """Whether a ground station was connected, so that its silence is a failsafe condition."""


class _StoredMission(NamedTuple):
    """Content of the mission file."""

    items: tuple[MissionItem, ...]


class StateFiles:
    """Mission and checkpoint in a folder; without a folder nothing is stored."""

    def __init__(self, folder: Path | None, system: int, hil: str) -> None:
        self._mission = folder / f"mission-{system}.json" if folder else None
        self._checkpoint = folder / f"checkpoint-{system}.json" if folder else None
        self._hil = hil
        self._writer = ThreadPoolExecutor(max_workers=1)
        self._writing: Future[None] | None = None
        self._stored_items: tuple[MissionItem, ...] = ()
        self._checkpoint_exists = False
        self._due = Interval(CHECKPOINT_S)
        self._failed = False

    def load_mission(self) -> tuple[MissionItem, ...]:
        """Return the stored mission; no items without one.

        Raises RecordError with the file and the reason if it cannot be read; a damaged file is
        then renamed to ``NAME.broken``.
        """
        path = self._mission
        if path is None:
            return ()
        try:
            self._stored_items = from_json(_StoredMission, read_text(path)).items
        except (FileNotFoundError, NotADirectoryError):
            return ()
        except (OSError, UnicodeDecodeError, RecordError) as error:
            renamed = _rename_broken(path)
            raise RecordError(f"{path}: {_reason(error)}{renamed}") from None
        return self._stored_items

    def load_checkpoint(self) -> Checkpoint | None:
        """Return the checkpoint of a dive to continue; None without one.

        Raises RecordError with the file and the reason if it cannot be used.
        """
        path = self._checkpoint
        if path is None:
            return None
        try:
            checkpoint = from_json(Checkpoint, read_text(path))
        except (FileNotFoundError, NotADirectoryError):
            return None
        except (OSError, UnicodeDecodeError, RecordError) as error:
            raise RecordError(f"{path}: {_reason(error)}") from None
        self._checkpoint_exists = True
        age_s = time.time() - checkpoint.written_unix_s
        if abs(age_s) > MAX_AGE_S:
            raise RecordError(
                f"{path}: is {age_s:.0f} s old, at most {MAX_AGE_S:g} s are continued"
            )
        if checkpoint.hil != self._hil:
            raise RecordError(f"{path}: belongs to {checkpoint.hil}, not to {self._hil}")
        return checkpoint

    def poll(
        self,
        read_state: Callable[[], AutopilotState],
        clock: SensorClock,
        intended_mode: int,
        ground_was_received: bool,
        report: Callable[[str], None],
    ) -> None:
        """Start to write what has changed, and report a write that failed once.

        Parameters
        ----------
        read_state : callable
            Returns the state after the last tick; called only when a write is due.
        clock : SensorClock
            State of the check of the sensors' time stamps.
        intended_mode : int
            Mode that was requested last.
        ground_was_received : bool
            Whether a ground station was ever received.
        report : callable
            Sends a text to ground.
        """
        if self._writing is not None and self._writing.done():
            self._report(self._writing.exception(), report)
            self._writing = None
        if self._mission is None or self._writing is not None or not self._due.due():
            return
        state = read_state()
        items = None if state.mission.items == self._stored_items else state.mission.items
        checkpoint = None
        if state.armed:
            checkpoint = Checkpoint(
                written_unix_s=time.time(),
                hil=self._hil,
                state=_continuable(state),
                clock=clock,
                intended_mode=intended_mode,
                ground_was_received=ground_was_received,
            )
        if items is None and checkpoint is None and not self._checkpoint_exists:
            return
        self._stored_items = state.mission.items
        self._checkpoint_exists = checkpoint is not None
        self._writing = self._writer.submit(self._write, items, checkpoint)

    def close(self, items: tuple[MissionItem, ...] | None) -> str:
        """Wait for the writer; return the error text, "" for success.

        ``items`` is the mission at an ordered end: it is written, and no dive is continued. None
        is an end by an error: the next start under supervision continues the dive.
        """
        self._writer.shutdown()
        try:
            if items is not None:
                if self._mission is not None and items != self._stored_items:
                    self._write_mission(items)
                self._remove_checkpoint()
        except OSError as error:
            return f"state is not stored: {error.strerror}: {error.filename}"
        return ""

    def _write(self, items: tuple[MissionItem, ...] | None, checkpoint: Checkpoint | None) -> None:
        """Write a changed mission, then write or remove the checkpoint. Raises OSError."""
        if items is not None:
            self._write_mission(items)
        if checkpoint is None:
            self._remove_checkpoint()
        else:
            self._write_checkpoint(checkpoint)

    def _write_mission(self, items: tuple[MissionItem, ...]) -> None:
        """Replace the mission file. Raises OSError."""
        assert self._mission is not None, "without a folder nothing is written"
        self._mission.parent.mkdir(parents=True, exist_ok=True)
        replace_file(self._mission, to_json(_StoredMission(items)))

    def _write_checkpoint(self, checkpoint: Checkpoint) -> None:
        """Replace the checkpoint file, without waiting for the disk. Raises OSError."""
        assert self._checkpoint is not None, "without a folder nothing is written"
        self._checkpoint.parent.mkdir(parents=True, exist_ok=True)
        replace_file(self._checkpoint, to_json(checkpoint), durable=False)

    def _remove_checkpoint(self) -> None:
        """Remove the checkpoint file. Raises OSError."""
        if self._checkpoint is not None:
            self._checkpoint.unlink(missing_ok=True)

    def _report(self, error: BaseException | None, report: Callable[[str], None]) -> None:
        """Report the first of several failures in a row."""
        if error is not None and not self._failed:
            report(
                f"Mission and state are not stored: {_reason(error)}: the dive goes on;"
                " free the disk or start with another --state"
            )
        self._failed = error is not None


def _continuable(state: AutopilotState) -> AutopilotState:
    """Return the state without what a new process finds again: items, sensor memory, test."""
    return state._replace(
        mission=state.mission._replace(items=()),
        ahrs=Ahrs(),
        health=Health(),
        test=None,
        actuator_tests=(),
    )


def continued_state(checkpoint: Checkpoint, items: tuple[MissionItem, ...]) -> AutopilotState:
    """Return the state to continue from, with the items of the mission file.

    Without the items that the checkpoint belongs to, the mission starts again.
    """
    mission = checkpoint.state.mission
    fits = mission.current <= len(items)
    return checkpoint.state._replace(
        mission=mission._replace(items=items) if fits else MissionState(items)
    )


def _rename_broken(path: Path) -> str:
    """Rename a file that cannot be read; return what was done."""
    backup = path.with_name(f"{path.name}.broken")
    try:
        path.replace(backup)
    except OSError as error:
        return f"; cannot be renamed: {error.strerror}"
    return f"; renamed to {backup.name}"


def _reason(error: BaseException) -> str:
    """Return the text of an error."""
    return str(getattr(error, "strerror", None) or error)
