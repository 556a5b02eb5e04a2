"""``model.json``: an identified vehicle, what it rests on, and how sure it is.

The file is the JSON of ``IdentifiedModel``. It holds no time stamp and no path, so the same logs
give the same bytes; data are named by file name and SHA-256. A value that the data cannot give is
``null`` or carries the status ``prior``."""

import hashlib
from pathlib import Path
from typing import Literal

import msgspec

from sysid.data.segments import Plane
from sysid.validation.results import ModelAssessment, PlaneValidation

FORMAT = 2
Method = Literal["map", "paper", "output-error", "filter-error"]
Status = Literal["measured", "prior", "unidentifiable"]
MAX_POSTERIOR_TO_PRIOR_SD = 0.8
"""A coefficient whose posterior is wider than this share of its prior was not measured."""


class ModelError(ValueError):
    """A file that is no model; the message names the file, what is wrong and what would be
    right."""


class ModelRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    pass


class ParameterEstimate(ModelRecord, frozen=True):
    value: float
    sd: float | None
    """One standard deviation; null where the data leave the value free."""


class Coefficient(ModelRecord, frozen=True):
    """One physical coefficient in the paper's axes (body x forward, y port, z up), SI units, angles
    in radians."""

    value: float
    sd: float | None
    prior: float
    prior_sd: float
    shrink: float | None
    """Posterior over prior standard deviation of the estimated quantity: 1 is the prior handed
    back."""
    status: Status
    unit: str


class PlaneModel(ModelRecord, frozen=True):
    """One plane at the model's speed, in MAVLink's axes: positive angle, positive rate.

    Rate over duct angle is (b1 s + b0)/(s^2 + a1 s + a0), with poles p_fast and p_slow and static
    gain b0/a0; in pitch the restoring moment is kept out of it and stands by itself."""

    static_gain_per_s: ParameterEstimate
    b1_per_s2: ParameterEstimate
    p_fast_per_s: ParameterEstimate
    p_slow_per_s: ParameterEstimate
    restoring_per_s2: ParameterEstimate | None
    delay_s: ParameterEstimate
    """Transport delay from command to duct, what sensors and computing add included."""
    actuator_bias_deg: ParameterEstimate
    """True duct angle at a command of zero."""


class ParameterCovariance(ModelRecord, frozen=True):
    """Of several estimates together."""

    names: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]
    """Rows and columns in the order of ``names``, in the product of their units."""


class NoiseModel(ModelRecord, frozen=True):
    """Disturbance and sensor noise of one plane; standard deviations."""

    slow_accel_degps2: float
    slow_time_s: float
    wave_accel_degps2: float
    wave_frequency_hz: float
    wave_damping: float
    rate_noise_degps: float
    angle_noise_deg: float
    depth_noise_m: float
    force_noise_mps15: float


class DataFile(ModelRecord, frozen=True):
    name: str
    sha256: str
    """Of the vehicle's messages and parameters in the log (``log.Log.sha256``), not of the file."""


class AnomalyTest(ModelRecord, frozen=True):
    """The likeliest anomaly of one kind in a run, were all other runs and the model clean
    (`sysid.screening.score_test`)."""

    kind: str
    statistic: float
    """Size over its standard deviation: standard normal in a clean run, at a time given
    beforehand."""
    size: float
    sd: float
    unit: str
    at_s: float | None
    """Since the test began; null for what lasts throughout."""


class ScreenedRun(ModelRecord, frozen=True):
    run: str
    plane: Plane
    wave: str
    magnitude_deg: float
    duration_s: float
    kept: bool
    reasons: tuple[str, ...]
    warnings: tuple[str, ...] = ()
    """What was seen in a run that was kept."""
    p_value: float | None = None
    """Chance that a clean run shows any anomaly as clearly, all kinds and times together; null
    where none was sought: a run that the hard rules took out, or a method without a noise model."""
    repeat_p_value: float | None = None
    """The same of its difference from matched runs; null without any."""
    anomalies: tuple[AnomalyTest, ...] = ()
    """The likeliest first."""


class Shift(ModelRecord, frozen=True):
    """How far leaving runs out moved one of the design numbers."""

    plane: Plane
    number: str
    with_all: float
    value: float
    sds: float
    """Of the value's standard deviations."""


class RunQuality(ModelRecord, frozen=True):
    """Mean squared rate error of one run after its start, (deg/s)^2, as in the paper's Table 2."""

    run: str
    plane: Plane
    prior_mse_deg2ps2: float
    model_mse_deg2ps2: float
    opening_prior_mse_deg2ps2: float
    """The same over the first ten seconds: longer, the paper's two models differ by more than its
    Table 2 allows."""
    opening_model_mse_deg2ps2: float
    variance_accounted_for: float
    """1 - var(error)/var(rate) of the model."""


