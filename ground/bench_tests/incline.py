"""Inclining test: weights are moved across a floating vehicle, and its heel is measured."""

from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from ground.bench_tests import bench
from ground.campaign import refit
from ground.client import flight
from ground.client.flight import FlightProgress
from ground.simulation.processes import SimulatedVehicle
from mavlink_io import toml_io
from mavlink_io.clock import wall_s
from mavlink_io.errors import InputError
from mavlink_io.text_files import read_text
from sysid.data import readers
from sysid.data.dataset import LogError
from sysid.estimation import inclining_test
from sysid.estimation.inclining_test import Inclining, WeightPeriod

SHIPPED = files("ground.bench_tests") / "inclining.toml"
MAX_MASS_KG, MAX_OFFSET_M = 1000.0, 10.0
"""Limits of a weight and of its lever arm."""


class WeightMove(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A weight and its distance from the centre plane; zero for no weight."""

    mass_kg: float = 0.0
    to_port_m: float = 0.0

    def format_text(self) -> str:
        """Return the instruction for the person at the vehicle."""
        if not self.mass_kg * self.to_port_m:
            return "all weights amidships"
        side = "port" if self.to_port_m > 0.0 else "starboard"
        return f"{self.mass_kg:g} kg by {abs(self.to_port_m):g} m to {side}"


class IncliningPlan(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A list of weight positions, each held for `duration_s`."""

    duration_s: float
    move: tuple[WeightMove, ...]

    def dated(self) -> list[WeightPeriod]:
        """Return the moment (kg m, positive to port) of each move with its time since arming."""
        span = self.duration_s
        return [
            WeightPeriod(m.mass_kg * m.to_port_m, n * span, (n + 1) * span)
            for n, m in enumerate(self.move)
        ]


def load(path: Path | None) -> IncliningPlan:
    """Read a list of moves; None selects the shipped one. Raises InputError."""
    source = path or SHIPPED
    try:
        plan = toml_io.decode(read_text(source), IncliningPlan, f"--moves {path}", InputError)
    except OSError as error:
        raise InputError(
            f"--moves {path}: {error.strerror}; give a TOML file of [[move]] tables"
        ) from None
    except UnicodeDecodeError as error:
        raise InputError(f"--moves {path}: {error}") from None
    if not 10.0 <= plan.duration_s <= 600.0:
        raise InputError(f"--moves {path}: duration_s = {plan.duration_s:g}: expected 10 to 600")
    for number, move in enumerate(plan.move, start=1):
        if not (0.0 <= move.mass_kg <= MAX_MASS_KG and abs(move.to_port_m) <= MAX_OFFSET_M):
            raise InputError(
                f"--moves {path}: move {number}: mass_kg = {move.mass_kg:g}, to_port_m ="
                f" {move.to_port_m:g}: expected 0 to {MAX_MASS_KG:g} kg, at most {MAX_OFFSET_M:g} m"
                " to either side"
            )
    if len(plan.move) < 3 or len({move.mass_kg * move.to_port_m for move in plan.move}) < 2:
        raise InputError(
            f"--moves {path}: move: expected at least three, with at least two different moments"
        )
    return plan


class IncliningSession(NamedTuple):
    """An inclining test to run."""

    plan: IncliningPlan
    """Moves of the weights."""
    log: Path
    """Log to write."""
    prior: str
    """Vehicle file with mass and centre of buoyancy."""


def measure(
    session: IncliningSession,
    target: str | SimulatedVehicle,
    watch: Callable[[FlightProgress], None],
    announce: Callable[[str], None],
    key_file: Path | None = None,
    system: int | None = None,
    on_remark: Callable[[str], None] | None = None,
) -> Inclining:
    """Run the test and return the height of the centre of mass.

    Parameters
    ----------
    session : IncliningSession
        Moves, log and vehicle file.
    target : str or SimulatedVehicle
        Address of a vehicle, or a simulated vehicle.
    watch, announce : Callable
        Called with the progress, and with the instruction for each move.
    key_file : Path, optional
        Key with which the link is signed.
    system : int, optional
        System id of the vehicle, where several are on the link.
    on_remark : Callable, optional
        Receives what is awaited before the test: the vehicle, or its sensors.

    Raises
    ------
    AddressError, InputError, OperationError
        The vehicle was not found or refused, or the data allow no estimate.
    """
    plan, vehicle_file = session.plan, refit.read_vehicle(session.prior)
    with flight.open_recorded_vehicle(
        target, session.log, key_file=key_file, system=system, on_remark=on_remark
    ) as (
        vehicle,
        recorder,
    ):
        vehicle.connect()
        with bench.armed_without_thrust(vehicle) as before:
            recorder.attach_parameters(before | bench.PARAMETERS)
            start_s, armed_s = wall_s(), recorder.vehicle_s
            for number, move in enumerate(plan.move):
                announce(move.format_text())
                watch(
                    FlightProgress(
                        item=number,
                        items=len(plan.move),
                        vehicle_s=recorder.vehicle_s - armed_s,
                        wall_s=wall_s() - start_s,
                        depth_m=0.0,
                        heading_deg=0.0,
                    )
                )
                bench.listen_until(vehicle, recorder, armed_s + (number + 1) * plan.duration_s)
    try:
        return inclining_test.analyse(readers.read(session.log), plan.dated(), vehicle_file)
    except LogError as error:
        raise inclining_test.InclineError(str(error)) from None


def as_json(measured: Inclining, prior: str, file_z_cm_m: float) -> dict[str, Any]:
    """Return the result and the value in the vehicle file as plain numbers."""
    return {
        "z_cm_m": {"value": measured.z_cm_m.value, "sd": measured.z_cm_m.sd},
        "height_m": {"value": measured.height_m.value, "sd": measured.height_m.sd},
        "list_deg": measured.list_deg,
        "file": prior,
        "file_z_cm_m": file_z_cm_m,
        "readings": [reading._asdict() for reading in measured.readings],
    }


def format_text(result: dict[str, Any], log: Path) -> str:
    """Return the result as a table."""
    lines = ["to port, kg m   heel to starboard, deg   fitted"]
    lines += [
        f"{r['moment_kgm']:13.3f} {r['roll_deg']:24.3f} {r['fitted_deg']:8.3f}"
        for r in result["readings"]
    ]
    z_cm, file = result["z_cm_m"], result["file"]
    lines += [
        f"z_CM = {z_cm['value']:.5f} +- {z_cm['sd']:.5f} m; the file {file} has"
        f" {result['file_z_cm_m']:g}"
    ]
    return "\n".join([*lines, str(log)])
