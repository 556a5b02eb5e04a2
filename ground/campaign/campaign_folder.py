"""A campaign's folder, read back: each log once."""

import json
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ground.campaign import refit
from ground.client import param_file
from ground.errors import InputError

if TYPE_CHECKING:
    from sysid.data.dataset import Log
    from sysid.data.segments import Run
    from sysid.models.model_file import IdentifiedModel
    from sysid.monitor.performance_spec import PerformanceBaseline

STAGES = {"initial": "baseline", "improved": "improved", "redesigned": "verification"}
"""Where the dives of each set of gains are kept; the paper's improved ones are flown where that was
asked for."""


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
    def model(self) -> "IdentifiedModel":
        """``model.json``."""
        return refit.read_model(self.path / "model.json")

    @cached_property
    def promise(self) -> "PerformanceBaseline":
        """What ``param_file.param`` promises."""
        return param_file.require_baseline(self.path / "gains.param")

    @cached_property
    def asked(self) -> str:
        """``campaign.toml`` as text."""
        return (self.path / "campaign.toml").read_text(encoding="utf-8")

    def log_path(self, stage: str, mission: str) -> Path:
        """Where the log of a dive is kept."""
        return self.path / stage / f"{mission}.mcap"

    def log(self, stage: str, mission: str) -> "Log":
        """One dive."""
        key = stage, mission
        if key not in self._logs:
            self._logs[key] = refit.read_log(self.log_path(stage, mission))
        return self._logs[key]

    def runs(self, mission: str) -> "list[Run]":
        """The tests of one identification dive."""
        from sysid.data import segments as runs

        return runs.cut_runs(self.log("identification", mission))
