"""Folder of a campaign before the first dive: what may be replaced or continued, and its options.

Files that no campaign writes are never removed.
"""

import fcntl
import importlib.metadata
import json
import os
import platform
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

from ground.campaign.campaign_folder import (
    CAMPAIGN_FILE,
    MISSIONS_FOLDER,
    SCENARIO_FILE,
    STAGES,
    TRUTH_FILE,
    CampaignFolder,
)
from ground.campaign.computations import FITTED, HELD_OUT, MISSIONS, RETESTS
from ground.campaign.dive_records import RECORDS_FILE
from ground.campaign.request import (
    ALL_MISSIONS,
    IDENTIFICATION,
    TRIM_MISSION,
    CampaignRequest,
    dive_seed,
)
from ground.output_files import is_same_file, temporary_name, write_whole
from mavlink_io.errors import InputError

DIVES = {
    "prototype": (TRIM_MISSION,),
    "identification": (*IDENTIFICATION, *RETESTS),
    **dict.fromkeys(STAGES.values(), MISSIONS),
}
"""Missions by the folder of their logs."""
RESULTS = ("report.html", "summary.json")
"""Files that only a finished campaign has."""
_PACKAGES = ("numpy", "scipy", "numba", "control", "mcap", "pymavlink")


def is_finished(out: Path) -> bool:
    """Return whether a folder holds a finished campaign.

    Parameters
    ----------
    out : Path
        The folder.

    Returns
    -------
    bool
        Whether all results are there and the records of the dives were removed.
    """
    results = all((out / name).is_file() for name in RESULTS)
    return results and not (out / RECORDS_FILE).exists()


class FolderLock:
    """Lock of a folder against other campaigns, until the end of a `with` block or the process."""

    def __init__(self, out: Path) -> None:
        self._out = out
        self._descriptor: int | None = None

    def __enter__(self) -> Self:
        """Lock the folder if it exists, and return this object. Raises InputError as `take`."""
        self.take()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        tb: TracebackType | None,
    ) -> None:
        """Release the folder."""
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
            os.close(descriptor)

    def take(self) -> None:
        """Lock the folder if it exists. Raises InputError if another campaign has locked it."""
        if self._descriptor is not None or not self._out.is_dir():
            return
        descriptor = os.open(self._out, os.O_RDONLY)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
            raise InputError(
                f"--out {self._out}: another campaign is running in this folder; wait for its end,"
                " or give another folder"
            ) from None
        except OSError:
            pass  # a file system without locks
        self._descriptor = descriptor


def refuse_folder(request: CampaignRequest) -> None:
    """Raise InputError if the folder is a file, or holds other files or another campaign."""
    out = request.out
    if request.resume and request.force:
        raise InputError("--resume cannot be combined with --force, which starts again")
    if out.is_dir():
        if any(_foreign_files(out)) and not (out / CAMPAIGN_FILE).is_file():
            raise InputError(
                f"--out {out}: holds files that are no campaign; give a new or an empty folder"
            )
        if (out / CAMPAIGN_FILE).is_file() and not request.force:
            if request.resume:
                _refuse_other_options(request)
                return
            state, hint = "an interrupted", ", --resume to continue it"
            if is_finished(out):
                state, hint = "a finished", ""
            logs = sum(path.suffix == ".mcap" for path in _campaign_files(out))
            raise InputError(
                f"--out {out}: holds {state} campaign ({logs} logs); give a new folder{hint}, or"
                " --force to replace it"
            )
        _refuse_removed_inputs(request)
    elif out.exists():
        raise InputError(f"--out {out}: is a file; give a folder")


def _refuse_removed_inputs(request: CampaignRequest) -> None:
    """Raise InputError if an input is a file of the old campaign that would be removed."""
    for path in _campaign_files(request.out):
        for name in (request.vehicle, request.truth, request.scenario):
            if is_same_file(path, Path(name)):
                raise InputError(
                    f"--out {request.out}: --force would remove {name}, which this command reads;"
                    " give another folder, or copy the file"
                )


def prepare_folder(request: CampaignRequest, scaled: Sequence[str] = ()) -> None:
    """Create the campaign folder, remove an old campaign from it, and write the options.

    `scaled` lists what was scaled to the vehicle.

    A campaign that is resumed keeps its files. Files that no campaign writes are kept too. Raises
    InputError, as `refuse_folder`, and for a campaign that other versions of the programs began.
    """
    refuse_folder(request)
    out = request.out
    text = _campaign_toml(request, scaled)
    if request.resume and (out / CAMPAIGN_FILE).is_file():
        if CampaignFolder(out).request_text != text:
            raise InputError(
                f"--resume: {out / CAMPAIGN_FILE} was written by other versions of Python or of the"
                " packages, which may give another model; use them, or --force to start again"
            )
        return
    for path in _campaign_files(out):
        path.unlink()
    for stage in (*DIVES, MISSIONS_FOLDER):
        if (out / stage).is_dir() and not any((out / stage).iterdir()):
            (out / stage).rmdir()
    out.mkdir(parents=True, exist_ok=True)
    write_whole(out / CAMPAIGN_FILE, text)


def _foreign_files(out: Path) -> Iterator[Path]:
    """Return the entries of a folder without those of a campaign that was killed as it began."""
    return (path for path in out.iterdir() if path.name != temporary_name(CAMPAIGN_FILE))


def _refuse_other_options(request: CampaignRequest) -> None:
    """Raise InputError if the campaign in the folder has other options."""
    folder = CampaignFolder(request.out)
    for key, value in _options(request).items():
        if (begun := folder.options.get(key)) != value:
            raise InputError(
                f"--resume: {request.out / CAMPAIGN_FILE} has {key} = {json.dumps(begun)}, not"
                f" {json.dumps(value)}; give the options of that campaign"
            )


def _campaign_files(out: Path) -> list[Path]:
    """Return the files of a campaign that are in a folder; the file of its options is last."""
    logs = [
        CampaignFolder(out).log_path(stage, name)
        for stage, names in DIVES.items()
        for name in names
    ]
    missions = [out / MISSIONS_FOLDER / f"{name}.toml" for name in (*ALL_MISSIONS, *RETESTS)]
    prepared = [out / name for name in (SCENARIO_FILE, TRUTH_FILE)]
    results = [out / name for name in (*RESULTS, "model.json", "gains.param", CAMPAIGN_FILE)]
    known = (out / RECORDS_FILE, *logs, *missions, *prepared, *results)
    return [path for path in known if path.is_file() or path.is_symlink()]


def _options(request: CampaignRequest) -> dict[str, object]:
    """Return the options that decide about the results."""
    options = {**request._asdict(), "truth": request.flown_vehicle}
    return {
        key: value
        for key, value in options.items()
        if key not in ("out", "force", "resume", "jobs")
    }


def _campaign_toml(request: CampaignRequest, scaled: Sequence[str]) -> str:
    """Return options, seeds and versions of a campaign as TOML."""
    lines = [f"{key} = {json.dumps(value)}" for key, value in _options(request).items()]
    if scaled:
        lines += ["scaled = [", *(f"  {json.dumps(note)}," for note in scaled), "]"]
    lines += ["", "[seeds]"]
    lines += [
        f"{m} = {dive_seed(request.seed, m)}" for m in (TRIM_MISSION, *MISSIONS, *FITTED, *HELD_OUT)
    ]
    lines += ["", "[versions]", f"python = {json.dumps(platform.python_version())}"]
    lines += [
        f"{package} = {json.dumps(importlib.metadata.version(package))}" for package in _PACKAGES
    ]
    return "\n".join(lines) + "\n"
