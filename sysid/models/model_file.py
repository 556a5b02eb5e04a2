"""``model.json``: an identified vehicle, its data, and its standard deviations.

The file is the JSON of ``IdentifiedModel``. It has no time stamp and no path, so the same logs give
the same bytes; data are identified by file name and SHA-256. A value that cannot be estimated from
the data is ``null`` or has the status ``prior``.

``python -m sysid.models.model_file > docs/model.schema.json`` writes its JSON Schema.
"""

import hashlib
import math
import sys
from pathlib import Path
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from mavlink_io.errors import ErrorCode, InputError
from mavlink_io.text_files import MAX_TEXT_BYTES, read_limited
from mavlink_io.user_data_dir import write_output
from sitl import vehicle_check
from sitl.vehicle import config as vehicle_files
from sitl.vehicle.config import VehicleConfig
from sysid.models import model_check
from sysid.models.json_record import (
    Fraction,
    JsonRecord,
    NonNegative,
    decode,
    encode,
    explain,
    schema_of,
)
from sysid.planes import Plane
from sysid.reproduction.paper_tables import Table1Column
from sysid.validation.results import ModelAssessment, PlaneValidation

FORMAT = 5
Method = Literal["map", "paper", "output-error", "filter-error"]
Status = Literal["measured", "prior", "unidentifiable"]
MAX_POSTERIOR_TO_PRIOR_SD = 0.8
"""Posterior over prior standard deviation above which a coefficient counts as not measured."""


Angle = Annotated[float, Meta(ge=-90.0, le=90.0)]
"""Bias of an actuator, or angle of level motion, deg."""
Level = Annotated[float, Meta(ge=0.0, le=1e4)]
"""Standard deviation of a disturbance."""
SensorNoise = Annotated[float, Meta(ge=1e-9, le=1e4)]
"""Standard deviation of a measurement, which is never exact."""
Deviation = Annotated[float, Meta(ge=-50.0, le=50.0)]
"""Distance from the prior in its standard deviations.

The method ``map`` ends at 4; linear methods give the nearest vehicle in 20 steps of at most 1."""
MAX_DEVIATION = 10.0
"""Largest element of z of the method ``map``."""
Covariance = Annotated[float, Meta(ge=-100.0, le=100.0)]
"""Element of the covariance of z, whose prior variances are 1."""
Correlation = Annotated[float, Meta(ge=-1.000001, le=1.000001)]


class ModelError(InputError):
    """Invalid model file; the message names the file, the error and what is expected."""

    code = ErrorCode.MODEL_FILE


class ParameterEstimate(JsonRecord, frozen=True):
    """Estimated value with its standard deviation."""

    value: float
    sd: NonNegative | None
    """Standard deviation; null where the data do not determine the value."""


class Coefficient(JsonRecord, frozen=True):
    """Physical coefficient in the paper's axes (x forward, y port, z up), SI units and radians."""

    value: float
    sd: NonNegative | None
    """Standard deviation; null where the data do not determine the value."""
    prior: float
    """Prior value."""
    prior_sd: NonNegative
    posterior_to_prior_sd: NonNegative | None
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

    slow_accel_degps2: Level
    slow_time_s: Annotated[float, Meta(ge=0.01, le=1e5)]
    wave_accel_degps2: Level
    wave_frequency_hz: Annotated[float, Meta(ge=1e-3, le=100.0)]
    wave_damping: Annotated[float, Meta(ge=1e-3, le=10.0)]
    rate_noise_degps: SensorNoise
    angle_noise_deg: SensorNoise
    depth_noise_m: SensorNoise
    force_noise_mps15: Level
    wave_depth_m: Annotated[float, Meta(ge=0.0, le=100.0)] = 0.0
    """Measured depth by the pressure of waves; 0 where the tests do not show it."""
    test_depth_m: Annotated[float, Meta(ge=-100.0, le=12000.0)] = 0.0
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
    duration_s: NonNegative
    accepted: bool
    """True if the run is used for the estimate."""
    reasons: tuple[str, ...]
    """Reasons for the rejection of the run."""
    warnings: tuple[str, ...] = ()
    """Anomalies in a run that is used."""
    p_value: Fraction | None = None
    """Probability of an anomaly at least as significant in a run without anomalies.

    It is over all kinds and times. Null for a run rejected by the hard rules, and for a method
    without a noise model."""
    repeat_p_value: Fraction | None = None
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
    z: tuple[Deviation, ...]
    covariance: tuple[tuple[Covariance, ...], ...]
    """Posterior covariance of z."""
    correlation: tuple[tuple[Correlation, ...], ...]
    """Posterior correlation of z."""
    rank: int
    """Numerical rank of the data's information matrix, without the prior."""
    informed_directions: int
    """Number of directions in which the data give more information than the prior."""
    condition_number: float | None
    """Condition number of the data's information matrix; null where it is singular."""
    run_scatter: Annotated[float, Meta(ge=0.0, le=10.0)] = 0.0
    """Scatter of the parameters between tests beyond noise, in prior standard deviations: the error
    of the model structure."""
    deviating_run: str = ""
    """Test without which the scatter is smallest; empty without scatter."""
    run_scatter_without: NonNegative = 0.0
    """Scatter without that test."""
    prior_conflict: Fraction = 0.0
    """How far the estimate contradicts the prior, from 0 to 1: the error of the model structure
    that is common to all tests."""


