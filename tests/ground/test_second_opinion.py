"""Table of the second opinion as text and as HTML."""

from types import SimpleNamespace
from typing import Any

import msgspec

from ground.report import second_opinion
from sysid.planes import Plane
from sysid.validation.results import Opinion, PlaneValidation, SecondOpinion

OPINION = SecondOpinion(
    frequency_radps=(0.4, 0.8, 1.6),
    gain_db=(1.0, -4.82, -9.6),
    phase_deg=(-60.0, -93.4, -137.0),
    gain_sd_db=(0.2, 0.14, 0.16),
    phase_sd_deg=(1.8, 1.2, 0.9),
    opinions=(
        Opinion("ARX", (1.1, -4.8, -9.4), (-61.0, -92.0, -136.0), (0.2,) * 3, (1.0,) * 3, None, 8),
    ),
    differences=("ARX: gain at 0.40 rad/s differs by +0.10 dB, interval <0.05>",),
)


def with_opinion(opinion: SecondOpinion | None) -> Any:
    validation = PlaneValidation((), None, None, None, None, None, opinion)
    return SimpleNamespace(validation={Plane.YAW: validation})


def test_table_has_model_with_interval_and_other_methods() -> None:
    text = second_opinion.format_text(with_opinion(OPINION))
    assert "-4.82 ± 0.14" in text
    assert "-4.80 ± 0.20" in text
    assert "yaw, ARX: gain at 0.40 rad/s differs" in text
    html = second_opinion.html(with_opinion(OPINION))
    assert "-4.82 ± 0.14" in html
    assert "&lt;0.05&gt;" in html


def test_agreement_is_said_and_missing_opinion_is_empty() -> None:
    agreed = msgspec.structs.replace(OPINION, differences=())
    assert second_opinion.CONFIRMED in second_opinion.format_text(with_opinion(agreed))
    assert second_opinion.format_text(with_opinion(None)) == ""
    assert second_opinion.html(with_opinion(None)) == ""
