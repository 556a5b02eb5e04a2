"""A campaign's folder, read back: each log once."""

import json
import tomllib
from functools import cached_property
from pathlib import Path
from typing import Any

from ground.campaign import prototype, refit
from ground.client import param_file
from ground.errors import InputError
from sysid.data import segments
from sysid.data.dataset import Log
from sysid.data.segments import Run
from sysid.models.model_file import IdentifiedModel
from sysid.monitor.performance_spec import PerformanceBaseline

STAGES = {"initial": "baseline", "improved": "improved", "redesigned": "verification"}
"""Where the dives of each set of gains are kept; the paper's improved ones are flown where that was
asked for."""
CAMPAIGN_FILE = "campaign.toml"


class CampaignFolder:
    """What a campaign left behind. Raises BadInputError where something is missing."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._logs: dict[tuple[str, str], Log] = {}

    @cached_property
    def summary(self) -> dict[str, Any]:
        """``summary.json``."""
        try:
            found: dict[str, Any] = json.loads(
                (self.path / "summary.json").read_text(encoding="utf-8")
            )
        except OSError:
            raise InputError(
                f"{self.path}: holds no summary.json; give the folder of a finished campaign"
            ) from None
        except json.JSONDecodeError as error:
            raise InputError(f"{self.path / 'summary.json'}: not JSON: {error}") from None
        return found

    @cached_property
    def model(self) -> IdentifiedModel:
        """``model.json``."""
        return refit.read_model(self.path / "model.json")

    @cached_property
    def promise(self) -> PerformanceBaseline:
        """What ``param_file.param`` promises."""
        return param_file.require_baseline(self.path / "gains.param")

    @cached_property
    def asked(self) -> str:
        """``campaign.toml`` as text."""
        try:
            return (self.path / CAMPAIGN_FILE).read_text(encoding="utf-8")
        except OSError:
            raise InputError(
                f"{self.path}: holds no {CAMPAIGN_FILE}; give the folder of a campaign"
            ) from None

    @cached_property
    def prior(self) -> str:
        """Vehicle file that is known before the campaign: the flown vehicle's own, for Caribou
        ``bench``."""
        try:
            vehicle = tomllib.loads(self.asked)["vehicle"]
        except (tomllib.TOMLDecodeError, KeyError) as error:
            raise InputError(f"{self.path / CAMPAIGN_FILE}: names no vehicle ({error})") from None
        return prototype.prior_file_of(str(vehicle))

    @cached_property
    def prior_config(self) -> Any:
        """Content of the vehicle file ``prior``. Raises BadInputError."""
        return refit.read_vehicle(self.prior)

    def log_path(self, stage: str, mission: str) -> Path:
        """Where the log of a dive is kept."""
        return self.path / stage / f"{mission}.mcap"

    def log(self, stage: str, mission: str) -> Log:
        """One dive."""
        key = stage, mission
        if key not in self._logs:
            self._logs[key] = refit.read_log(self.log_path(stage, mission))
        return self._logs[key]

    def runs(self, mission: str) -> list[Run]:
        """The tests of one identification dive."""

        return segments.cut_runs(self.log("identification", mission))