class Convergence(JsonRecord, frozen=True):
    """Convergence of the estimate."""

    cost: float
    """Lowest cost, the negative log posterior."""
    start_costs: tuple[float, ...]
    """Final costs of the other starts."""
    agreed: bool
    """True if at least half of the other starts reached the same cost."""
    at_bounds: tuple[str, ...]
    """Names of the parameters at a bound."""
    failures: tuple[str, ...] = ()
    """Reasons why the fit is unreliable, one sentence each.

    Such a file is written only on request (``--force``)."""


class VehicleRecord(JsonRecord, frozen=True):
    """Data for the simulation of the identified vehicle, in addition to the prior vehicle."""

    prior: str
    """Name or path of the prior vehicle file."""
    mass_kg: Annotated[float, Meta(gt=0.0, le=1e9)]
    prior_biases_deg: dict[Plane, Angle]
    """Prior mean of the actuator bias."""
    net_buoyancy_n: ParameterEstimate
    crossflow_cd: ParameterEstimate
    natural_frequency_radps: ParameterEstimate
    damping_ratio: ParameterEstimate
    level_elevator_deg: Angle
    """Elevator angle of level motion."""
    level_pitch_deg: Angle
    """Pitch of level motion, positive nose up."""
    file: VehicleConfig
    """Content of the prior vehicle file, with the travel of the surfaces that the logs give."""

    @property
    def prior_biases_rad(self) -> dict[Plane, float]:
        """Prior mean of the actuator bias."""
        return {plane: math.radians(bias) for plane, bias in self.prior_biases_deg.items()}


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
    speed_mps: Annotated[float, Meta(ge=0.01, le=50.0)]
    """Speed at which the coefficients are valid."""
    thrust_fraction: Annotated[float, Meta(gt=0.0, le=1.0)]
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


PLANE_RANGES = {
    "static_gain_per_s": (-1e9, 1e9),
    "b1_per_s2": (1e-6, 1e4),
    "p_fast_per_s": (-1e4, 1e4),
    "p_slow_per_s": (-1e4, 1e4),
    "restoring_per_s2": (-1e4, 1e4),
    "delay_s": (0.0, 10.0),
    "actuator_bias_deg": (-90.0, 90.0),
}
"""Physical range of each number of a plane, far wider than that of any vehicle."""
VEHICLE_RANGES = {
    "net_buoyancy_n": (-1e9, 1e9),
    "crossflow_cd": (0.0, 100.0),
    "natural_frequency_radps": (0.01, 1e4),
    "damping_ratio": (0.01, 100.0),
}
"""Physical range of each estimate in `VehicleRecord`."""
MAX_COEFFICIENT_RATIO = 1e4
"""Largest ratio of a coefficient to its prior; 20 standard deviations of 0.4 are exp(8) = 3000."""
RESPONSE_LISTS = frozenset(
    (
        "coherence",
        "gain_db",
        "phase_deg",
        "gain_sd_db",
        "phase_sd_deg",
        "model_gain_db",
        "model_phase_deg",
    )
)
"""Lists with one entry for each frequency."""


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


