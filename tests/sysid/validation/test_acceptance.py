"""A model that was made well passes every gate; spoil one thing and its gate says so, by name."""

from collections.abc import Callable
from typing import Any

import msgspec
import pytest

from sitl.vehicle import config
from sysid.data.segments import Plane, Run
from sysid.models.model_file import IdentifiedModel, ParameterCovariance, ParameterEstimate
from sysid.validation.acceptance import assess, format_gate
from sysid.validation.assess import with_assessment
from sysid.validation.results import Correction, FrequencyComparison, Gate, PlaneValidation
from tests.sysid import sea
from tests.sysid.estimation.map.test_fit import TRIM

replace = msgspec.structs.replace
Spoilt = Callable[[IdentifiedModel], IdentifiedModel]


@pytest.fixture(scope="module")
def held_out(field: config.VehicleConfig) -> list[Run]:
    tests: list[tuple[Plane, Any]] = [
        ("yaw", sea.doublet(5.0, 4.0)),
        ("yaw", sea.doublet(-4.0, 2.5)),
        ("yaw", sea.doublet(6.0, 3.0)),
        ("pitch", sea.doublet(4.0, 2.5)),
        ("pitch", sea.doublet(-3.0, 2.5)),
        ("pitch", sea.doublet(5.0, 3.0)),
    ]
    return [
        sea.fly(field, plane, signal, name=f"held/{k}", wave="doublet", seed=700 + k, trim_rad=TRIM)
        for k, (plane, signal) in enumerate(tests)
    ]


@pytest.fixture(scope="module")
def sound(model: IdentifiedModel, campaign: list[Run], held_out: list[Run]) -> IdentifiedModel:
    return with_assessment(model, campaign, held_out)


def test_a_sound_model_is_fit(sound: IdentifiedModel) -> None:
    assert sound.verdict is not None
    assert sound.verdict.fit_for_redesign, sound.verdict.reasons
    assert sound.verdict.reasons == ()
    assert sound.verdict.next_test is not None
    for plane in ("yaw", "pitch"):
        found = sound.validation[plane].held_out
        assert found is not None
        assert found.new_types == 3
        assert found.floor_deg2ps2 is not None
        assert found.model_mse_deg2ps2 < found.floor_deg2ps2 + 3.0 * (
            found.excess_sd_deg2ps2 or 0.0
        )


def of_yaw(**changed: Any) -> Spoilt:
    """The same model with another validation of its yaw plane."""
    return lambda m: replace(
        m, validation={**m.validation, "yaw": replace(m.validation["yaw"], **changed)}
    )


def within_yaw(part: str, **changed: Any) -> Spoilt:
    return lambda m: of_yaw(**{part: replace(getattr(m.validation["yaw"], part), **changed)})(m)


def planes(**changed: Any) -> Spoilt:
    return lambda m: replace(m, planes={**m.planes, "yaw": replace(m.planes["yaw"], **changed)})


def uncorrelated(m: IdentifiedModel) -> IdentifiedModel:
    """A covariance that is as wide in every direction as b1 is certain: 30 % when all else is
    held."""
    names = m.design["yaw"].names
    rows = tuple(
        tuple((0.3 * abs(getattr(m.planes["yaw"], n).value)) ** 2 * (n == o) for o in names)
        for n in names
    )
    return replace(m, design={**m.design, "yaw": ParameterCovariance(names, rows)})


def without_runs(kind: bool) -> Spoilt:
    def spoil(m: IdentifiedModel) -> IdentifiedModel:
        yaw = m.validation["yaw"]
        kept = tuple(run for run in yaw.runs if run.held_out != kind)
        return of_yaw(runs=kept, held_out=None if kind else yaw.held_out)(m)

    return spoil


