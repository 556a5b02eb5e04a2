"""Results of the validation as ``model.json`` stores them; an unknown value is null."""

from typing import Literal

import msgspec

from sysid.models.json_record import JsonRecord
from sysid.planes import PLANES, Plane


class Theil(JsonRecord, frozen=True):
    """Theil's inequality of measured and simulated rate (Theil 1966): 0 if equal, 1 at worst.

    The shares are parts of the mean squared error and sum to one.
    """

    coefficient: float
    bias_share: float
    """Share of unequal means."""
    variance_share: float
    """Share of unequal standard deviations."""
    covariance_share: float
    """Share of unequal time courses: disturbance and noise."""


class Whiteness(JsonRecord, frozen=True):
    """Innovations of the rate: white with unit mean square if model and noise model are right."""

    mean_square: float
    distance: float
    """Largest distance of the cumulative periodogram from the diagonal."""
    periodogram_p: float
    """Probability of such a distance in white noise."""
    ljung_box_p: float
    """Probability of such autocorrelations over two seconds in white noise."""


class RunValidation(JsonRecord, frozen=True):
    """Validation of one run, fitted or held out.

    Mean squares are of the rate during the test, (deg/s)^2.
    """

    run: str
    wave: str
    held_out: bool
    new_type: bool
    """True if no fitted run of the plane had this wave form."""
    floor_deg2ps2: float | None
    """Expected mean squared error from disturbance and sensors alone, by the model's noise."""
    floor_sd_deg2ps2: float | None
    """Standard deviation of this mean squared error for one run."""
    theil: Theil
    whiteness: Whiteness | None


class Excess(JsonRecord, frozen=True):
    """Errors of all held-out runs of a plane.

    Mean squared rate error and its excess over noise, (deg/s)^2.
    """

    prior_mse_deg2ps2: float
    model_mse_deg2ps2: float
    floor_deg2ps2: float | None
    repeats_deg2ps2: float | None
    """Noise floor from runs of the same test; null without such runs."""
    prior_excess_deg2ps2: float | None
    model_excess_deg2ps2: float | None
    """Mean squared error minus floor; it may be below zero by chance if the model is right."""
    excess_sd_deg2ps2: float | None
    theil: Theil
    whiteness_p: float | None
    """Probability of such periodograms in white noise, all runs combined (Fisher's method)."""
    new_types: int
    """Number of runs whose wave form no fitted run of the plane had."""


class FrequencyComparison(JsonRecord, frozen=True):
    """Rate over command as the runs show it, and as the model has it for small motion.

    One entry for each frequency; phase is continuous, delay included.
    """

    runs: tuple[str, ...]
    frequency_radps: tuple[float, ...]
    coherence: tuple[float, ...]
    gain_db: tuple[float, ...]
    phase_deg: tuple[float, ...]
    gain_sd_db: tuple[float, ...]
    phase_sd_deg: tuple[float, ...]
    """Random error of the measured response, from the coherence."""
    model_gain_db: tuple[float, ...]
    model_phase_deg: tuple[float, ...]
    mismatch_cost: float | None
    """Mismatch cost over the coherent band (Tischler and Remple 2006).

    50 is excellent, 100 acceptable.
    """


class Crossover(JsonRecord, frozen=True):
    """Crossover of a loop, and standard deviations of the model's gain and phase there."""

    loop: Literal["rudder", "elevator"]
    crossover_radps: float
    crossover_sd_radps: float | None
    gain_sd_db: float | None
    phase_sd_deg: float | None
    pm_deg: float
    pm_sd_deg: float | None


class StructureError(JsonRecord, frozen=True):
    """Standard deviations of a plane by the error of the model structure alone.

    They are the part that further tests of the same kind leave.
    """

    b1_percent: float
    """Standard deviation of b1, in percent of its value."""
    gain_db: float | None
    """Standard deviations of gain (dB) and phase (deg) at crossover; null without a crossover."""
    phase_deg: float | None


class Correction(JsonRecord, frozen=True):
    """Change of the model's response at crossover by the held-out runs, with standard deviation."""

    gain_db: float
    gain_sd_db: float
    phase_deg: float
    phase_sd_deg: float


class Opinion(JsonRecord, frozen=True):
    """Rate over command by another method, at the frequencies of the `SecondOpinion`."""

    method: Literal["frequency response", "ARX", "python-control"]
    gain_db: tuple[float, ...]
    phase_deg: tuple[float, ...]
    gain_sd_db: tuple[float, ...] | None
    """Null for python-control, which evaluates the model's own linear plane."""
    phase_sd_deg: tuple[float, ...] | None
    coherence: tuple[float, ...] | None
    """Coherence of command and rate; of the frequency response alone."""
    order: int | None
    """Order of the ARX model."""


class SecondOpinion(JsonRecord, frozen=True):
    """Rate over command by the model, at half, once and twice the crossover, beside others."""

    frequency_radps: tuple[float, ...]
    gain_db: tuple[float, ...]
    phase_deg: tuple[float, ...]
    gain_sd_db: tuple[float, ...] | None
    phase_sd_deg: tuple[float, ...] | None
    """Standard deviations of the model; null if they are unknown."""
    opinions: tuple[Opinion, ...]
    differences: tuple[str, ...]
    """Opinions that differ from the model by more than their common interval, in words."""


class PlaneValidation(JsonRecord, frozen=True):
    """Validation of one plane."""

    runs: tuple[RunValidation, ...]
    held_out: Excess | None
    frequency_response: FrequencyComparison | None
    coherence_at_crossover: float | None
    """Smallest coherence between half and twice the crossover."""
    crossover: Crossover | None
    """Crossover with the gains that were set during the tests."""
    correction: Correction | None
    second_opinion: SecondOpinion | None = None
    """Null without a crossover."""
    model_error: StructureError | None = None
    """Null if the tests do not disagree beyond noise."""


class AcceptanceCheck(JsonRecord, frozen=True):
    """One acceptance criterion."""

    name: str
    plane: Plane | None
    """Null for a criterion of the whole fit."""
    value: float | None
    """Null if unknown; the criterion then fails."""
    limit: float
    sense: Literal["at most", "at least"]
    unit: str
    passed: bool
    required: bool
    """True if the decision depends on it; otherwise it is a remark."""


class NextTest(JsonRecord, frozen=True):
    """Test that improves the worst criterion most."""

    plane: Plane
    signal: str
    magnitude_deg: float
    duration_s: float
    reason: str

    def __str__(self) -> str:
        """Return the test as text."""
        return (
            f"{self.signal} of {self.magnitude_deg:g} deg on the {PLANES[self.plane].surface} for"
            f" {self.duration_s:g} s"
        )


class PlaneVerdict(JsonRecord, frozen=True):
    """Decision about one plane, from its own criteria and those of the whole fit."""

    tested: bool
    """False if no test of the plane was fitted; its numbers are then the prior's."""
    fit_for_redesign: bool
    reasons: tuple[str, ...]
    """One reason for each required criterion that is not met."""


class ModelAssessment(JsonRecord, frozen=True):
    """Decision whether the model may be used for redesign."""

    fit_for_redesign: bool
    reasons: tuple[str, ...]
    """One reason for each required criterion that is not met."""
    checks: tuple[AcceptanceCheck, ...]
    next_test: NextTest | None
    """Null if no test can make the model fit."""
    planes: dict[Plane, PlaneVerdict] = msgspec.field(default_factory=dict)
    """Decision by plane. Data of one plane alone pass or fail here."""
    obstacle: str = ""
    """Why no test can make the model fit, and what can; empty otherwise."""
