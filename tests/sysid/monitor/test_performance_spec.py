"""The header of a gains file: round trip, changed values and damaged headers."""

import math
import tomllib

import pytest

from sysid.monitor import performance_spec
from sysid.monitor.performance_spec import (
    BaselineError,
    PerformanceBaseline,
    PredictedStatistic,
    Robustness,
)

GAINS = {"HDG_P": 0.8046312, "PTCH_I": 0.0, "DPT_I": 1.25e-5}
REASONS = {"HDG_P": "GM 9.8 dB at the rudder", "PTCH_I": "no integrator", "DPT_I": "done in 30 s"}
BASELINE = PerformanceBaseline(
    model_sha256="ab" * 32,
    version="0.1.0",
    speed_mps=1.3,
    thrust=0.58,
    heading_resonance_radps=2.25,
    pitch_resonance_radps=1.75,
    specification={"damping": 0.6, "pitch_rms_ratio": math.inf},
    predicted={"heading_deg": PredictedStatistic(0.0, 0.0, 0.375, 0.75, 0.125, 3.5)},
    robustness=Robustness(0.875, 1.0, 240, 2001),
)


def values(text: str) -> dict[str, float]:
    """Return the parameters of a gains file."""
    lines = [line.partition("#")[0] for line in text.splitlines()]
    return {
        name: float(value) for name, value in (line.split(",") for line in lines if line.strip())
    }


@pytest.fixture
def text() -> str:
    return performance_spec.encode(BASELINE, GAINS, REASONS)


def test_decode_encoded_baseline_is_equal(text: str) -> None:
    assert performance_spec.decode(text, values(text)) == BASELINE
    assert "HDG_P,0.804631  # GM 9.8 dB at the rudder" in text


def test_encode_without_covariance_omits_robustness() -> None:
    bare = BASELINE.__class__(
        **{**{n: getattr(BASELINE, n) for n in BASELINE.__struct_fields__}, "robustness": None}
    )
    text = performance_spec.encode(bare, GAINS, REASONS)
    assert performance_spec.decode(text, values(text)) == bare


def test_encode_header_is_toml_in_comments(text: str) -> None:
    head = [line.removeprefix("#") for line in text.splitlines()[1:] if line.startswith("#")]
    assert tomllib.loads("\n".join(head))["predicted"]["heading_deg"]["rms"] == 0.375


def test_decode_changed_value_raises(text: str) -> None:
    with pytest.raises(BaselineError, match="values were changed"):
        performance_spec.decode(text, {**values(text), "HDG_P": 0.9})


def test_decode_added_value_raises(text: str) -> None:
    with pytest.raises(BaselineError, match="values were changed"):
        performance_spec.decode(text, {**values(text), "HDG_D": 1.0})


@pytest.mark.parametrize("head", ["thrust = 0.58", "speed_mps = 1.3"])
def test_decode_missing_field_is_named(text: str, head: str) -> None:
    with pytest.raises(BaselineError, match=head.split()[0]):
        performance_spec.decode(text.replace(f"# {head}\n", ""), values(text))


def test_decode_other_format_is_named(text: str) -> None:
    old = text.replace("# caribou gains 2", "# caribou gains 1", 1)
    with pytest.raises(BaselineError, match="has format 1; this version reads format 2"):
        performance_spec.decode(old, values(old))


@pytest.mark.parametrize("other", ["", "HDG_P,0.5\n", "# gains of my own\nHDG_P,0.5  # why\n"])
def test_decode_file_without_header_is_none(other: str) -> None:
    assert performance_spec.decode(other, values(other)) is None
