"""What gains promise: the head of a ``gains.param``, written by a design and read by whoever
watches them kept.

The head is TOML behind ``# ``, from the line ``# caribou gains 1`` to the first parameter; to every
other reader of parameter files it is a comment. Each parameter has its reason behind it. A digest
of the parameters tells whether somebody has changed one since: then the promise is no longer
theirs."""

import hashlib
import json
import tomllib
from collections.abc import Iterator, Mapping

import msgspec

from sysid.models.model_file import ModelRecord

FIRST_LINE = "# caribou gains 1"
AVERAGED_S = 20.0
"""What is foretold of averages is foretold of those over this time."""
RESONANCE_BANDWIDTH = 0.5
"""Bandwidth of the narrow band in which a swing is looked for, as a share of its frequency."""


class BaselineError(ValueError):
    """A head that cannot be read; the message says what is wrong."""


class PredictedStatistic(ModelRecord, frozen=True):
    """One quantity of steady flight in the identified sea, in the unit of its name."""

    mean: float
    mean_sd: float
    """How unsure the model is of it."""
    rms: float
    """About the mean."""
    p95: float
    """95 % of the samples are within this of the mean."""
    average_sd: float
    """Standard deviation of an average over ``AVERAGED_S``."""
    memory_s: float
    """Integral of the squared correlation over both directions of time: so far apart, samples count
    as new ones in an estimate of the variance."""


class Robustness(ModelRecord, frozen=True):
    """Of the vehicles that the model allows for, what share keeps the specification."""

    specification: float
    relaxed: float
    """Damping 0.5, gain margin 5 dB, phase margin 40 degrees."""
    vehicles: int
    seed: int


class PerformanceBaseline(ModelRecord, frozen=True):
    """What gains rest on, were asked for, and should come to."""

    model_sha256: str
    version: str
    """Of this package."""
    speed_mps: float
    thrust: float
    """Fraction of full thrust at which all of it holds."""
    heading_swing_radps: float
    pitch_swing_radps: float
    """Where a disturbance is answered worst: about there an ill-damped loop swings."""
    specification: dict[str, float]
    predicted: dict[str, PredictedStatistic]
    """By quantity: heading_deg, heading_swing_deg, pitch_deg, ...; a swing is what a narrow band
    about it holds."""
    kept: Robustness | None = None
    """None where the model does not say how sure it is."""


def encode(
    promise: PerformanceBaseline, gains: Mapping[str, float], reasons: Mapping[str, str]
) -> str:
    """The whole file."""
    values = {name: f"{value:.6g}" for name, value in gains.items()}
    told = {"gains_sha256": _digest(values), **msgspec.to_builtins(promise)}
    lines = [FIRST_LINE, *(f"# {line}".rstrip() for line in _toml(told))]
    lines += [f"{name},{value}  # {reasons[name]}" for name, value in values.items()]
    return "\n".join(lines) + "\n"


def decode(text: str, values: Mapping[str, float]) -> PerformanceBaseline | None:
    """The promise in a file's text whose parameters are ``values``; None where it makes none.

    Raises:
        PromiseError: there is a head and it cannot be read, or the parameters are not those it was
        written for.
    """
    lines = text.splitlines()
    if not lines or lines[0].rstrip() != FIRST_LINE:
        return None
    try:
        told = tomllib.loads("\n".join(_head(lines)))
        digest = told.pop("gains_sha256", "")
        promise = msgspec.convert(told, PerformanceBaseline)
    except (tomllib.TOMLDecodeError, msgspec.ValidationError) as error:
        raise BaselineError(f"its head cannot be read: {error}".replace("`", "")) from None
    if digest != _digest({name: f"{value:.6g}" for name, value in values.items()}):
        raise BaselineError(
            "its values were changed since they were designed; what it foretells is not theirs"
        )
    return promise


def _head(lines: list[str]) -> Iterator[str]:
    for line in lines[1:]:
        if not line.startswith("#"):
            return
        yield line.removeprefix("#")


def _digest(values: Mapping[str, str]) -> str:
    return hashlib.sha256(
        "\n".join(f"{name},{values[name]}" for name in sorted(values)).encode()
    ).hexdigest()


def _toml(table: Mapping[str, object], path: str = "") -> Iterator[str]:
    """Numbers and texts of a table, then the tables in it; what is None is left out."""
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
