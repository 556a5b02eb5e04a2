"""``model.json``: an identified vehicle, its data, and its standard deviations.

The file is the JSON of ``IdentifiedModel``. It has no time stamp and no path, so the same logs give
the same bytes; data are identified by file name and SHA-256. A value that cannot be estimated from
the data is ``null`` or has the status ``prior``.

``python -m sysid.models.model_file > docs/model.schema.json`` writes its JSON Schema.
"""

import hashlib
import sys
from pathlib import Path
from typing import Literal

import msgspec

from mavlink_io.errors import ErrorCode, InputError
from mavlink_io.text_files import MAX_TEXT_BYTES, read_limited
from mavlink_io.user_data_dir import write_output
from sitl.vehicle import config as vehicle_files
from sitl.vehicle.config import VehicleConfig
from sysid.models.json_record import JsonRecord, decode, encode, format_of, schema_of
from sysid.planes import Plane
from sysid.validation.results import ModelAssessment, PlaneValidation

FORMAT = 5
Method = Literal["map", "paper", "output-error", "filter-error"]
Status = Literal["measured", "prior", "unidentifiable"]
MAX_POSTERIOR_TO_PRIOR_SD = 0.8
"""Posterior over prior standard deviation above which a coefficient counts as not measured."""


class ModelError(InputError):
    """Invalid model file; the message names the file, the error and what is expected."""

    code = ErrorCode.MODEL_FILE


class ParameterEstimate(JsonRecord, frozen=True):
    """Estimated value with its standard deviation."""

    value: float
    sd: float | None
    """Standard deviation; null where the data do not determine the value."""


class Coefficient(JsonRecord, frozen=True):
    """Physical coefficient in the paper's axes (x forward, y port, z up), SI units and radians."""

    value: float
    sd: float | None
    """Standard deviation; null where the data do not determine the value."""
    prior: float
    """Prior value."""
    prior_sd: float
    posterior_to_prior_sd: float | None
    """Posterior over prior standard deviation; 1 means that the data give no information."""
    status: Status
    unit: str


class PlaneModel(JsonRecord, frozen=True):
    """One plane at the model's speed, in MAVLink's axes: a positive angle gives a positive rate.

    Rate over duct angle is (b1 s + b0)/(s^2 + a1 s + a0), with poles p_fast and p_slow and static
    gain b0/a0; in pitch the restoring moment is a separate number.
    """

    static_gain_per_s: ParameterEstimate
    b1_per_s2: ParameterEstimate
    p_fast_per_s: ParameterEstimate
    p_slow_per_s: ParameterEstimate
    restoring_per_s2: ParameterEstimate | None
    """Angular acceleration per radian of pitch; null in yaw."""
    delay_s: ParameterEstimate
    """Transport delay from command to duct, including sensors and computing."""
    actuator_bias_deg: ParameterEstimate
    """True duct angle at a command of zero."""


class ParameterCovariance(JsonRecord, frozen=True):
    """Covariance of several estimates."""

    names: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]
    """Rows and columns in the order of ``names``, in the product of their units."""


class NoiseModel(JsonRecord, frozen=True):
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
    wave_depth_m: float = 0.0
    """Measured depth by the pressure of waves; 0 where the tests do not show it."""
    test_depth_m: float = 0.0
    """Depth of the tests at which the waves were measured; 0 without pressure of waves."""


class DataFile(JsonRecord, frozen=True):
    """Log that was used for the estimate."""

    name: str
    sha256: str
    """SHA-256 of the log's messages and parameters (``dataset.Log.sha256``), not of the file."""


class AnomalyTest(JsonRecord, frozen=True):
    """Most likely anomaly of one kind in a run, assuming no anomaly in the model and other runs.

    See `sysid.screening.score_test`.
    """

    kind: str
    statistic: float
    """Size over its standard deviation.

    It is standard normal in a run without anomaly for a time chosen in advance."""
    size: float
    """Estimated size of the anomaly, in ``unit``."""
    sd: float
    """Standard deviation of ``size``."""
    unit: str
    at_s: float | None
    """Time since the start of the test; null for an anomaly during the whole run."""


