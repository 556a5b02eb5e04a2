"""The commands of the laboratory: ``ground bench`` and ``ground incline``."""

from pathlib import Path
from typing import Annotated

import typer

from ground.cli.options import (
    Json,
    Seed,
    Sign,
    Speed,
    VehicleName,
    new_file,
    print_result,
    to_json,
)
from ground.errors import InputError

BenchAddress = Annotated[
    str | None,
    typer.Option(
        "--connect",
        metavar="ADDRESS",
        help=(
            "A vehicle on a real bench: serial:DEVICE:BAUD, udpin:HOST:PORT, ... Default: a"
            " simulated one."
        ),
    ),
]


def bench(
    connect: BenchAddress = None,
    sign: Sign = None,
    vehicle: VehicleName = "caribou_truth",
    axis: Annotated[
        list[str] | None, typer.Option(help="rudder or elevator; repeatable. Default: both.")
    ] = None,
    amplitude: Annotated[
        list[float] | None, typer.Option(help="Degrees peak to peak; repeatable.")
    ] = None,
    frequency: Annotated[list[float] | None, typer.Option(help="Hertz; repeatable.")] = None,
    seed: Seed = 1,
    speed: Speed = "max",
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="A new folder for log, result and figure.")
    ] = Path("bench"),
    json: Json = False,
) -> None:
    """Sweep the tailcone on the bench: frequency responses, the fitted actuator, its limits. The
    duct will move."""
    from ground import progress
    from ground.bench_tests import bench as procedure
    from ground.missions import signals
    from ground.report import bode
    from ground.simulation.processes import SimulatedVehicle, Simulation

    session = procedure.Session(
        _new_folder(out),
        tuple(axis or signals.AXES),
        tuple(amplitude or procedure.AMPLITUDES_DEG),
        tuple(frequency or procedure.FREQUENCIES_HZ),
    )
    procedure.check(session)
    where = connect or SimulatedVehicle(Simulation(vehicle, "bench", seed, speed))
    out.mkdir()
    with progress.display("bench", quiet=json) as shown:
        found = procedure.measure(session, where, shown.watch, sign)
    result = procedure.as_json(found)
    (out / "bench.json").write_text(to_json(result), encoding="utf-8")
    bode.draw(found, out / "figure4.png")
    print_result(result, procedure.format_text(result, out), json)


def incline(
    connect: BenchAddress = None,
    sign: Sign = None,
    vehicle: VehicleName = "caribou_truth",
    moves: Annotated[
        Path | None, typer.Option(metavar="FILE.toml", help="Weights and levers; default: 1, 2 kg.")
    ] = None,
    prior: Annotated[
        str, typer.Option(help="bench, or the vehicle's file: mass and centre of buoyancy.")
    ] = "caribou_nominal",
    seed: Seed = 1,
    speed: Speed = "max",
    log: Annotated[Path, typer.Option(metavar="FILE.mcap")] = Path("incline.mcap"),
    json: Json = False,
) -> None:
    """Measure the height of the centre of mass: float her, move known weights, read the heel."""
    from ground import progress
    from ground.bench_tests import incline as procedure
    from ground.campaign import refit
    from ground.simulation.processes import SimulatedVehicle, Simulation

    plan = procedure.load(moves)
    where = connect or SimulatedVehicle(Simulation(vehicle, "inclining", seed, speed))
    with progress.display("incline", quiet=json) as shown:
        found = procedure.measure(
            plan, new_file(log), prior, where, shown.watch, shown.announce, sign
        )
    result = procedure.as_json(found, prior, refit.read_vehicle(prior).linear.z_CM_m)
    print_result(result, procedure.format_text(result, log), json)


def _new_folder(path: Path) -> Path:
    if path.exists():
        raise InputError(f"--out {path}: exists; give a new folder")
    if not path.parent.is_dir():
        raise InputError(f"--out {path}: there is no folder {path.parent}")
    return path