SPOILT: dict[str, Spoilt] = {
    "costs of other starts": lambda m: replace(
        m, convergence=replace(m.convergence, start_costs=(m.convergence.cost * 1.02,))
    ),
    "values at a bound": lambda m: replace(
        m, convergence=replace(m.convergence, at_bounds=("Y_v",))
    ),
    "failures of the fit": lambda m: replace(
        m,
        convergence=replace(m.convergence, failures=("failures of the fit are told as they are",)),
    ),
    "runs fitted": without_runs(kind=False),
    "runs held out": without_runs(kind=True),
    "b1, 1 sd": planes(b1_per_s2=ParameterEstimate(0.5, 0.11)),
    "b1, insensitivity": uncorrelated,
    "gain at crossover, 1 sd": within_yaw("crossover", gain_sd_db=1.2),
    "phase at crossover, 1 sd": within_yaw("crossover", phase_sd_deg=6.0),
    "coherence about crossover": of_yaw(coherence_at_crossover=0.4),
    "mismatch of the response": of_yaw(
        overlay=FrequencyComparison(
            (), (1.0,), (1.0,), (0.0,), (0.0,), (0.1,), (0.1,), (0.0,), (0.0,), 140.0
        )
    ),
    "held-out error over the prior's": lambda m: within_yaw(
        "held_out",
        model_mse_deg2ps2=m.validation["yaw"].held_out.prior_mse_deg2ps2 * 3.0,  # type: ignore[union-attr]
    )(m),
    "Theil's coefficient": lambda m: within_yaw(
        "held_out",
        theil=replace(m.validation["yaw"].held_out.theil, coefficient=0.3),  # type: ignore[union-attr]
    )(m),
    "gain at crossover by held-out runs, off by": of_yaw(
        correction=Correction(-1.1, 0.2, 0.0, 0.5)
    ),
    "gain at crossover by held-out runs, 1 sd": of_yaw(correction=Correction(0.0, 0.6, 0.0, 0.5)),
    "phase at crossover by held-out runs, off by": of_yaw(
        correction=Correction(0.0, 0.2, 5.5, 0.5)
    ),
    "phase at crossover by held-out runs, 1 sd": of_yaw(correction=Correction(0.0, 0.2, 0.0, 2.6)),
}


@pytest.mark.parametrize("name", SPOILT)
def test_each_gate_can_fail(name: str, sound: IdentifiedModel) -> None:
    assert sound.verdict is not None
    already = {gate.name for gate in sound.verdict.gates if not gate.passed}
    worse = SPOILT[name](sound)
    found = assess(worse, worse.validation)
    assert not found.fit_for_redesign
    failed = [gate for gate in found.gates if not gate.passed and gate.name not in already]
    assert [gate.name for gate in failed if gate.required and gate.name.startswith(name)], failed
    assert any(name in reason for reason in found.reasons)


def test_no_gate_is_left_untried(sound: IdentifiedModel) -> None:
    assert sound.verdict is not None
    required = {gate.name for gate in sound.verdict.gates if gate.required}
    assert {
        name for name in required if not any(name.startswith(tried) for tried in SPOILT)
    } == set()


def test_what_is_not_known_does_not_pass(sound: IdentifiedModel) -> None:
    worse = planes(b1_per_s2=ParameterEstimate(0.5, None))(sound)
    found = assess(worse, worse.validation)
    assert not found.fit_for_redesign
    assert found.reasons == ("yaw: b1, 1 sd not known, at most 20 %",)


def test_the_next_test_serves_the_worst_gate(sound: IdentifiedModel) -> None:
    silent = of_yaw(coherence_at_crossover=None)(sound)
    asked = assess(silent, silent.validation).next_test
    assert asked is not None
    assert (asked.plane, asked.signal) == ("yaw", "chirp")
    unproven = without_runs(kind=True)(sound)
    asked = assess(unproven, unproven.validation).next_test
    assert asked is not None
    assert asked.signal == "3211"
    assert "runs held out" in asked.reason


def test_the_papers_way_cannot_vouch_for_itself(
    campaign: list[Run], held_out: list[Run], bench: config.VehicleConfig
) -> None:
    from sysid import refit

    found = with_assessment(
        refit.identify(campaign, bench, method="paper"), campaign, held_out, prior=bench
    )
    assert found.verdict is not None
    assert not found.verdict.fit_for_redesign
    assert any("not known" in reason for reason in found.verdict.reasons)
    assert found.validation["yaw"].overlay is not None


def test_gates_read_as_lines() -> None:
    gate = Gate("b1, 1 sd", "yaw", 25.0, 20.0, "at most", "%", passed=False, required=True)
    assert format_gate(gate) == "yaw: b1, 1 sd 25 %, at most 20 %"
    assert (
        format_gate(replace(gate, value=None, plane=None, unit=""))
        == "b1, 1 sd not known, at most 20"
    )


def test_a_validation_survives_its_file(sound: IdentifiedModel) -> None:
    raw = msgspec.json.encode(sound.validation)
    assert msgspec.json.decode(raw, type=dict[str, PlaneValidation]) == sound.validation