class _Head(msgspec.Struct):
    """Keys that models of every format have, and other files do not; the values are not decoded."""

    format: int = 0
    planes: msgspec.Raw = msgspec.Raw()


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
        The file is missing, is not a model, has another format, or holds an impossible value.
    VehicleFileError
        The vehicle file in it is impossible.
    """
    text = b""
    try:
        text = read_limited(Path(path), MAX_TEXT_BYTES)
        head = decode(text, _Head)
        missing = "format" if head.format == 0 else "planes" if not head.planes else ""
        if missing:
            raise ModelError(
                f"{path}: not a model file (no '{missing}' key); pass the model.json written by"
                " `ground refit`"
            )
        if head.format != FORMAT:
            raise ModelError(
                f"{path}: format = {head.format}; this version reads format {FORMAT}: refit the"
                " logs"
            )
        model = decode(text, IdentifiedModel)
        if reason := _contradiction(model):
            raise ModelError(f"{path}: {reason}; give a model.json that `ground refit` wrote")
        vehicle_files.check(model.vehicle.file, f"{path}: vehicle.file")
        vehicle_check.check_config(model.vehicle.file, f"{path}: vehicle.file")
        return model
    except OSError as error:
        raise ModelError(
            f"{path}: {error.strerror}; give a model.json that `ground refit` wrote"
        ) from None
    except msgspec.MsgspecError as error:
        reason = explain(text, IdentifiedModel) or str(error)
        raise ModelError(
            f"{path}: {reason}; give a model.json that `ground refit` wrote, or refit its logs"
        ) from None


def _contradiction(model: IdentifiedModel) -> str:
    """Return key, value and expectation of the first impossible value that no type excludes."""
    joint = model.joint
    checks = [
        model_check.table_error("planes", model.planes, Plane),
        model_check.table_error("vehicle.prior_biases_deg", model.vehicle.prior_biases_deg, Plane),
        model_check.table_error("coefficients", model.coefficients, Table1Column._fields),
        *(
            model_check.range_error(f"planes.{plane}.{name}.value", estimate.value, limits)
            for plane, numbers in model.planes.items()
            for name, limits in PLANE_RANGES.items()
            if (estimate := getattr(numbers, name)) is not None
        ),
        *(
            model_check.range_error(
                f"vehicle.{name}.value", getattr(model.vehicle, name).value, limits
            )
            for name, limits in VEHICLE_RANGES.items()
        ),
        *(_coefficient_error(name, known) for name, known in model.coefficients.items()),
        model_check.names_error("joint.names", joint.names, ()),
        model_check.length_error("joint.z", joint.z, len(joint.names)),
        *(
            model_check.range_error(f"joint.z[{i}]", z, (-MAX_DEVIATION, MAX_DEVIATION))
            for i, z in enumerate(joint.z)
            if model.method == "map"
        ),
        model_check.covariance_error("joint.covariance", joint.covariance, len(joint.names)),
        model_check.covariance_error("joint.correlation", joint.correlation, len(joint.names)),
        *(_design_error(f"design.{plane}", known) for plane, known in model.design.items()),
        *(
            _validation_error(f"validation.{plane}", validation)
            for plane, validation in model.validation.items()
        ),
    ]
    return next(filter(None, checks), "")


def _coefficient_error(name: str, known: Coefficient) -> str:
    """Return that a coefficient is far from its prior; empty if it is not."""
    if abs(known.value) <= MAX_COEFFICIENT_RATIO * (abs(known.prior) or 1e9):
        return ""
    return (
        f"coefficients.{name}.value = {known.value:g}: expected at most"
        f" {MAX_COEFFICIENT_RATIO:g} times its prior, {known.prior:g}"
    )


def _design_error(key: str, known: ParameterCovariance) -> str:
    """Return what is wrong with the covariance of the numbers of a plane; empty for nothing."""
    return model_check.names_error(
        f"{key}.names", known.names, PlaneModel.__struct_fields__
    ) or model_check.covariance_error(f"{key}.matrix", known.matrix, len(known.names))


def _validation_error(key: str, validation: PlaneValidation) -> str:
    """Return the first list of another length than its frequencies; empty for none."""
    response, second = validation.frequency_response, validation.second_opinion
    lists: list[tuple[str, JsonRecord, int]] = []
    if response is not None:
        lists.append((f"{key}.frequency_response", response, len(response.frequency_radps)))
    if second is not None:
        count = len(second.frequency_radps)
        lists.append((f"{key}.second_opinion", second, count))
        lists += [
            (f"{key}.second_opinion.opinions[{i}]", opinion, count)
            for i, opinion in enumerate(second.opinions)
        ]
    errors = (
        model_check.length_error(f"{name}.{field}", values, count)
        for name, record, count in lists
        for field in record.__struct_fields__
        if field in RESPONSE_LISTS and (values := getattr(record, field)) is not None
    )
    return next(filter(None, errors), "")


def schema() -> bytes:
    """Return the JSON Schema of the format that this version reads and writes."""
    return schema_of(IdentifiedModel, f"model.json, format {FORMAT}: an identified vehicle")


if __name__ == "__main__":
    sys.stdout.buffer.write(schema())
