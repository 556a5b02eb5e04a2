"""`ground inclining-test`: measure the height of the centre of mass."""

from pathlib import Path
from typing import Annotated

import typer

from ground.cli.options import (
    BenchAddress,
    Json,
    Seed,
    Sign,
    Speed,
    VehicleId,
    VehicleName,
    print_result,
    refuse_empty,
    refuse_unused_of_bench,
)
from ground.output_files import new_file


def inclining_test(
    context: typer.Context,
    connect: BenchAddress = None,
    sign: Sign = None,
    vehicle_id: VehicleId = None,
    vehicle: VehicleName = "caribou_truth",
    moves: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.toml", help="Masses and lever arms. Default: moves of 1 and 2 kg."
        ),
    ] = None,
    prior: Annotated[
        str | None,
        typer.Option(
            callback=refuse_empty,
            metavar="NAME|FILE",
            help="Source of mass and centre of buoyancy: caribou_nominal, or a vehicle file."
            " Default: the simulated vehicle, else caribou_nominal.",
        ),
    ] = None,
    seed: Seed = 1,
    speed: Speed = "max",
    log: Annotated[Path, typer.Option(metavar="FILE.mcap", help="Log to write.")] = Path(
        "incline.mcap"
    ),
    json: Json = False,
) -> None:
    """Measure the height of the centre of mass from the heel that known weights cause.

    The vehicle floats without thrust; a person moves the weights as announced.
    """
    from ground.bench_tests import incline as procedure
    from ground.campaign import prototype, refit
    from ground.cli import progress
    from ground.simulation.processes import SimulatedVehicle, Simulation

    plan = procedure.load(moves)
    refuse_unused_of_bench(context, connect)
    if connect is None:
        prototype.check_flown(vehicle)
    if prior is None:
        prior = "caribou_nominal" if connect else prototype.prior_file_of(vehicle)
    session = procedure.IncliningSession(plan=plan, log=new_file(log), prior=prior)
    with progress.display("incline") as display:
        target = connect or SimulatedVehicle(
            Simulation(vehicle=vehicle, scenario="inclining", seed=seed, speed=speed),
            notify=display.print_line,
        )
        measured = procedure.measure(
            session,
            target,
            display.watch,
            display.announce,
            key_file=sign,
            system=vehicle_id,
            on_remark=display.print_line,
        )
    result = procedure.as_json(measured, prior, refit.read_vehicle(prior).linear.z_CM_m)
    print_result(result, procedure.format_text(result, log), json)
