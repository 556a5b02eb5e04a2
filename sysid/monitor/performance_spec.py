"""Performance baseline: header of a ``gains.param``, written by a design and read for monitoring.

The header is TOML behind ``# ``, from the line ``# caribou gains 2`` to the first parameter; other
readers of parameter files treat it as a comment. Each parameter is followed by its reason. A digest
of the parameters shows whether one was changed afterwards: then the predictions no longer apply.
"""

import hashlib
import json
import tomllib
from collections.abc import Iterator, Mapping

import msgspec

from mavlink_io.errors import ErrorCode, InputError
from mavlink_io.text_files import parse_toml
from sysid.models.json_record import JsonRecord

MAGIC = "# caribou gains "
"""Beginning of the first line of every header."""
FORMAT = 2
AVERAGED_S = 20.0
"""Averaging time (s) of the predicted statistics of means."""
RESONANCE_BANDWIDTH = 0.5
"""Bandwidth of the resonance filter, as a share of its frequency."""


class BaselineError(InputError):
    """The header cannot be read; the message gives the error."""

    code = ErrorCode.PERFORMANCE_BASELINE


class PredictedStatistic(JsonRecord, frozen=True):
    """Predicted statistics of one quantity in steady flight, in the unit of its name."""

    mean: float
    mean_sd: float
    """Standard deviation of the mean due to model uncertainty."""
    rms: float
    """Standard deviation about the mean."""
    p95: float
    """95 % of the samples are within this distance of the mean."""
    mean_sd_20s: float
    """Standard deviation of a mean over ``AVERAGED_S``."""
    correlation_time_s: float
    """Correlation time (s): integral of the squared autocorrelation over all lags.

    Samples this far apart count as independent in an estimate of the variance.
    """


class Robustness(JsonRecord, frozen=True):
    """Shares of the vehicles sampled from the model that meet the specification."""

    specification: float
    relaxed: float
    """Share with damping 0.5, gain margin 5 dB and phase margin 40 deg."""
    vehicles: int
    seed: int


class PerformanceBaseline(JsonRecord, frozen=True):
    """Model, specification and predicted performance of a set of gains."""

    model_sha256: str
    version: str
    """Version of this package."""
    speed_mps: float
    thrust: float
    """Fraction of full thrust for which the predictions hold."""
    heading_resonance_radps: float
    pitch_resonance_radps: float
    """Resonance frequencies (rad/s): frequency of the largest sensitivity in each plane."""
    specification: dict[str, float]
    predicted: dict[str, PredictedStatistic]
    """Statistics by quantity: heading_deg, heading_resonance_deg, pitch_deg, ...

    A "resonance" quantity is the output of the resonance filter.
    """
    robustness: Robustness | None = None
    """Robustness of the design; None for a model without covariance."""


def encode(
    baseline: PerformanceBaseline, gains: Mapping[str, float], reasons: Mapping[str, str]
) -> str:
    """Return the text of a gains file.

    Parameters
    ----------
    baseline : PerformanceBaseline
        Header.
    gains : Mapping
        Values by parameter name.
    reasons : Mapping
        Reasons by parameter name.

    Returns
    -------
    str
        The whole file.
    """
    values = {name: f"{value:.6g}" for name, value in gains.items()}
    header = {"gains_sha256": _digest(values), **msgspec.to_builtins(baseline)}
    lines = [f"{MAGIC}{FORMAT}", *(f"# {line}".rstrip() for line in _toml(header))]
    lines += [f"{name},{value}  # {reasons[name]}" for name, value in values.items()]
    return "\n".join(lines) + "\n"


def decode(text: str, values: Mapping[str, float]) -> PerformanceBaseline | None:
    """Return the baseline in the text of a gains file, or None without a header.

    Parameters
    ----------
    text : str
        Text of the file.
    values : Mapping
        Parameters that were read from the file, by name.

    Returns
    -------
    PerformanceBaseline or None
        Header of the file.

    Raises
    ------
    BaselineError
        The header cannot be read or has another format, or the parameters were changed.
    """
    header = _decode_header(text)
    if header is None:
        return None
    baseline, digest = header
    if digest != _digest({name: f"{value:.6g}" for name, value in values.items()}):
        raise BaselineError(
            "its values were changed after the design; the predictions do not apply to them"
        )
    return baseline


def header_of(text: str) -> PerformanceBaseline | None:
    """Return the header of a gains file, whose values may have been changed after the design.

    Parameters
    ----------
    text : str
        Text of the file.

    Returns
    -------
    PerformanceBaseline or None
        Header; None for a file without one.

    Raises
    ------
    BaselineError
        The header cannot be read or has another format.
    """
    header = _decode_header(text)
    return header[0] if header else None


def _decode_header(text: str) -> tuple[PerformanceBaseline, str] | None:
    """Return the header and the digest of the designed values. Raises BaselineError."""
    lines = text.splitlines()
    if not lines or not lines[0].startswith(MAGIC):
        return None
    header_format = lines[0].removeprefix(MAGIC).strip()
    if header_format != str(FORMAT):
        raise BaselineError(
            f"its header has format {header_format}; this version reads format {FORMAT}"
        )
    try:
        header = parse_toml("\n".join(_head(lines)))
        digest = header.pop("gains_sha256", "")
        return msgspec.convert(header, PerformanceBaseline), str(digest)
    except (tomllib.TOMLDecodeError, msgspec.ValidationError) as error:
        raise BaselineError(f"its header cannot be read: {error}".replace("`", "")) from None


def _head(lines: list[str]) -> Iterator[str]:
    """Yield the lines of the header without the comment character."""
    for line in lines[1:]:
        if not line.startswith("#"):
            return
        yield line.removeprefix("#")


def _digest(values: Mapping[str, str]) -> str:
    """Return the SHA-256 of parameters and values."""
    return hashlib.sha256(
        "\n".join(f"{name},{values[name]}" for name in sorted(values)).encode()
    ).hexdigest()


def _toml(table: Mapping[str, object], path: str = "") -> Iterator[str]:
    """Yield numbers and texts of a table, then its sub-tables; None values are omitted."""
    plain = {name: value for name, value in table.items() if isinstance(value, float | int | str)}
    if path and plain:
        yield from ("", f"[{path}]")
    for name, number in plain.items():
        yield (
            f"{name} = {number:.6g}"
            if isinstance(number, float)
            else f"{name} = {json.dumps(number)}"
        )
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from _toml(value, f"{path}.{name}".lstrip("."))
