"""``ground fly``: a dive with a vehicle that is there or a simulated one, recorded, and followed
while it lasts."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.options import (
    GROUND_LINK,
    Address,
    Json,
    ScenarioName,
    Seed,
    Sign,
    Speed,
    VehicleName,
    new_file,
    print_result,
)
from ground.errors import InputError, OperationError
from mavlink_io.mission_items import MavCmd

if TYPE_CHECKING:
    from ground.client.flight import Dive
    from ground.live.performance_monitor import PerformanceMonitor
    from ground.live.session import LiveSession
    from ground.progress import ProgressDisplay


def fly(
    mission: Annotated[
        str, typer.Argument(help="A shipped mission's name, a .toml, .plan or QGC WPL 110 file.")
    ],
    connect: Address = GROUND_LINK,
    sign: Sign = None,
    sitl: Annotated[
        bool, typer.Option("--sitl", help="Start a simulated vehicle and fly that.")
    ] = False,
    log: Annotated[
        Path | None, typer.Option(metavar="FILE.mcap", help="Default: the mission's name.")
    ] = None,
    tlog: Annotated[
        Path | None, typer.Option(metavar="FILE.tlog", help="Also a MAVLink telemetry log.")
    ] = None,
    vehicle: VehicleName = "caribou_truth",
    scenario: ScenarioName = "calm",
    seed: Seed = 1,
    speed: Speed = "max",
    params: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Parameters to set before the dive; "
            "with --sitl, left out, and not Caribou: gains designed from the vehicle file.",
        ),
    ] = None,
    truth: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.mcap", help="With --sitl: what really happened, beside what was told."
        ),
    ] = None,
    prior: Annotated[
        str | None,
        typer.Option(
            metavar="NAME|FILE|MODEL.json",
            help=(
                "What is known of her before her tests, for the estimate that is shown while they"
                " run: bench, a "
                "vehicle file, or a model.json. Default: the vehicle of --sitl, else bench."
            ),
        ),
    ] = None,
    gains: Annotated[
        Path | None,
        typer.Option(
            metavar="GAINS.param",
            help=(
                "Set gains that a redesign wrote, after --params, and tell whether she keeps what"
                " they promise."
            ),
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Upload a mission, fly it, and record until the vehicle has disarmed itself at the surface."""
    from ground import progress
    from ground.campaign import prototype
    from ground.client import assessment, flight
    from ground.client.flight import Dive
    from ground.live.listeners import Listeners
    from ground.simulation.processes import SimulatedVehicle, Simulation

    if sitl and sign:
        raise InputError(
            "--sign: is for --connect; the link to a vehicle of --sitl stays on this machine"
        )
    if truth and not sitl:
        raise InputError(f"--truth {truth}: needs --sitl; nobody knows the truth of a real sea")
    target = new_file(log or Path(Path(mission).stem + ".mcap"))
    first = _parameters(params, gains, vehicle if sitl else None)
    dive = Dive.load(mission, target, parameters=first, tlog=tlog and new_file(tlog))
    if sitl and not (params or gains or _has_tests(dive)):
        dive = replace(dive, parameters={**prototype.trim_learning_for(vehicle), **dive.parameters})
    with progress.display(Path(mission).stem, quiet=json) as shown:
        estimating = _live_estimate(dive, prior or _prior_file(vehicle if sitl else None), shown)
        keeping = _performance_monitor(gains, shown) if gains else None
        following = Listeners([each for each in (estimating, keeping) if each], shown.show)
        if sitl:
            simulated = SimulatedVehicle(Simulation(vehicle, scenario, seed, speed, truth))
            outcome = flight.fly_simulated(dive, simulated, shown.watch, shown.hear, following)
        else:
            outcome = flight.fly(dive, connect, shown.watch, shown.hear, sign, following)
    held = assessment.assess_dive(outcome.log, outcome.texts)
    flown = {**outcome._asdict(), "log": str(outcome.log), "assessment": assessment.as_json(held)}
    told = {
        "estimates": estimating.as_json() if estimating else {},
        "kept": keeping.as_json() if keeping else None,
    }
    print_result(
        {**flown, **told},
        f"{outcome.log}: {outcome.vehicle_s:.0f} s flown in {outcome.wall_s:.1f} s, "
        f"{outcome.messages} messages, {outcome.lost_frames} lost\n{assessment.format_text(held)}"
        + (f"\n{keeping.in_words()}" if keeping else ""),
        json,
    )
    if outcome.failsafes:
        raise OperationError("; ".join(outcome.failsafes))


def _parameters(
    params: Path | None, gains_file: Path | None, simulated: str | None
) -> dict[str, float]:
    """What to set before the dive: the files' values; for a simulated vehicle without any what she
    needs to fly."""
    from ground.campaign import prototype
    from ground.client import param_file as gains

    given = (
        gains.load(params)
        if params
        else prototype.first_dive_parameters(simulated)
        if simulated
        else {}
    )
    return {**given, **(gains.load(gains_file) if gains_file else {})}


def _prior_file(simulated: str | None) -> str:
    from ground.campaign import prototype

    return prototype.prior_file_of(simulated) if simulated else "caribou_nominal"


def _has_tests(dive: "Dive") -> bool:
    """Whether the mission holds tests, which start from trims that must not change meanwhile."""
    return any(item.command == MavCmd.USER_1 for item in dive.items)


def _live_estimate(dive: "Dive", prior: str, shown: "ProgressDisplay") -> "LiveSession | None":
    """Who estimates the vehicle while she is tested; nobody on a dive without tests."""
    if not _has_tests(dive):
        return None
    from ground.live.session import LiveSession

    return LiveSession(prior, None, shown.say)


def _performance_monitor(gains_file: Path, shown: "ProgressDisplay") -> "PerformanceMonitor":
    """Who watches whether the gains keep their promise. Raises BadInputError where they make
    none."""
    from ground.client import param_file as gains
    from ground.live.performance_monitor import PerformanceMonitor

    return PerformanceMonitor(gains.require_baseline(gains_file), shown.say)
