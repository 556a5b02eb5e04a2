"""What judging a model finds, as ``model.json`` keeps it. A figure that could not be had is
null."""

from typing import Literal

import msgspec

from sysid.data.segments import Plane


class JsonRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    pass


class Theil(JsonRecord, frozen=True):
    """Inequality of measured and simulated rate (Theil 1966): 0 for equal series, 1 for no likeness
    at all.

    The shares say where the mean squared error comes from, and sum to one.
    """

    coefficient: float
    bias_share: float
    """Unequal means."""
    variance_share: float
    """Unequal size of the motion."""
    covariance_share: float
    """Unequal course: what disturbance and noise leave."""


class Whiteness(JsonRecord, frozen=True):
    """Innovations of the rate: white, and of mean square one, where model and noise model hold."""

    mean_square: float
    distance: float
    """Largest distance of the cumulative periodogram from its diagonal."""
    periodogram_p: float
    """Probability of so large a distance in white noise."""
    ljung_box_p: float
    """Probability of such autocorrelations over two seconds in white noise."""


class RunValidation(JsonRecord, frozen=True):
    """One run, fitted or held out. Mean squares are of the rate, (deg/s)^2, once the test has
    begun."""

    run: str
    wave: str
    held_out: bool
    new_type: bool
    """No fitted run of the plane had this wave form."""
    floor_deg2ps2: float | None
    """What sea and sensors alone would leave by the model's noise."""
    floor_sd_deg2ps2: float | None
    """How far the mean square of one such run strays from it by chance."""
    theil: Theil
    whiteness: Whiteness | None


class Excess(JsonRecord, frozen=True):
    """All held-out runs of a plane: mean squared rate error and what of it is not sea and sensors,
    (deg/s)^2."""

    prior_mse_deg2ps2: float
    model_mse_deg2ps2: float
    floor_deg2ps2: float | None
    repeats_deg2ps2: float | None
    """The floor once more, from runs of the same test; null without such runs."""
    prior_excess_deg2ps2: float | None
    model_excess_deg2ps2: float | None
    """Mean squared error less floor; below zero by chance where the model leaves nothing but
    noise."""
    excess_sd_deg2ps2: float | None
    theil: Theil
    whiteness_p: float | None
    """Probability, in white noise, of periodograms as uneven as those of all these runs (Fisher's
    combination)."""
    new_types: int
    """How many of the runs have a wave form that no fitted run of the plane had."""


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
    """Random error of the estimate, from the coherence."""
    model_gain_db: tuple[float, ...]
    model_phase_deg: tuple[float, ...]
    mismatch_cost: float | None
    """Of gain and phase together over the coherent band (Tischler and Remple 2006): 50 is
    excellent, 100 acceptable."""


class Crossover(JsonRecord, frozen=True):
    """Where a loop crosses unit gain, and how sure the model is of gain and phase there (one
    standard deviation)."""

    loop: Literal["rudder", "elevator"]
    crossover_radps: float
    crossover_sd_radps: float | None
    gain_sd_db: float | None
    phase_sd_deg: float | None
    pm_deg: float
    pm_sd_deg: float | None


class Correction(JsonRecord, frozen=True):
    """What the held-out runs would change about the model's response at crossover, one standard
    deviation beside."""

    gain_db: float
    gain_sd_db: float
    phase_deg: float
    phase_sd_deg: float


class PlaneValidation(JsonRecord, frozen=True):
    runs: tuple[RunValidation, ...]
    held_out: Excess | None
    overlay: FrequencyComparison | None
    coherence_at_crossover: float | None
    """Smallest between half and twice the crossover."""
    crossover: Crossover | None
    """Of the gains aboard when the tests were run."""
    correction: Correction | None


class Gate(JsonRecord, frozen=True):
    """One condition of the verdict."""

    name: str
    plane: Plane | None
    """Null for what concerns the whole fit."""
    value: float | None
    """Null where the data do not tell; the gate is then not passed."""
    limit: float
    sense: Literal["at most", "at least"]
    unit: str
    passed: bool
    required: bool
    """A gate that is not required is a remark: it does not decide."""


class NextTest(JsonRecord, frozen=True):
    """The test that would do most for the worst gate."""

    plane: Plane
    signal: str
    magnitude_deg: float
    duration_s: float
    reason: str

    def __str__(self) -> str:
        surface = "rudder" if self.plane == "yaw" else "elevator"
        return (
            f"{self.signal} of {self.magnitude_deg:g} deg on the {surface} for"
            f" {self.duration_s:g} s"
        )


class ModelAssessment(JsonRecord, frozen=True):
    fit_for_redesign: bool
    reasons: tuple[str, ...]
    """One for each required gate that is not passed."""
    gates: tuple[Gate, ...]
    next_test: NextTest | None
