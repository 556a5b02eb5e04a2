"""`ground bench-test`: measure the frequency response of the tailcone on the bench."""

from contextlib import suppress
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
    refuse_unused_of_bench,
    to_json,
)
from mavlink_io.errors import InputError
from mavlink_io.user_data_dir import write_output


def bench_test(
    context: typer.Context,
    connect: BenchAddress = None,
    sign: Sign = None,
    vehicle_id: VehicleId = None,
    vehicle: VehicleName = "caribou_truth",
    axis: Annotated[
        list[str] | None, typer.Option(help="rudder or elevator; repeatable. Default: both.")
    ] = None,
    amplitude: Annotated[
        list[float] | None,
        typer.Option(help="Amplitude, deg peak to peak; repeatable. Default: 5, 10, 20, 30."),
    ] = None,
    frequency: Annotated[
        list[float] | None,
        typer.Option(help="Frequency, Hz; repeatable. Default: ten from 0.05 to 1.5."),
    ] = None,
    seed: Seed = 1,
    speed: Speed = "max",
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="A new folder for log, result and figure.")
    ] = Path("bench"),
    json: Json = False,
) -> None:
    """Measure the tailcone on the bench: frequency responses, actuator model, limits.

    The duct moves during the test.
    """
    from ground.bench_tests import bench as procedure
    from ground.campaign import prototype
    from ground.cli import progress
    from ground.missions import signals
    from ground.simulation.processes import SimulatedVehicle, Simulation

    session = procedure.Session(
        folder=_new_folder(out),
        axes=tuple(axis or signals.AXES),
        amplitudes_deg=tuple(amplitude or procedure.AMPLITUDES_DEG),
        frequencies_hz=tuple(frequency or procedure.FREQUENCIES_HZ),
    )
    procedure.check(session)
    refuse_unused_of_bench(context, connect)
    if connect is None:
        prototype.check_flown(vehicle)
    out.mkdir()
    try:
        with progress.display("bench") as display:
            target = connect or SimulatedVehicle(
                Simulation(vehicle=vehicle, scenario="bench", seed=seed, speed=speed),
                notify=display.print_line,
            )
            measured = procedure.measure(
                session,
                target,
                display.watch,
                key_file=sign,
                system=vehicle_id,
                on_remark=display.print_line,
            )
    except BaseException:
        with suppress(OSError):  # not empty: what was recorded is kept
            out.rmdir()
        raise
    result = procedure.as_json(measured)
    write_output(out / "bench.json", to_json(result))

    from ground.report import bode

    bode.draw(measured, out / "figure4.png")
    print_result(result, procedure.format_text(result, out), json)


def _new_folder(path: Path) -> Path:
    """Return the path. Raises InputError if it exists or its parent does not."""
    if path.exists():
        raise InputError(f"--out {path}: exists; give a new folder")
    if not path.parent.is_dir():
        raise InputError(f"--out {path}: there is no folder {path.parent}")
    return path
