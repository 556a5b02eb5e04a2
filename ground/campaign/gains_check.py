"""Check of a set of gains against the model that they were designed on, before they are loaded."""

from collections.abc import Mapping
from pathlib import Path

from ground.campaign import refit
from ground.client import param_file
from mavlink_io.errors import ErrorCode, InputError, OperationError
from sysid.design import design_model, robustness
from sysid.design.constrained_search import CONSTRAINT_TOLERANCE
from sysid.design.constraints import Bounds
from sysid.models import model_file

MODEL_FILE = "model.json"
"""Name of a model beside the gains file."""
_LOOP_GAINS = tuple(f"{loop}_{gain}" for loop in ("HDG", "PTCH", "DPT") for gain in "PID")


class UnsafeGainsError(OperationError):
    """The gains do not meet the limits on their model; the message names the worst limit."""

    code = ErrorCode.UNSAFE_GAINS


def check_gains(
    file: Path, values: Mapping[str, float], model: Path | None, prior: str | None = None
) -> str:
    """Check the gains of a file on the model that its header names.

    Parameters
    ----------
    file : Path
        Gains file; a file without a header is checked only on a given model.
    values : Mapping
        Parameters of the file by name; they may have been changed after the design.
    model : Path or None
        Model file; None for `MODEL_FILE` in the folder of the gains.
    prior : str, optional
        Vehicle file of the refit; by default the one in the model.

    Returns
    -------
    str
        Why the gains were not checked; empty if they were, or if the file holds no gains of a
        design.

    Raises
    ------
    InputError
        `model` is not the model of the gains, or cannot be read.
    UnsafeGainsError
        A margin or a damping ratio is below its limit on the model.

    Notes
    -----
    The limits are the relaxed ones of `sysid.design.robustness`, or those of the specification of
    the design if they are lower.
    """
    header = param_file.read_header(file)
    if header is None and model is None:
        return ""
    path = model or file.parent / MODEL_FILE
    digest = header.model_sha256 if header else ""
    if model is None and not path.is_file():
        return f"{file}: not checked: model {digest[:12]} is not in this folder; give --model MODEL"
    identified = refit.read_model(path)
    if (found := model_file.sha256_of_model(identified)) != digest:
        if model is None:
            return (
                f"{file}: not checked: was designed on model {digest[:12]}, and {path} is model"
                f" {found[:12]}; give --model MODEL"
            )
        raise InputError(
            f"{file}: was designed on model {digest[:12] or 'unknown'}, and {path} is model"
            f" {found[:12]}; redesign on {path}"
        )
    assert header is not None, "an empty digest is that of no model"
    if missing := [name for name in _LOOP_GAINS if name not in values]:
        raise UnsafeGainsError(f"{file}: lacks {missing[0]}, so that no margin can be computed")
    bounds = _bounds(header.specification)
    vehicle = design_model.from_model(identified, refit.read_vehicle(prior))
    violations = robustness.violations(vehicle, values, bounds)
    worst = max(violations, key=lambda name: violations[name])
    if violations[worst] > CONSTRAINT_TOLERANCE:
        raise UnsafeGainsError(
            f"{file}: on {path} {_describe(worst, violations[worst], bounds)}; redesign"
        )
    return ""


def _bounds(specification: Mapping[str, float]) -> Bounds:
    """Return the relaxed limits, or lower ones of a specification."""
    relaxed = robustness.RELAXED
    return relaxed._replace(
        damping=min(relaxed.damping, specification.get("damping", relaxed.damping)),
        gm_db=min(relaxed.gm_db, specification.get("gm_db", relaxed.gm_db)),
        pm_deg=min(relaxed.pm_deg, specification.get("pm_deg", relaxed.pm_deg)),
    )


def _describe(name: str, violation: float, bounds: Bounds) -> str:
    """Return a violated limit with its value."""
    limits = {"gain": (bounds.gm_db, " dB"), "phase": (bounds.pm_deg, " deg")}
    limit, unit = limits.get(name.split()[0], (bounds.damping, ""))
    value = (1.0 - violation) * limit
    unstable = " (unstable)" if not unit and value < 0.0 else ""
    return f"the {name} is {value:.3g}{unit}{unstable}, and must be at least {limit:g}{unit}"