class ScreenedRun(JsonRecord, frozen=True):
    """Result of the screening of one run."""

    run: str
    plane: Plane
    wave: str
    magnitude_deg: float
    duration_s: float
    accepted: bool
    """True if the run is used for the estimate."""
    reasons: tuple[str, ...]
    """Reasons for the rejection of the run."""
    warnings: tuple[str, ...] = ()
    """Anomalies in a run that is used."""
    p_value: float | None = None
    """Probability of an anomaly at least as significant in a run without anomalies.

    It is over all kinds and times. Null for a run rejected by the hard rules, and for a method
    without a noise model."""
    repeat_p_value: float | None = None
    """Probability of a difference from repeated runs as significant; null without any."""
    anomalies: tuple[AnomalyTest, ...] = ()
    """Anomalies, the most likely first."""


class Shift(JsonRecord, frozen=True):
    """Change of a design number by the rejection of runs."""

    plane: Plane
    number: str
    """Name of the design number."""
    with_all: float
    """Value with all runs."""
    value: float
    """Value without the rejected runs."""
    sds: float
    """Change in standard deviations of ``value``."""


class RunQuality(JsonRecord, frozen=True):
    """Mean squared rate errors of one run after its start, (deg/s)^2, as in the paper's Table 2."""

    run: str
    plane: Plane
    prior_mse_deg2ps2: float
    """Error of the prior vehicle."""
    model_mse_deg2ps2: float
    """Error of the identified model."""
    opening_prior_mse_deg2ps2: float
    """Error of the prior vehicle in the first ten seconds.

    Over a longer time the paper's two models differ by more than its Table 2 allows."""
    opening_model_mse_deg2ps2: float
    """Error of the identified model in the first ten seconds."""
    variance_accounted_for: float
    """1 - var(error)/var(rate) of the model."""


class Joint(JsonRecord, frozen=True):
    """Joint estimate of both planes in terms of z, the prior standard deviations from the prior."""

    names: tuple[str, ...]
    """Names of the parameters, in the order of ``z``."""
    z: tuple[float, ...]
    covariance: tuple[tuple[float, ...], ...]
    """Posterior covariance of z."""
    correlation: tuple[tuple[float, ...], ...]
    """Posterior correlation of z."""
    rank: int
    """Numerical rank of the data's information matrix, without the prior."""
    informed_directions: int
    """Number of directions in which the data give more information than the prior."""
    condition_number: float | None
    """Condition number of the data's information matrix; null where it is singular."""
    run_scatter: float = 0.0
    """Scatter of the parameters between tests beyond noise, in prior standard deviations: the error
    of the model structure."""
    deviating_run: str = ""
    """Test without which the scatter is smallest; empty without scatter."""
    run_scatter_without: float = 0.0
    """Scatter without that test."""
    prior_conflict: float = 0.0
    """How far the estimate contradicts the prior, from 0 to 1: the error of the model structure
    that is common to all tests."""


class Convergence(JsonRecord, frozen=True):
    """Convergence of the estimate."""

    cost: float
    """Lowest cost, the negative log posterior."""
    start_costs: tuple[float, ...]
    """Final costs of the other starts."""
    agreed: bool
    """True if all starts reached the same cost."""
    at_bounds: tuple[str, ...]
    """Names of the parameters at a bound."""
    failures: tuple[str, ...] = ()
    """Reasons why the fit is unreliable, one sentence each.

    Such a file is written only on request (``--force``)."""


class VehicleRecord(JsonRecord, frozen=True):
    """Data for the simulation of the identified vehicle, in addition to the prior vehicle."""

    prior: str
    """Name or path of the prior vehicle file."""
    mass_kg: float
    prior_biases_deg: dict[Plane, float]
    """Prior mean of the actuator bias."""
    net_buoyancy_n: ParameterEstimate
    crossflow_cd: ParameterEstimate
    natural_frequency_radps: ParameterEstimate
    damping_ratio: ParameterEstimate
    level_elevator_deg: float
    """Elevator angle of level motion."""
    level_pitch_deg: float
    """Pitch of level motion, positive nose up."""
    file: VehicleConfig | None = None
    """Content of the prior vehicle file; null in models of earlier versions."""


