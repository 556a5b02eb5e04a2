"""Evidence of the paper's garbled places, against python-control and hand-computed numbers."""

import control
import pytest

from sysid.reproduction import discrepancies, paper_poles, table_comparisons
from sysid.reproduction.discrepancies import Discrepancy, Sources


@pytest.fixture(scope="module")
def sources() -> Sources:
    return Sources(
        steps={step.symbol: step for step in table_comparisons.derivation()},
        readings=paper_poles.readings(),
        alone=paper_poles.single_pole_conditions(),
    )


@pytest.fixture(scope="module")
def places(sources: Sources) -> dict[str, Discrepancy]:
    return {entry.place: entry for entry in discrepancies.all_discrepancies(sources)}


def test_every_place_is_confirmed(places: dict[str, Discrepancy]) -> None:
    assert len(places) >= 23
    assert [place for place, entry in places.items() if not entry.confirmed] == []
    assert all(entry.values for entry in places.values())


def test_wrong_derivation_is_not_confirmed(sources: Sources) -> None:
    """The evidence can fail: a derived N_v with the Munk moment counted twice."""
    step = sources.steps["N_v"]
    wrong = sources._replace(steps={**sources.steps, "N_v": step._replace(value=-1051.0)})
    failed = [e.place for e in discrepancies.all_discrepancies(wrong) if not e.confirmed]
    assert "Hydrodynamics: C_M,pitch and C_M,yaw" in failed


def test_actuator_cutoff_and_growth_equal_python_control(places: dict[str, Discrepancy]) -> None:
    """-3 dB of both denominators by control.bandwidth."""
    values = places["Tailcone dynamics modeling: G(s)"].values
    for name, denominator in (("printed", [3, 0.4, 1]), ("read", [1 / 9, 0.4, 1])):
        bandwidth = control.bandwidth(control.tf([1], denominator), dbdrop=-3.0103)
        assert values[f"{name}_cutoff_radps"] == pytest.approx(bandwidth, rel=2e-3)


def test_delay_phase_equals_python_control(places: dict[str, Discrepancy]) -> None:
    values = places["Tailcone dynamics modeling: delay in G(s)"].values
    _, phase, _ = control.frequency_response(control.tf(*control.pade(0.3, 2)), [2.0])
    assert values["pade_deg"] == pytest.approx(-float(phase[0]) * 57.29578, abs=1e-3)
