"""Geofence and rally points on disk: written when they change, loaded at the next start."""

import json
from pathlib import Path

from mavlink_io.mission_items import FENCE_TYPE, RALLY_TYPE, MissionItem
from mavlink_io.user_data_dir import replace_file

FILES = {FENCE_TYPE: "fence.json", RALLY_TYPE: "rally.json"}
"""File of each kind of plan."""
MAX_BYTES = 1_000_000
"""Maximum size of a file: 1000 items need 200 kB."""


class PlanStore:
    """The plan files in a folder; without a folder nothing is stored."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self.problems: list[str] = []
        """Problems of the files, found when they were loaded."""

    def load(self, kind: int) -> tuple[MissionItem, ...]:
        """Return the stored items of a kind of plan; none if there is no usable file."""
        if self._folder is None:
            return ()
        path = self._folder / FILES[kind]
        try:
            if path.stat().st_size > MAX_BYTES:
                raise ValueError("too large")
            rows = json.loads(path.read_text(encoding="utf-8"))
            return tuple(_item(row, kind) for row in rows)
        except (FileNotFoundError, NotADirectoryError):
            return ()
        except (OSError, ValueError, TypeError, RecursionError) as error:
            reason = getattr(error, "strerror", None) or "not a list of plan items"
            self.problems.append(f"{path}: {reason}; the plan is not used: upload it again")
            return ()

    def save(self, kind: int, items: tuple[MissionItem, ...]) -> str:
        """Replace the stored items. Return the error text, "" for success."""
        if self._folder is None:
            return ""
        path = self._folder / FILES[kind]
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            replace_file(path, json.dumps([list(item) for item in items]) + "\n")
        except OSError as error:
            return f"{path}: {error.strerror}; the plan is lost at the next start"
        return ""


def _item(row: list[float], kind: int) -> MissionItem:
    """Return an item of a row. Raises TypeError or ValueError."""
    sequence, frame, command, current, autocontinue, p1, p2, p3, p4, x, y, z, mission_type = row
    if mission_type != kind:
        raise ValueError(f"plan type {mission_type}")
    return MissionItem(
        sequence=int(sequence),
        frame=int(frame),
        command=int(command),
        current=int(current),
        autocontinue=int(autocontinue),
        p1=float(p1),
        p2=float(p2),
        p3=float(p3),
        p4=float(p4),
        x=int(x),
        y=int(y),
        z=float(z),
        mission_type=kind,
    )
