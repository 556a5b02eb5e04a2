"""What `ground fly` knows of a simulated dive before it begins."""

import pytest

from ground.cli import fly
from ground.client.dive_symptoms import SymptomKind


@pytest.mark.parametrize("vehicle", ["caribou_truth", "remus100"])
def test_vehicle_that_sinks_in_the_upper_layer_is_too_heavy(vehicle: str) -> None:
    """The verdict of such a dive was "good": the vehicle sank after it had disarmed."""
    symptom = fly._check_simulation(vehicle, "estuary")
    assert symptom is not None
    assert symptom.kind is SymptomKind.HEAVY
    assert "too heavy: it does not rise without power" in symptom.message
    assert fly._check_simulation(vehicle, "calm") is None
