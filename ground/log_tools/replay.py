"""Replay of a log with other parameters, and its result as text and JSON."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ground.log_tools import mcap
from ground.log_tools.comparison import Comparison, compare
from ground.missions import plans
from mavlink_io.errors import InputError
from mavlink_io.mission_items import MissionItem
from sysid.data import readers
from sysid.monte_carlo import replay
from sysid.monte_carlo.replay import Deviation, DivePlan, Replayed
from sysid.test_design.prior import DesignPrior

MISSION = "mission.plan"
"""Attachment of a log with the mission of the dive."""
RECORDED, UNCHANGED, CHANGED = "recorded", "unchanged", "changed"


class ReplayRequest(NamedTuple):
    """Dive and parameters of a replay."""

    log: Path
    parameters: Mapping[str, float]
    """Parameters that replace recorded ones."""
    mission: str | None = None
    """Name or file of the mission; None for the mission in the log."""
    controller: Path | None = None
    """File of the LQG controllers of the recorded dive; None for the PID loops."""
    new_controller: Path | None = None
    """File of the LQG controllers of the replay with other parameters; None for `controller`."""


def replay_log(request: ReplayRequest, prior: DesignPrior) -> Replayed:
    """Replay a log.

    Parameters
    ----------
    request : ReplayRequest
        Dive and parameters.
    prior : DesignPrior
        Model of the vehicle.

    Returns
    -------
    Replayed
        Replays with the recorded and with the other parameters.

    Raises
    ------
    InputError
        The log, the mission or a parameter cannot be used.
    """
    plan = _plan(request)
    log = readers.read(request.log)
    controllers = replay.load_controllers(request.controller, request.new_controller)
    return replay.replay(log, prior.vehicle(prior.mean), plan, request.parameters, controllers)


def _plan(request: ReplayRequest) -> DivePlan:
    """Return the plan of the dive; a given mission must be that in the log, if it has one."""
    path = request.log
    stored = mcap.attachment(path, MISSION) if readers.format_of(path) == "mcap" else None
    if stored is None and request.mission is None:
        raise InputError(f"{path}: holds no mission; give that of the dive with --mission")
    if stored is None:
        given = plans.load(request.mission or "")
        return DivePlan(given.items, given.fence, given.rally)
    text, where = stored.decode("utf-8", "replace"), f"{path}: {MISSION}"
    recorded = plans.read_plan(text, where)
    if request.mission and not _is_same(plans.load_items(request.mission), recorded):
        raise InputError(
            f"--mission {request.mission}: {path} holds another mission; a replay flies that of the"
            " dive: leave out --mission, or use `ground simulate` for another one"
        )
    return DivePlan(recorded, plans.read_fence(text, where), plans.read_rally(text, where))


def _is_same(one: Sequence[MissionItem], other: Sequence[MissionItem]) -> bool:
    """Return whether two missions are the same in a plan file."""
    stored = plans.read_plan(plans.write_plan(one), MISSION)
    return plans.write_plan(stored) == plans.write_plan(other)


def comparison(replayed: Replayed) -> Comparison:
    """Return the tracking errors of the recorded dive and of both replays."""
    return compare(
        {
            RECORDED: replayed.recorded,
            UNCHANGED: replayed.unchanged.log,
            CHANGED: replayed.changed.log,
        }
    )


def format_text(replayed: Replayed, parameters: Mapping[str, float]) -> str:
    """Return the dives side by side.

    Parameters
    ----------
    replayed : Replayed
        Result of the replay.
    parameters : mapping
        Parameters that replaced recorded ones.

    Returns
    -------
    str
        Changed parameters, tracking errors, rms differences and failsafes.
    """
    return "\n".join(_lines(replayed, parameters))


def _lines(replayed: Replayed, parameters: Mapping[str, float]) -> Iterator[str]:
    """Yield the lines of the text."""
    for name, before, after in changes(replayed, parameters):
        yield f"{name:16s} {before:10.4g} -> {after:.4g}"
    yield str(comparison(replayed))
    yield "rms difference         heading, deg  pitch, deg  depth, m  rudder, deg  elevator, deg"
    yield _row("unchanged - recorded", replayed.fidelity)
    yield _row("changed - unchanged", replayed.effect)
    for name, dive in ((UNCHANGED, replayed.unchanged), (CHANGED, replayed.changed)):
        if not dive.finished:
            yield f"{name}: the mission was not completed: {dive.failsafe or 'time is over'}"


def _row(name: str, deviation: Deviation) -> str:
    """Return one line of rms differences."""
    return (
        f"{name:21s}  {deviation.heading_deg:12.2f}  {deviation.pitch_deg:10.2f}"
        f"  {deviation.depth_m:8.3f}  {deviation.rudder_deg:11.2f}  {deviation.elevator_deg:13.2f}"
    )


def changes(replayed: Replayed, parameters: Mapping[str, float]) -> list[tuple[str, float, float]]:
    """Return name, recorded and new value of each parameter that differs.

    Parameters
    ----------
    replayed : Replayed
        Result of the replay.
    parameters : mapping
        Parameters that replaced recorded ones.

    Returns
    -------
    list of tuple
        Sorted by name; NaN for a parameter that the log does not contain.
    """
    recorded = replayed.recorded.parameters
    return [
        (name, recorded.get(name, float("nan")), value)
        for name, value in sorted(parameters.items())
        if abs(recorded.get(name, float("inf")) - value) > 1e-6 * max(1.0, abs(value))
    ]


def as_json(replayed: Replayed, parameters: Mapping[str, float]) -> dict[str, Any]:
    """Return the result as a JSON object.

    Parameters
    ----------
    replayed : Replayed
        Result of the replay.
    parameters : mapping
        Parameters that replaced recorded ones.

    Returns
    -------
    dict
        ``parameters``, ``errors``, ``fidelity`` and ``effect``, and both outcomes.
    """
    return {
        "parameters": {
            name: {"recorded": None if before != before else before, "replayed": after}
            for name, before, after in changes(replayed, parameters)
        },
        "errors": {
            dive.name: {k: None if v != v else v for k, v in dive._asdict().items()}
            for dive in comparison(replayed).dives
        },
        "fidelity": replayed.fidelity._asdict(),
        "effect": replayed.effect._asdict(),
        "finished": {
            UNCHANGED: replayed.unchanged.finished,
            CHANGED: replayed.changed.finished,
        },
        "failsafes": {
            UNCHANGED: replayed.unchanged.failsafe,
            CHANGED: replayed.changed.failsafe,
        },
    }