class AlternativeFit(JsonRecord, frozen=True):
    """Fit of the same runs by another method, for comparison."""

    method: Method
    planes: dict[Plane, PlaneModel]
    coefficients: dict[str, float]
    rank: int
    fit_quality: tuple[RunQuality, ...]
    held_out: tuple[RunQuality, ...]


class IdentifiedModel(JsonRecord, frozen=True):
    """Content of ``model.json``."""

    format: int
    method: Method
    speed_mps: float
    """Speed at which the coefficients are valid."""
    thrust_fraction: float
    """Thrust command at that speed, 0 to 1."""
    planes: dict[Plane, PlaneModel]
    coefficients: dict[str, Coefficient]
    """Table 1's coefficients by symbol."""
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
    dropped_run_influence: tuple[Shift, ...] = ()
    """Changes of numbers in ``planes`` by the rejection of anomalous runs; empty without any."""
    design: dict[Plane, ParameterCovariance] = msgspec.field(default_factory=dict)
    """Covariance of the numbers in ``planes``, each in its unit; empty if the method gives none."""
    validation: dict[Plane, PlaneValidation] = msgspec.field(default_factory=dict)
    assessment: ModelAssessment | None = None
    """Null for a model without assessment: one made by the library, not from logs."""
    alternative_methods: tuple[AlternativeFit, ...] = ()
    """Fits by other methods, for comparison."""
    versions: dict[str, str] = msgspec.field(default_factory=dict)
    """Versions of the packages; the same logs and versions give the same bytes."""


def sha256_of_model(model: IdentifiedModel) -> str:
    """Return the SHA-256 that gains files use to identify a model.

    Parameters
    ----------
    model : IdentifiedModel
        The model.

    Returns
    -------
    str
        SHA-256 of the bytes of its file, hexadecimal.
    """
    return hashlib.sha256(encode(model)).hexdigest()


def write(model: IdentifiedModel, path: str | Path) -> None:
    """Write ``model.json`` in one atomic step; an existing file is overwritten.

    Parameters
    ----------
    model : IdentifiedModel
        The model.
    path : str or Path
        Path of the file.

    Raises
    ------
    OSError
        The file cannot be written.
    """
    write_output(path, encode(model))


def read(path: str | Path) -> IdentifiedModel:
    """Read ``model.json``.

    Parameters
    ----------
    path : str or Path
        Path of the file.

    Returns
    -------
    IdentifiedModel
        Content of the file.

    Raises
    ------
    ModelError
        The file is missing, is not a model, or has another format.
    VehicleFileError
        The vehicle file in it is impossible.
    """
    try:
        text = read_limited(Path(path), MAX_TEXT_BYTES)
        file_format = format_of(text)
        if file_format == 0:
            raise ModelError(
                f"{path}: not a model file (no 'format' key); pass the model.json written by"
                " `ground refit`"
            )
        if file_format != FORMAT:
            raise ModelError(
                f"{path}: format = {file_format}; this version reads format {FORMAT}: refit the"
                " logs"
            )
        model = decode(text, IdentifiedModel)
        if model.vehicle.file is not None:
            vehicle_files.check(model.vehicle.file, f"{path}: vehicle.file")
        return model
    except OSError as error:
        raise ModelError(
            f"{path}: {error.strerror}; give a model.json that `ground refit` wrote"
        ) from None
    except msgspec.MsgspecError as error:
        raise ModelError(f"{path}: {error}; give a model.json that `ground refit` wrote") from None


def schema() -> bytes:
    """Return the JSON Schema of the format that this version reads and writes."""
    return schema_of(IdentifiedModel, f"model.json, format {FORMAT}: an identified vehicle")


if __name__ == "__main__":
    sys.stdout.buffer.write(schema())