class Joint(ModelRecord, frozen=True):
    """The joint estimate in its own coordinates: prior standard deviations away from the prior
    vehicle."""

    names: tuple[str, ...]
    z: tuple[float, ...]
    covariance: tuple[tuple[float, ...], ...]
    correlation: tuple[tuple[float, ...], ...]
    rank: int
    """Numerical rank of the data's own information, without the prior."""
    informed_directions: int
    """Combinations about which the data say more than the prior did."""
    condition_number: float | None
    """Of the data's information; null where it is singular to rounding."""


class Convergence(ModelRecord, frozen=True):
    cost: float
    start_costs: tuple[float, ...]
    """Costs that the other starts ended at."""
    agreed: bool
    at_bounds: tuple[str, ...]
    failures: tuple[str, ...] = ()
    """Why the fit cannot be believed, each in a sentence; such a file was asked for by force."""


class VehicleRecord(ModelRecord, frozen=True):
    """What a simulation of the identified vehicle needs beyond its prior vehicle."""

    prior: str
    mass_kg: float
    prior_biases_deg: dict[Plane, float]
    net_buoyancy_n: ParameterEstimate
    crossflow_cd: ParameterEstimate
    natural_frequency_radps: ParameterEstimate
    damping_ratio: ParameterEstimate
    level_elevator_deg: float
    level_pitch_deg: float
    """Duct angle and pitch (nose up) of level flight."""


class AlternativeFit(ModelRecord, frozen=True):
    """The same runs fitted by another method, to be set beside the model."""

    method: Method
    planes: dict[Plane, PlaneModel]
    coefficients: dict[str, float]
    rank: int
    fit_quality: tuple[RunQuality, ...]
    held_out: tuple[RunQuality, ...]


class IdentifiedModel(ModelRecord, frozen=True):
    format: int
    method: Method
    speed_mps: float
    thrust_fraction: float
    planes: dict[Plane, PlaneModel]
    coefficients: dict[str, Coefficient]
    vehicle: VehicleRecord
    noise: dict[Plane, NoiseModel]
    joint: Joint
    convergence: Convergence
    data: tuple[DataFile, ...]
    screening: tuple[ScreenedRun, ...]
    fit_quality: tuple[RunQuality, ...]
    held_out: tuple[RunQuality, ...]
    notes: tuple[str, ...]
    held_out_data: tuple[DataFile, ...] = ()
    held_out_screening: tuple[ScreenedRun, ...] = ()
    left_out_moved: tuple[Shift, ...] = ()
    """What leaving runs out that the fit itself found anomalous did to the numbers in ``planes``;
    empty for none."""
    design: dict[Plane, ParameterCovariance] = {}
    """Of the numbers in ``planes``, each in the unit of its name; left out where the method gives
    none."""
    validation: dict[Plane, PlaneValidation] = {}
    verdict: ModelAssessment | None = None
    """Null for a model that nobody judged: one made by the library, not from logs."""
    beside: tuple[AlternativeFit, ...] = ()
    versions: dict[str, str] = {}
    """Of the packages that computed it: the same logs and versions give the same bytes."""


class _Head(msgspec.Struct):
    format: int = 0


def encode(model: IdentifiedModel) -> bytes:
    return msgspec.json.format(msgspec.json.encode(model), indent=1) + b"\n"


def sha256_of_model(model: IdentifiedModel) -> str:
    """SHA-256 of the model's file, by which gains name the model they come from."""
    return hashlib.sha256(encode(model)).hexdigest()


def write(model: IdentifiedModel, path: str | Path) -> None:
    Path(path).write_bytes(encode(model))


def read(path: str | Path) -> IdentifiedModel:
    """Read ``model.json``.

    Raises:
        ModelError: the file is missing, no model, or of another format.
    """
    try:
        text = Path(path).read_bytes()
        found = msgspec.json.decode(text, type=_Head).format
        if found != FORMAT:
            raise ModelError(
                f"{path}: format = {found}; this version reads format {FORMAT}: refit the logs"
            )
        return msgspec.json.decode(text, type=IdentifiedModel)
    except OSError as error:
        raise ModelError(
            f"{path}: {error.strerror}; give a model.json that `ground refit` wrote"
        ) from None
    except msgspec.MsgspecError as error:
        raise ModelError(f"{path}: {error}; give a model.json that `ground refit` wrote") from None
