"""Identification of a model from logs, and design of gains for a model."""

from collections.abc import Sequence
from pathlib import Path

from ground.campaign import refit
from mavlink_io.errors import InputError
from sysid.design.pid import Design, Spec
from sysid.models.model_file import IdentifiedModel, Method
from sysid.refit import RefitRequest


def identify(
    logs: Sequence[str | Path],
    held_out: Sequence[str | Path] = (),
    *,
    prior: str | Path = "caribou_nominal",
    method: Method = "map",
    force: bool = False,
) -> IdentifiedModel:
    """Identify a model from the tests in logs, as `ground refit` does.

    Parameters
    ----------
    logs : sequence of str or Path
        Logs with rudder or elevator tests.
    held_out : sequence of str or Path
        Logs whose tests are predicted but not fitted.
    prior : str or Path
        ``caribou_nominal``, a vehicle file, or a ``model.json``.
    method : {"map", "output-error", "filter-error", "paper"}
        Method of identification.
    force : bool
        Return the model even if the fit failed; the model records the failure.

    Returns
    -------
    IdentifiedModel
        Coefficients, design numbers of both planes with standard deviations, and assessment.

    Raises
    ------
    CaribouError
        A log or the prior cannot be used, or the fit failed.
    """
    for argument in (logs, held_out):
        if isinstance(argument, str | Path):
            raise InputError(f"{argument}: expected a list of logs, such as [{str(argument)!r}]")
    request = RefitRequest(paths=logs, held_out=held_out, prior=prior, method=method)
    return refit.refit(request, force=force)


def design(
    model: IdentifiedModel | str | Path,
    spec: Spec | None = None,
    *,
    prior: str | Path | None = None,
    force: bool = False,
) -> Design:
    """Design PID gains for a model, as `ground redesign` does.

    Parameters
    ----------
    model : IdentifiedModel, str or Path
        The model, or its ``model.json``.
    spec : Spec, optional
        Limits that the gains must meet; the default ones without it.
    prior : str or Path, optional
        Vehicle file of the refit; by default the one in the model.
    force : bool
        Design even if the model is assessed as unfit for redesign.

    Returns
    -------
    Design
        ``gains`` by parameter name, their reasons, and the predicted performance; `write_params`
        writes a ``gains.param``.

    Raises
    ------
    CaribouError
        The model cannot be read or is not fit for redesign, or no gains meet the limits.
    """
    return refit.redesign(model_of(model), spec, str(prior) if prior else None, force=force)


def load_model(path: str | Path) -> IdentifiedModel:
    """Load a ``model.json``.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    IdentifiedModel
        Its content.

    Raises
    ------
    CaribouError
        The file is missing or is no model of this version.
    """
    return refit.read_model(Path(path))


def model_of(model: IdentifiedModel | str | Path) -> IdentifiedModel:
    """Return a model, or that in a file.

    Parameters
    ----------
    model : IdentifiedModel, str or Path
        The model, or its ``model.json``.

    Returns
    -------
    IdentifiedModel
        The model.

    Raises
    ------
    CaribouError
        The file is missing or is no model of this version, or the argument is neither.
    """
    if isinstance(model, str | Path):
        return load_model(model)
    if not isinstance(model, IdentifiedModel):
        raise InputError(f"model = {model!r}: expected a model, or the path of a model.json")
    return model


def save_model(model: IdentifiedModel, path: str | Path) -> None:
    """Save a model as ``model.json``.

    Parameters
    ----------
    model : IdentifiedModel
        The model.
    path : str or Path
        File to write; an existing one is overwritten.

    Raises
    ------
    CaribouError
        ``model`` is no model.
    """
    if not isinstance(model, IdentifiedModel):
        raise InputError(f"model = {model!r}: expected a model, such as `identify` returns")
    refit.write_model(model, Path(path))
