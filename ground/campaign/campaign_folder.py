"""Reader of a campaign folder, which reads each log once, and again if its dive is repeated."""

import tomllib
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, Self

from ground.campaign import prototype, refit, summary_file
from ground.campaign.summary_file import CampaignSummary
from ground.client import param_file
from mavlink_io.errors import InputError
from mavlink_io.text_files import parse_toml, read_text
from sysid.data import segments
from sysid.data.dataset import Log
from sysid.data.runs import Run
from sysid.models.model_file import IdentifiedModel
from sysid.monitor.performance_spec import PerformanceBaseline

STAGES = {"initial": "baseline", "improved": "improved", "redesigned": "verification"}
"""Folder of the dives by set of gains; `improved` exists only with `--include-paper-gains`."""
CAMPAIGN_FILE = "campaign.toml"
SCENARIO_FILE, TRUTH_FILE, MISSIONS_FOLDER = "scenario.toml", "truth.toml", "missions"
"""Scenario, flown vehicle and folder of missions, if they are not the shipped ones."""


class _FileVersion(NamedTuple):
    """Content of a file, as far as its status identifies it; zeros if it is missing."""

    inode: int
    modified_ns: int
    size: int

    @classmethod
    def of(cls, path: Path) -> Self:
        """Return the version of a file at present."""
        try:
            status = path.stat()
        except OSError:
            return cls(0, 0, 0)
        return cls(status.st_ino, status.st_mtime_ns, status.st_size)


class CampaignFolder:
    """The files of a campaign. Methods raise InputError if a file is missing or invalid."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._logs: dict[Path, tuple[_FileVersion, Log]] = {}

    @cached_property
    def summary(self) -> CampaignSummary:
        """Content of `summary.json`."""
        return summary_file.read(self.path / "summary.json")

    @cached_property
    def model(self) -> IdentifiedModel:
        """The model in `model.json`."""
        return refit.read_model(self.path / "model.json")

    def forget_model(self) -> None:
        """Read `model.json` again when it is needed next."""
        self.__dict__.pop("model", None)

    @cached_property
    def baseline(self) -> PerformanceBaseline:
        """Predicted performance in `gains.param`."""
        return param_file.require_baseline(self.path / "gains.param")

    @cached_property
    def request_text(self) -> str:
        """Text of `campaign.toml`."""
        try:
            return read_text(self.path / CAMPAIGN_FILE)
        except OSError:
            raise InputError(
                f"{self.path}: holds no {CAMPAIGN_FILE}; give the folder of a campaign"
            ) from None
        except UnicodeDecodeError:
            raise InputError(f"{self.path / CAMPAIGN_FILE}: is no text in UTF-8") from None

    @cached_property
    def prior(self) -> str:
        """Vehicle file that is known before the campaign; `caribou_nominal` for Caribou."""
        try:
            vehicle = self.options["vehicle"]
        except KeyError as error:
            raise InputError(f"{self.path / CAMPAIGN_FILE}: names no vehicle ({error})") from None
        return prototype.prior_file_of(str(vehicle))

    @property
    def scaled(self) -> tuple[str, ...]:
        """What was scaled to the vehicle, one line each; empty for Caribou."""
        return tuple(self.options.get("scaled", ()))

    @cached_property
    def options(self) -> dict[str, Any]:
        """Content of `campaign.toml`."""
        try:
            return parse_toml(self.request_text)
        except tomllib.TOMLDecodeError as error:
            raise InputError(f"{self.path / CAMPAIGN_FILE}: is no valid TOML: {error}") from None

    @cached_property
    def prior_config(self) -> Any:
        """Content of the vehicle file from which the model was fitted. Raises InputError.

        It is in the model: the file itself may be gone or changed since.
        """
        return self.model.vehicle.file

    def log_path(self, stage: str, mission: str) -> Path:
        """Return the path of the log of a dive."""
        return self.path / stage / f"{mission}.mcap"

    def flown(self, path: str, otherwise: str) -> str:
        """Return a file of the folder as a path if it exists, else `otherwise`."""
        file = self.path / path
        return str(file) if file.is_file() else otherwise

    def mission_file(self, mission: str) -> str:
        """Return the path of a mission in the folder, or its name if it is the shipped one."""
        return self.flown(f"{MISSIONS_FOLDER}/{mission}.toml", mission)

    def log(self, stage: str, mission: str) -> Log:
        """Return the log of a dive."""
        path = self.log_path(stage, mission)
        version = _FileVersion.of(path)  # before it is read: it may be written meanwhile
        if path not in self._logs or self._logs[path][0] != version:
            self._logs[path] = version, refit.read_log(path)
        return self._logs[path][1]

    def runs(self, mission: str) -> list[Run]:
        """Return the tests of an identification dive."""
        return segments.cut_runs(self.log("identification", mission))
