"""Redesigned gains are at least as good as the first ones in simulation, or these are kept."""

from types import SimpleNamespace
from typing import Any

import pytest

from sysid.design import pid
from sysid.design.pid import DesignInfeasibleError, Spec
from sysid.models import json_record
from sysid.monte_carlo import gain_selection, study
from sysid.monte_carlo.gain_selection import GainSelection, SelectionRequest
from sysid.monte_carlo.simulate import Sea
from sysid.monte_carlo.study import ResultRange, SimulationSummary
from sysid.reproduction.paper_tables import TABLE_3_INITIAL
from sysid.test_design import prior as design_priors

Ratios = tuple[float, float] | None
"""Errors in heading and depth over those of the first gains; None where no gains are feasible."""


def select(
    monkeypatch: pytest.MonkeyPatch, by_phase_margin: dict[float, Ratios], *, first_stable: bool
) -> tuple[float, Any]:
    """Return the phase margin of the chosen limits (0: the first gains), and the selection."""

    def redesign(model: object, spec: Spec, *asked: object) -> Any:
        if by_phase_margin.get(spec.pm_deg) is None:
            raise DesignInfeasibleError("no gains")
        return SimpleNamespace(spec=spec)

    def rehearse(request: object, design: Any) -> Any:
        ratios = by_phase_margin[design.spec.pm_deg]
        assert ratios is not None
        return gain_selection._Candidate(design, *ratios)

    def keep(*asked: object) -> Any:
        if not first_stable:
            raise DesignInfeasibleError("no margins")
        return SimpleNamespace(spec=Spec(pm_deg=0.0))

    monkeypatch.setattr(pid, "redesign", redesign)
    monkeypatch.setattr(pid, "keep", keep)
    monkeypatch.setattr(gain_selection, "_rehearse", rehearse)
    anything: Any = None
    request = SelectionRequest(anything, Spec(), anything, TABLE_3_INITIAL, ())
    design, selection = gain_selection.select(request)
    return design.spec.pm_deg, selection


@pytest.mark.parametrize(
    ("by_phase_margin", "first_stable", "chosen"),
    [
        ({55.0: (0.5, 0.6), 45.0: (0.1, 0.1)}, True, 55.0),
        ({55.0: (0.5, 1.6), 45.0: (0.4, 0.8)}, True, 45.0),
        ({55.0: None, 45.0: (0.4, 0.8)}, True, 45.0),
        ({55.0: (0.9, 0.99), 45.0: (1.2, 0.8)}, True, 55.0),
        ({55.0: (1.5, 1.6), 45.0: (1.3, 0.8), 38.0: (1.1, 0.7)}, True, 0.0),
        ({55.0: (1.5, 1.6), 45.0: (1.3, 0.8), 38.0: (1.1, 0.7)}, False, 55.0),
        ({}, True, 0.0),
    ],
    ids=[
        "specification suffices",
        "lower limits hold better",
        "specification infeasible",
        "slightly better with the strictest limits",
        "first gains are better",
        "first gains are better without margins",
        "nothing feasible",
    ],
)
def test_select_strictest_limits_that_are_better_than_the_first_gains(
    monkeypatch: pytest.MonkeyPatch,
    by_phase_margin: dict[float, Ratios],
    first_stable: bool,
    chosen: float,
) -> None:
    pm_deg, selection = select(monkeypatch, by_phase_margin, first_stable=first_stable)
    assert pm_deg == chosen
    assert selection.kept_first == (chosen == 0.0)
    assert (selection.reason == "") == (chosen == 55.0 and first_stable)


def test_select_nothing_feasible_and_first_gains_without_margins_is_reported(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with pytest.raises(DesignInfeasibleError, match="no gains"):
        select(monkeypatch, {}, first_stable=False)


def summary(**changes: Any) -> SimulationSummary:
    """Return the summary of eight simulated runs in which nothing fails."""
    usual = SimulationSummary(
        gains="",
        sea=Sea(),
        vehicles=8,
        heading_deg=ResultRange(1.0, 1.0),
        pitch_deg=ResultRange(1.0, 1.0),
        depth_m=ResultRange(0.1, 0.1),
        legs=(),
        rudder_deg=ResultRange(5.0, 5.0),
        elevator_deg=ResultRange(5.0, 5.0),
        at_stops_pct=ResultRange(0.0, 0.0),
        shallowest_m=None,
        broached=0,
        diverged={},
        failsafes={},
        vehicle_s=100.0,
    )
    return usual._replace(**changes)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        (
            {"diverged": {"heading": 2}},
            "fail in 2 of 8 simulated runs (heading not held: 2), the first gains in none",
        ),
        (
            {"failsafes": {"pitch": 1}, "broached": 1},
            "fail in 1 of 8 simulated runs (pitch: 1, came through the surface: 1), the first gains"
            " in none",
        ),
        ({"heading_deg": None, "depth_m": None}, "do not settle in any simulated run"),
    ],
    ids=["not held", "failsafe", "never settled"],
)
@pytest.mark.parametrize("first_stable", [True, False])
def test_select_gains_that_fail_in_simulation_says_what_happened(
    monkeypatch: pytest.MonkeyPatch, changes: dict[str, Any], reason: str, first_stable: bool
) -> None:
    def redesign(model: object, spec: Spec, *asked: object) -> Any:
        return SimpleNamespace(spec=spec, gains={})

    def keep(*asked: object) -> Any:
        if not first_stable:
            raise DesignInfeasibleError("no margins")
        return SimpleNamespace(spec=Spec(pm_deg=0.0))

    monkeypatch.setattr(pid, "redesign", redesign)
    monkeypatch.setattr(pid, "keep", keep)
    monkeypatch.setattr(design_priors, "from_model", lambda *asked: None)
    simulated = summary(), summary(**changes)
    monkeypatch.setattr(study, "simulate_samples", lambda *asked: simulated)
    anything: Any = None
    request = SelectionRequest(anything, Spec(), anything, TABLE_3_INITIAL, ())
    _, selection = gain_selection.select(request)
    assert selection.kept_first == first_stable
    assert reason in selection.reason
    assert "inf" not in selection.reason
    # A campaign that is resumed reads its summary: JSON has no infinity.
    assert json_record.decode(json_record.encode(selection), GainSelection) == selection


def test_load_is_compensated_more_slowly_only_where_no_gains_are_feasible(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """30 s is Caribou's time; a slow tailcone bounds the bandwidth of the depth loop."""
    asked: list[tuple[float, float]] = []

    def redesign(model: object, spec: Spec, *others: object) -> Any:
        asked.append((spec.integral_settling_s, spec.pm_deg))
        if spec.integral_settling_s < 60.0:
            raise DesignInfeasibleError("no gains")
        return SimpleNamespace(spec=spec)

    monkeypatch.setattr(pid, "redesign", redesign)
    monkeypatch.setattr(
        gain_selection,
        "_rehearse",
        lambda request, design: gain_selection._Candidate(design, 0.5, 0.5),
    )
    anything: Any = None
    request = SelectionRequest(anything, Spec(), anything, TABLE_3_INITIAL, ())
    design, selection = gain_selection.select(request)
    assert asked == [(30.0, 55.0), (30.0, 45.0), (30.0, 38.0), (60.0, 55.0)]
    assert design.spec.integral_settling_s == 60.0
    assert selection.reason == ("a constant load is compensated in 60 s: no gains do so in 30 s")
