"""Format of `summary.json`: published schema, round trip, and errors that name file and key."""

import json
from pathlib import Path
from typing import Any

import msgspec
import pytest

from ground.campaign import summary_file
from ground.campaign.campaign_folder import CampaignFolder
from ground.campaign.summary_file import (
    CampaignSummary,
    DesignSummary,
    LoopAnalysis,
    MarginsSummary,
    ModelSummary,
    SteadyErrorEntry,
)
from mavlink_io.errors import InputError
from sysid.design.specification import DesignRobustness, MinimumVariance, Response, Spec
from sysid.monitor import Cause, MonitorReport
from sysid.monitor.sequential import RmsComparison
from sysid.monitor.tracking_metrics import Spread, SteadyWindow, TrackingMetrics

PUBLISHED = Path(__file__).parents[3] / "docs" / "summary.schema.json"
DESCRIBED = PUBLISHED.with_name("summary.md"), PUBLISHED.with_name("model.md")
SPREAD = Spread(p95=1.0, max=1.5, rms=0.5, mean=0.1)
ANALYSIS = LoopAnalysis(
    damping={"heading": 0.7},
    poles_radps={"heading": ((-0.1, 0.2), (-0.1, -0.2))},
    visible_modes_radps={"heading": ((-0.1, 0.2), (-0.1, -0.2))},
    margins={
        "rudder": MarginsSummary(gm_db=None, pm_deg=60.0, max_sensitivity=1.4, crossover_radps=0.8)
    },
    predicted=Response(0.4, 0.4, 0.03, 0.6, 0.6),
)
SUMMARY = CampaignSummary(
    format=summary_file.FORMAT,
    wall_s=32.7,
    vehicle_s=4836.9,
    messages=946665,
    lost_frames=0,
    seed=1,
    trims={"TRIM_RUD_DEG": 6.1},
    gains={"initial": {"HDG_P": 0.65}, "redesigned": {"HDG_P": 0.8}},
    model=ModelSummary(
        method="map",
        speed_mps=1.3,
        planes={},
        coefficients={},
        rank=26,
        condition_number=None,
        fitted_rate_error={},
        held_out_rate_error={},
        runs_accepted=24,
        runs_rejected=0,
        validation={},
        assessment=None,
        alternative_methods={},
    ),
    design=DesignSummary(
        redesigned=ANALYSIS,
        initial=ANALYSIS,
        gains={"HDG_P": 0.8},
        reasons={"HDG_P": "GM 9.8 dB"},
        specification=Spec(),
        robustness=DesignRobustness(0.9, 1.0, "", 240),
        predicted={},
        minimum_variance=MinimumVariance(0.02, 0.03, 0.004, 0.2, 0.012),
        model_sha256="ab" * 32,
    ),
    tracking={
        "straight_run": {
            "initial": TrackingMetrics(
                windows=(SteadyWindow(25.1, 300.1, 20.0, 3.0, SPREAD, SPREAD, SPREAD),),
                heading_deg=SPREAD,
                pitch_deg=SPREAD,
                depth_m=SPREAD,
                settling_s=25.0,
            )
        }
    },
    monitoring={
        "straight_run": MonitorReport(
            windows=12,
            steady_s=240.0,
            rms={"heading_deg": RmsComparison(measured=0.4, predicted=0.36)},
            causes=(Cause("sea", "disturbance larger than identified", refit_recommended=False),),
            detected_at_s=None,
            refit_recommended=False,
        )
    },
    steady_error={"initial": SteadyErrorEntry(heading_deg=1.2, pitch_deg=0.8, depth_m=0.3)},
)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    summary_file.write(SUMMARY, tmp_path / "summary.json")
    return tmp_path / "summary.json"


def test_published_schema_equals_records() -> None:
    command = "python -m ground.campaign.summary_file > docs/summary.schema.json"
    assert PUBLISHED.read_bytes() == summary_file.schema(), (
        f"the records have changed; run {command}"
    )


def test_every_key_is_described() -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in DESCRIBED)
    keys = {
        name
        for record in json.loads(summary_file.schema())["$defs"].values()
        for name in record.get("properties", {})
    }
    assert {name for name in keys if f"`{name}`" not in text} == set()


def test_summary_written_and_read_is_equal(file: Path) -> None:
    assert CampaignFolder(file.parent).summary == SUMMARY


def changed(path: str, value: Any) -> dict[str, Any]:
    """Return the summary with one key changed; None removes it."""
    plain: dict[str, Any] = msgspec.to_builtins(SUMMARY)
    *parents, key = path.split(".")
    table = plain
    for parent in parents:
        table = table[parent]
    if value is None:
        del table[key]
    else:
        table[key] = value
    return plain


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (changed("kept", {}), "unknown field 'kept'"),
        (changed("design.trust", {}), r"unknown field 'trust' - at '\$\.design'"),
        (changed("monitoring", None), "missing required field 'monitoring'"),
        (
            changed("design.specification.robust_gm_db", "6 dB"),
            r"Expected 'float', got 'str' - at '\$\.design\.specification\.robust_gm_db'",
        ),
        (changed("format", 99), "format = 99; this version reads format 1: run the campaign again"),
        (changed("format", None), "no 'format' key; this version reads format 1"),
    ],
)
def test_invalid_summary_names_file_and_key(content: dict[str, Any], said: str, file: Path) -> None:
    file.write_text(json.dumps(content))
    with pytest.raises(InputError, match=said) as refusal:
        summary_file.read(file)
    assert str(refusal.value).startswith(f"{file}: ")
    assert "\n" not in str(refusal.value)


def test_summary_that_is_no_json_is_refused(file: Path) -> None:
    file.write_text("not json")
    with pytest.raises(InputError, match=r"summary\.json: JSON is malformed"):
        summary_file.read(file)
