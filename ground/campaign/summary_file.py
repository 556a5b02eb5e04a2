"""`summary.json`: the result of a campaign, written and read through one type.

`python -m ground.campaign.summary_file > docs/summary.schema.json` writes its JSON Schema.
"""

import sys
from pathlib import Path

import msgspec

from mavlink_io.errors import InputError
from mavlink_io.text_files import MAX_TEXT_BYTES, read_limited
from sysid.design.specification import DesignRobustness, MinimumVariance, Response, Spec
from sysid.models.json_record import JsonRecord, decode, encode, format_of, schema_of
from sysid.models.model_file import Coefficient, Method, PlaneModel
from sysid.monitor import MonitorReport
from sysid.monitor.tracking_metrics import TrackingMetrics
from sysid.monte_carlo.gain_selection import GainSelection
from sysid.planes import Plane
from sysid.validation.results import Correction, Crossover, Excess, ModelAssessment

FORMAT = 1
PAPER_VEHICLE = "caribou_nominal"
"""Vehicle of the paper; for it tables and reports show the paper's values too."""
Pole = tuple[float, float]
"""Real and imaginary part (rad/s)."""


class RateErrors(JsonRecord, frozen=True):
    """Mean squared rate errors of one plane, (deg/s)^2, over whole tests and their first 10 s."""

    initial_model_deg2ps2: float
    refitted_model_deg2ps2: float
    opening_initial_model_deg2ps2: float
    opening_refitted_model_deg2ps2: float


class ValidationSummary(JsonRecord, frozen=True):
    """Validation of one plane without its single runs and its frequency response."""

    held_out: Excess | None
    coherence_at_crossover: float | None
    crossover: Crossover | None
    correction: Correction | None


class AlternativeSummary(JsonRecord, frozen=True):
    """Fit of the same runs by another method."""

    planes: dict[Plane, PlaneModel]
    coefficients: dict[str, float]
    rank: int
    fitted_rate_error: dict[Plane, RateErrors]
    held_out_rate_error: dict[Plane, RateErrors]


class ModelSummary(JsonRecord, frozen=True):
    """Identified model; the names are those of ``model.json``."""

    method: Method
    speed_mps: float
    planes: dict[Plane, PlaneModel]
    coefficients: dict[str, Coefficient]
    rank: int
    condition_number: float | None
    fitted_rate_error: dict[Plane, RateErrors]
    held_out_rate_error: dict[Plane, RateErrors]
    runs_accepted: int
    """Number of runs that were fitted."""
    runs_rejected: int
    """Number of runs that the screening rejected."""
    validation: dict[Plane, ValidationSummary]
    assessment: ModelAssessment | None
    alternative_methods: dict[Method, AlternativeSummary]


class MarginsSummary(JsonRecord, frozen=True):
    """Stability margins of a loop that is opened at one point."""

    gm_db: float | None
    """Smallest gain margin, up or down (dB); null if it is infinite."""
    pm_deg: float | None
    """Smallest phase margin (deg); null without a crossing of unit gain."""
    max_sensitivity: float
    """Maximum sensitivity Ms = max |1 / (1 + L)|."""
    crossover_radps: float | None
    """Highest frequency of unit gain (rad/s); null without a crossing."""


class LoopAnalysis(JsonRecord, frozen=True):
    """Poles, margins and predicted response of a set of gains on the identified model."""

    damping: dict[str, float]
    """Smallest damping ratio of the visible modes by loop."""
    poles_radps: dict[str, tuple[Pole, ...]]
    """Closed-loop poles by loop, slowest first."""
    visible_modes_radps: dict[str, tuple[Pole, ...]]
    """Poles that are visible in the motion of the loop, slowest first."""
    margins: dict[str, MarginsSummary]
    """Margins by the point where the loop is opened."""
    predicted: Response
    """Standard deviation of each signal in the disturbance of the tests."""


class PredictedError(JsonRecord, frozen=True):
    """Predicted statistics of one quantity in steady flight, in the unit of its name."""

    mean: float
    rms: float
    """Standard deviation about the mean."""
    p95: float
    """95 % of the samples are within this distance of the mean."""


