"""State on disk: the plans of the last run, and the state to continue a dive from after a crash.

Files in the state folder, each with the vehicle's system id in its name:

- ``mission-1.json``, ``fence-1.json``, ``rally-1.json``: the loaded plans, each written when it
  changes, loaded at every start.
- ``checkpoint-1.json``: the state of the tick without the plans while the vehicle is armed, written
  several times per second and removed when the vehicle is disarmed or the program ends on a signal.
  A start under supervision (``autopilot --supervised``) that finds one continues the dive from it.
"""

import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import NamedTuple

from autopilot.comms.sensor_clock import SensorClock
from autopilot.control.fence import Fence, Rally
from autopilot.control.sensor_health.types import Ahrs, Health
from autopilot.control.types import AutopilotState, MissionState
from autopilot.disk import BackgroundWriter, disk_error_text, rename_broken
from autopilot.record_json import RecordError, from_json, to_json
from mavlink_io.mission_items import FENCE_TYPE, MISSION_TYPE, RALLY_TYPE, MissionItem
from mavlink_io.text_files import read_text
from mavlink_io.user_data_dir import replace_file

CHECKPOINT_S = 0.2
"""Wall time between two checkpoints; the first tick after a crash continues from the last one."""
MAX_AGE_S = 10.0
"""Age above which a checkpoint is not continued: the vehicle has surfaced or was recovered.

The position does not advance while no program runs, and a vehicle without commands floats up."""


Items = tuple[MissionItem, ...]
"""Items of a plan."""
PLAN_NAMES = {MISSION_TYPE: "mission", FENCE_TYPE: "fence", RALLY_TYPE: "rally"}
"""Name of each kind of plan, by its MAV_MISSION_TYPE."""


class Checkpoint(NamedTuple):
    """What a new process needs to continue a dive."""

    written_unix_s: float
    hil: str
    """Address of the HIL link: a checkpoint belongs to the vehicle on that link."""
    state: AutopilotState
    """State of the last tick, without plans, sensor memory and faults."""
    clock: SensorClock
    intended_mode: int
    ground_was_received: bool
    """Whether a ground station was connected, so that its silence is a failsafe condition."""


class _StoredPlan(NamedTuple):
    """Content of the file of a plan."""

    items: Items


def plans_of(state: AutopilotState) -> dict[int, Items]:
    """Return the items of each kind of plan."""
    return {
        MISSION_TYPE: state.mission.items,
        FENCE_TYPE: state.fence.items,
        RALLY_TYPE: state.rally.items,
    }


class StateFiles:
    """Plans and checkpoint in a folder; without a folder nothing is stored."""

    def __init__(self, folder: Path | None, system: int, hil: str) -> None:
        self._folder, self._system, self._hil = folder, system, hil
        self._writer = BackgroundWriter("Plans and state", CHECKPOINT_S)
        self._stored: dict[int, Items] = {}
        """Items on disk by kind of plan; a kind is absent when there is no file."""
        self._checkpoint_exists = False

    def load_plan(self, kind: int) -> Items:
        """Return the stored plan of a kind; no items without one.

        Raises RecordError with the file and the reason if it cannot be read; a damaged file is
        then renamed to ``NAME.broken-N``.
        """
        path = self._path(PLAN_NAMES[kind])
        if path is None:
            return ()
        try:
            items = from_json(_StoredPlan, read_text(path)).items
            if any(item.mission_type != kind for item in items):
                raise RecordError("has items of another kind of plan")
        except (FileNotFoundError, NotADirectoryError):
            return ()
        except (OSError, UnicodeDecodeError, RecordError) as error:
            raise RecordError(f"{path}: {_reason(error)}; {rename_broken(path)}") from None
        self._stored[kind] = items
        return items

    def load_checkpoint(self) -> Checkpoint | None:
        """Return the checkpoint of a dive to continue; None without one.

        Raises RecordError with the file and the reason if it cannot be used.
        """
        path = self._path("checkpoint")
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
        if self._folder is None or not self._writer.ready(report):
            return
        state = read_state()
        changed = self._changed(plans_of(state))
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
        if changed or checkpoint is not None or self._checkpoint_exists:
            self._writer.start(partial(self._write, changed, checkpoint))

    def close(self, plans: Mapping[int, Items] | None) -> str:
        """Wait for the writer; return the error text, "" for success.

        ``plans`` are those at an ordered end: they are written, and no dive is continued. None
        is an end by an error: the next start under supervision continues the dive.
        """
        self._writer.close()
        try:
            if self._folder is not None and plans is not None:
                self._write(self._changed(plans), None)
        except OSError as error:
            return f"state is not stored: {disk_error_text(error)}"
        return ""

    def _path(self, name: str) -> Path | None:
        """Return the path of a file; None without a folder."""
        return self._folder / f"{name}-{self._system}.json" if self._folder else None

    def _changed(self, plans: Mapping[int, Items]) -> dict[int, Items]:
        """Return the plans that differ from those on disk."""
        return {kind: items for kind, items in plans.items() if items != self._stored.get(kind, ())}

    def _write(self, plans: Mapping[int, Items], checkpoint: Checkpoint | None) -> None:
        """Write plans, then write or remove the checkpoint. Raises OSError."""
        path = self._path("checkpoint")
        assert path is not None, "without a folder nothing is written"
        for kind, items in plans.items():
            self._replace(PLAN_NAMES[kind], _StoredPlan(items))
            self._stored[kind] = items
        if checkpoint is None:
            path.unlink(missing_ok=True)
        else:  # without waiting for the disk
            self._replace("checkpoint", checkpoint, durable=False)
        self._checkpoint_exists = checkpoint is not None

    def _replace(self, name: str, record: tuple[object, ...], *, durable: bool = True) -> None:
        """Replace a file. Raises OSError."""
        path = self._path(name)
        assert path is not None, "without a folder nothing is written"
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, to_json(record), durable=durable)


def _continuable(state: AutopilotState) -> AutopilotState:
    """Return the state without what a new process finds again: plans, sensor memory, test."""
    return state._replace(
        mission=state.mission._replace(items=()),
        fence=Fence(),
        rally=Rally(),
        ahrs=Ahrs(),
        health=Health(),
        test=None,
        actuator_tests=(),
    )


def continued_state(checkpoint: Checkpoint, loaded: AutopilotState) -> AutopilotState:
    """Return the state to continue from, with the plans that were loaded from their files.

    Without the items that the checkpoint belongs to, the mission starts again.
    """
    mission, items = checkpoint.state.mission, loaded.mission.items
    fits = mission.current <= len(items)
    return checkpoint.state._replace(
        mission=mission._replace(items=items) if fits else MissionState(items),
        fence=loaded.fence,
        rally=loaded.rally,
    )


def _reason(error: BaseException) -> str:
    """Return the text of an error."""
    return str(getattr(error, "strerror", None) or error)
