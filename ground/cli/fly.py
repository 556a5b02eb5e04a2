"""`ground fly`: fly a mission with a real or a simulated vehicle and record it."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.interrupt import OnInterrupt, interruptible
from ground.cli.live import Live, page_process
from ground.cli.options import (
    GROUND_LINK,
    Address,
    Json,
    ScenarioName,
    Seed,
    Sign,
    Speed,
    VehicleId,
    VehicleName,
    print_result,
    refuse_empty,
    refuse_given,
)
from ground.errors import UnsuccessfulError
from ground.output_files import new_file, refuse_same_file
from mavlink_io.mission_items import MavCmd

if TYPE_CHECKING:
    from ground.cli.progress import ProgressDisplay
    from ground.client.dive_symptoms import Symptom
    from ground.client.flight import Dive
    from ground.live.page.feed import DiveFeed, PageProcess
    from ground.live.performance_monitor import PerformanceMonitor
    from ground.live.session import LiveSession


def fly(
    context: typer.Context,
    mission: Annotated[
        str, typer.Argument(help="A shipped mission's name, a .toml, .plan or QGC WPL 110 file.")
    ],
    connect: Address = GROUND_LINK,
    sign: Sign = None,
    vehicle_id: VehicleId = None,
    sitl: Annotated[
        bool, typer.Option("--sitl", help="Start a simulated vehicle and fly that.")
    ] = False,
    log: Annotated[
        Path | None, typer.Option(metavar="FILE.mcap", help="Default: the mission's name.")
    ] = None,
    tlog: Annotated[
        Path | None, typer.Option(metavar="FILE.tlog", help="Also write a MAVLink telemetry log.")
    ] = None,
    vehicle: VehicleName = "caribou_truth",
    scenario: ScenarioName = "calm",
    seed: Seed = 1,
    speed: Speed = "max",
    params: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Parameters to set before the dive. Default with --sitl and a vehicle other than "
            "Caribou: gains designed from the vehicle file.",
        ),
    ] = None,
    truth: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.mcap", help="With --sitl: also log the true state of the simulator."
        ),
    ] = None,
    prior: Annotated[
        str | None,
        typer.Option(
            callback=refuse_empty,
            metavar="NAME|FILE|MODEL.json",
            help=(
                "Prior of the live estimate during tests: caribou_nominal, a vehicle file, or a"
                " model.json. Default: the vehicle of --sitl, else caribou_nominal."
            ),
        ),
    ] = None,
    gains: Annotated[
        Path | None,
        typer.Option(
            metavar="GAINS.param",
            help=(
                "Set gains of a redesign, after --params, and warn when performance leaves the"
                " range predicted for them."
            ),
        ),
    ] = None,
    on_interrupt: Annotated[
        OnInterrupt,
        typer.Option(
            help="What a vehicle under way does after Ctrl-C: ask, if there is a terminal; leave it"
            " flying; hold depth, heading and thrust; or surface."
        ),
    ] = OnInterrupt.ASK,
    live: Live = False,
    json: Json = False,
) -> None:
    """Upload a mission, fly it, and record until the vehicle has disarmed itself at the surface."""
    from ground.cli import progress
    from ground.client import assessment, flight, verdict
    from ground.client.flight import Dive
    from ground.live.listeners import Listeners
    from ground.simulation.processes import SimulatedVehicle, Simulation

    if sitl:
        refuse_given(
            context,
            "--connect --sign --vehicle-id",
            "is for the link to a real vehicle; --sitl starts one vehicle on this machine",
        )
    else:
        refuse_given(
            context,
            "--vehicle --scenario --seed --speed --truth",
            "is for a simulated vehicle; add --sitl, or leave it out",
        )
    log_file = new_file(log or Path(Path(mission).stem + ".mcap"))
    if tlog is not None:
        refuse_same_file("--tlog", new_file(tlog), [log_file])
    if truth is not None:
        refuse_same_file("--truth", new_file(truth), [log_file, tlog])
    heaviness = _check_simulation(vehicle, scenario) if sitl else None
    parameters = _parameters(params, gains, vehicle if sitl else None)
    dive = Dive.load(
        mission,
        log_file,
        parameters=parameters,
        tlog=tlog,
        system=vehicle_id,
    )
    if not _has_tests(dive):
        refuse_given(
            context,
            "--prior",
            f"is for the live estimate during identification tests; {mission} has none",
        )
    if sitl and not (params or gains or _has_tests(dive)):
        dive = _with_trim_learning(dive, vehicle)
    with (
        interruptible(on_interrupt, connect, sign, vehicle_id),
        page_process(live=live) as page,
        progress.display(Path(mission).stem) as display,
    ):
        estimate = _live_estimate(dive, prior or _prior_file(vehicle if sitl else None), display)
        monitor = _performance_monitor(gains, display) if gains else None
        feed = _live_feed(page, dive, estimate) if page else None
        listeners = Listeners(
            [listener for listener in (estimate, monitor, feed) if listener], display.show
        )
        if heaviness:
            display.print_line(heaviness.message)
        if sitl:
            simulated = SimulatedVehicle(
                Simulation(vehicle=vehicle, scenario=scenario, seed=seed, speed=speed, truth=truth),
                notify=display.print_line,
            )
            result = flight.fly_simulated(
                dive,
                simulated,
                on_progress=display.watch,
                on_text=display.show_text,
                listener=listeners,
            )
        else:
            result = flight.fly(
                dive,
                connect,
                on_progress=display.watch,
                on_text=display.show_text,
                key_file=sign,
                listener=listeners,
                on_remark=display.print_line,
            )
    assessed = assessment.assess_dive(result.log, result.trims_learned)
    if heaviness:
        assessed = assessed._replace(symptoms=(heaviness, *assessed.symptoms))
    print_result(
        {
            **result._asdict(),
            "log": str(result.log),
            "assessment": assessment.as_json(assessed),
            "estimates": estimate.as_json() if estimate else {},
            "monitoring": monitor.report() if monitor else None,
        },
        f"{result.log}: {result.vehicle_s:.0f} s flown in {result.wall_s:.1f} s, "
        f"{result.messages} messages, {result.lost_frames} lost\n"
        f"{verdict.format_text(assessed)}" + (f"\n{monitor.format_text()}" if monitor else ""),
        json,
    )
    if result.failsafes:
        raise UnsuccessfulError("; ".join(result.failsafes))


def _check_simulation(vehicle: str, scenario: str) -> "Symptom | None":
    """Return the symptom of a vehicle that does not float in the scenario.

    The telemetry does not show it: the dive ends with disarming. Raises InputError if vehicle or
    scenario cannot be simulated.
    """
    from ground.campaign import prototype, readiness
    from ground.client.dive_symptoms import Symptom, SymptomKind
    from sysid import prior_knowledge

    prototype.check_flown(vehicle)
    known = prior_knowledge.vehicle_file(prototype.prior_file_of(vehicle))
    heavy = readiness.find_heaviness(readiness.scenario_content(scenario), known)
    return heavy and Symptom(SymptomKind.HEAVY, "", heavy.cause, heavy.remedy)


def _parameters(
    params: Path | None, gains_file: Path | None, simulated: str | None
) -> dict[str, float]:
    """Return the parameters to set before the dive.

    They are the values of the files. Without a parameter file, a simulated vehicle other than
    Caribou gets gains designed from its vehicle file.
    """
    from ground.client import param_file

    parameters: dict[str, float] = {}
    if params:
        parameters = param_file.load(params)
    elif simulated:
        from ground.campaign import prototype

        parameters = prototype.first_dive_parameters(simulated)
    return {**parameters, **(param_file.load(gains_file) if gains_file else {})}


def _with_trim_learning(dive: "Dive", vehicle: str) -> "Dive":
    """Return the dive with the parameters by which a simulated vehicle learns its trims."""
    from ground.campaign import prototype

    return replace(dive, parameters={**prototype.trim_learning_for(vehicle), **dive.parameters})


def _prior_file(simulated: str | None) -> str:
    """Return the vehicle file that is known of a vehicle before any test."""
    if simulated is None:
        return "caribou_nominal"
    from ground.campaign import prototype

    return prototype.prior_file_of(simulated)


def _has_tests(dive: "Dive") -> bool:
    """Return whether the mission holds tests: they need constant trims."""
    return any(item.command == MavCmd.USER_1 for item in dive.items)


def _live_estimate(dive: "Dive", prior: str, display: "ProgressDisplay") -> "LiveSession | None":
    """Return the live estimate of the vehicle's dynamics; None on a dive without tests."""
    if not _has_tests(dive):
        return None
    from ground.live.session import LiveSession

    return LiveSession(prior, None, display.print_line)


def _live_feed(page: "PageProcess", dive: "Dive", estimate: "LiveSession | None") -> "DiveFeed":
    """Return the listener that sends the dive to the live page."""
    from ground.live.page.feed import DiveFeed

    name = Path(dive.mission).stem
    return DiveFeed(page, name, dive.items, estimate.panel if estimate else None)


def _performance_monitor(gains_file: Path, display: "ProgressDisplay") -> "PerformanceMonitor":
    """Return a monitor of the performance predicted in a gains file. Raises InputError."""
    from ground.client import param_file
    from ground.live.performance_monitor import PerformanceMonitor

    return PerformanceMonitor(param_file.require_baseline(gains_file), display.print_line)