class DesignSummary(JsonRecord, frozen=True):
    """Result of a redesign."""

    redesigned: LoopAnalysis
    initial: LoopAnalysis
    gains: dict[str, float]
    """Designed parameters by name."""
    reasons: dict[str, str]
    """Reason for each parameter."""
    specification: Spec
    robustness: DesignRobustness | None
    """Null for a model without covariance."""
    predicted: dict[str, PredictedError]
    """Predicted performance by quantity."""
    minimum_variance: MinimumVariance | None
    """Lower bound of the standard deviations; null if it has no numerical solution."""
    model_sha256: str
    selection: GainSelection | None = None
    """Null for a redesign without rehearsal."""

    @property
    def kept_first(self) -> bool:
        """Whether no redesigned gains were better, so that both sets of gains are the first one."""
        return self.selection is not None and self.selection.kept_first

    @property
    def final_set(self) -> str:
        """Word for the gains of the last dives: ``redesigned``, or ``kept`` for the first gains."""
        return "kept" if self.kept_first else "redesigned"


class SteadyErrorEntry(JsonRecord, frozen=True):
    """95 % bounds of the errors of straight runs, as in the paper's Table 5."""

    heading_deg: float
    pitch_deg: float
    depth_m: float


class RetestSummary(JsonRecord, frozen=True):
    """Dive with the test that the assessment of a model recommended."""

    mission: str
    test: str
    reason: str
    """Criterion that the model did not meet."""
    vehicle_s: float
    """Duration of the dive in vehicle time (s)."""
    fit_for_redesign: bool
    """Whether the model was fit for redesign with these tests."""


class CampaignSummary(JsonRecord, frozen=True):
    """Content of ``summary.json``."""

    format: int
    wall_s: float
    """Duration of the campaign by the wall clock (s)."""
    vehicle_s: float
    """Sum of the durations of the dives in vehicle time (s)."""
    messages: int
    """Number of recorded MAVLink messages."""
    lost_frames: int
    """Number of MAVLink frames that were lost."""
    seed: int
    trims: dict[str, float]
    """Measured trim parameters (deg)."""
    gains: dict[str, dict[str, float]]
    """Flown parameters by set of gains: initial, improved (on request), redesigned."""
    model: ModelSummary
    design: DesignSummary
    tracking: dict[str, dict[str, TrackingMetrics]]
    """Errors by mission and set of gains."""
    monitoring: dict[str, MonitorReport]
    """Comparison of the redesigned gains with their predicted performance, by mission."""
    steady_error: dict[str, SteadyErrorEntry]
    """Errors of straight runs by set of gains."""
    vehicle: str = PAPER_VEHICLE
    """Vehicle file from which the identification starts."""
    scaled: tuple[str, ...] = ()
    """Scaling of sea, missions and flown vehicle, one line each; empty for Caribou."""
    retests: tuple[RetestSummary, ...] = ()
    """Dives with recommended tests, in the order of flying; empty if the first model was fit."""


def write(summary: CampaignSummary, path: Path) -> None:
    """Write ``summary.json``; an existing file is overwritten."""
    path.write_bytes(encode(summary))


def read(path: Path) -> CampaignSummary:
    """Read ``summary.json``. Raises InputError naming the file and the key in error."""
    try:
        text = read_limited(path, MAX_TEXT_BYTES)
        file_format = format_of(text)
        if file_format != FORMAT:
            found = f"format = {file_format}" if file_format else "no 'format' key"
            raise InputError(
                f"{path}: {found}; this version reads format {FORMAT}: run the campaign again"
            )
        return decode(text, CampaignSummary)
    except OSError:
        raise InputError(
            f"{path.parent}: holds no {path.name}; give the folder of a finished campaign"
        ) from None
    except msgspec.MsgspecError as error:
        raise InputError(f"{path}: {error}; run the campaign again".replace("`", "'")) from None


def schema() -> bytes:
    """Return the JSON Schema of the format that this version reads and writes."""
    return schema_of(
        CampaignSummary, f"summary.json, format {FORMAT}: the result of `ground campaign`"
    )


if __name__ == "__main__":
    sys.stdout.buffer.write(schema())
