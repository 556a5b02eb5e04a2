"""`ground replay`: fly a recorded dive again with other parameters and its own disturbances."""

from pathlib import Path
from typing import Annotated

import typer

from ground.cli.options import Json, Prior, print_result, refuse_empty, remark_other_vehicle
from ground.errors import UnsuccessfulError
from ground.output_files import new_file
from mavlink_io.errors import ErrorCode, InputError


def replay(
    log: Annotated[Path, typer.Argument(help="Log of the dive, with its parameters.")],
    params: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Parameters that replace recorded ones.")
    ] = None,
    new_controller: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="LQG controllers that replace the recorded loops."),
    ] = None,
    controller: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="LQG controllers of the recorded dive, if it had any."),
    ] = None,
    model: Annotated[
        str,
        typer.Option(
            metavar="NAME|FILE|MODEL.json",
            help="Vehicle: caribou_nominal, a vehicle file, or a model.json, which fits best.",
        ),
    ] = "caribou_nominal",
    prior: Prior = None,
    mission: Annotated[
        str | None,
        typer.Option(
            callback=refuse_empty,
            metavar="NAME|FILE",
            help="Mission of the dive, if the log has none.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Folder for recorded.csv, unchanged.csv and changed.csv with the vehicle's state.",
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Fly a recorded dive again in simulation, with other gains and its own disturbances.

    The replay with the recorded parameters shows how nearly the model reproduces the dive. Exit
    status 1 if the replay with the other parameters does not complete the mission.
    """
    from ground.campaign import refit
    from ground.client import param_file
    from ground.log_tools import export
    from ground.log_tools import replay as replays
    from sysid.monte_carlo import samples
    from sysid.test_design import prior as priors

    if params is None and new_controller is None:
        raise InputError("--params: is missing; give --params FILE or --new-controller FILE")
    parameters = param_file.load(params) if params else {}
    if model.endswith(".json"):
        remark_other_vehicle(model, prior)
        posterior = samples.read(model, refit.read_vehicle(prior))
    else:
        posterior = priors.read(model)
    dives = ("recorded", "unchanged", "changed")
    targets = {} if out is None else {name: out / f"{name}.csv" for name in dives}
    if out is not None and out.exists():
        for target in targets.values():
            new_file(target)
    request = replays.ReplayRequest(log, parameters, mission, controller, new_controller)
    try:
        result = replays.replay_log(request, posterior)
    except InputError as error:
        if error.code == ErrorCode.PARAMETER:  # of this file: those of the log are a LogError
            raise type(error)(f"{params}: {error}") from None
        raise
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        logs = (result.recorded, result.unchanged.log, result.changed.log)
        for name, dive in zip(dives, logs, strict=True):
            export.write_state(dive, targets[name])
    print_result(
        {**replays.as_json(result, parameters), "files": [str(t) for t in targets.values()]},
        replays.format_text(result, parameters),
        json,
    )
    if not result.changed.finished:
        raise UnsuccessfulError(
            f"{params or new_controller}: the replay did not complete the mission:"
            f" {result.changed.failsafe or 'time is over'}"
        )
