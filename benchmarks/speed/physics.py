"""Run time of one Runge-Kutta step of the six-degree-of-freedom vehicle, compared with two others.

The others are the same equations in C (physics.c), compiled with ``cc -O3`` for a generic and for
this processor, and one Euler step of the REMUS 100 of Fossen's PythonVehicleSimulator if a checkout
is given (https://github.com/cybergalactic/PythonVehicleSimulator).
"""

import ctypes
import importlib
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

from benchmarks.speed.results import Measurement, Reference
from benchmarks.speed.session import Session
from mavlink_io.errors import OperationError
from sitl.vehicle import build_model, config, dynamics
from sitl.vehicle.model import VehicleModel
from sitl.vehicle.vectors import Vector
from sitl.vehicle.water import STILL, Water

STEP_S = 0.005
STEPS = 2_000
PEER_STEPS = 20
ROUNDS = 80
"""Rounds of a repetition; the shortest counts."""
RUDDER_RAD, ELEVATOR_RAD = 0.1, -0.05
SHALLOW = Water(
    velocity_mps=(0.3, -0.1, 0.0),
    acceleration_mps2=(0.02, 0.0, 0.01),
    slope_per_s=(0.0, 0.01, 0.0),
    slope_rate_per_s2=(0.0, 0.0, 0.01),
    density_ratio=1.01,
    surface_m=0.1,
    surface_slope=0.02,
    ceiling_m=-0.35,
    floor_m=-2.0,
)
"""Water with all effects, including contact with ice; the timing uses deep, still water."""
VEHICLE = "caribou_truth"
"""Vehicle of the timing; the states of all are compared."""
VEHICLES = (VEHICLE, "caribou_nominal", "remus100", "xfin_auv")
UNCOUPLED = (0.0, 0.3)
"""Shares of crossflow drag in which drift does not damp rotation."""
DEEP_M = -500.0
SAME = 1e-9
"""Largest difference of states: compilers round differently, and contact with ice is stiff."""
GENERIC = "C -O3"
COMPILED = {GENERIC: ("-O3",), "C -O3 -march=native": ("-O3", "-march=native")}
CARIBOU, PVS = "caribou", "PythonVehicleSimulator"


class Array(ctypes.Structure):
    """A numpy array as a C structure."""

    _fields_ = (("at", ctypes.POINTER(ctypes.c_double)), ("count", ctypes.c_long))


def mirrored(value: Any) -> Any:
    """Convert a tree of NamedTuples, floats and arrays to C structures of the same layout."""
    if isinstance(value, np.ndarray):
        flat = np.ascontiguousarray(value, float)
        twin = Array(flat.ctypes.data_as(ctypes.POINTER(ctypes.c_double)), len(flat))
        twin.keep = flat
        return twin
    if not isinstance(value, tuple):
        return ctypes.c_double(value)
    parts = [mirrored(part) for part in value]
    names = getattr(value, "_fields", tuple(f"_{i}" for i in range(len(value))))
    kind = type(
        "Mirrored",
        (ctypes.Structure,),
        {"_fields_": [(n, type(p)) for n, p in zip(names, parts, strict=True)]},
    )
    twin = kind(*parts)
    twin.keep = parts
    return twin


@njit(cache=False)
def fly(
    state: Vector,
    steps: int,
    rudder_rad: float,
    elevator_rad: float,
    shaft_rps: float,
    push: Vector,
    water: Water,
    dt: float,
    model: VehicleModel,
    work: Vector,
) -> None:
    """Integrate a number of steps with constant inputs."""
    for _ in range(steps):
        dynamics.rk4_step(state, rudder_rad, elevator_rad, shaft_rps, push, water, dt, model, work)


def start(z_up_m: float) -> Vector:
    """Return a state that turns and climbs."""
    state = dynamics.state_at_rest(z_up_m)
    state[dynamics.NU] = 1.2, 0.05, -0.04, 0.02, 0.03, -0.05
    return state


def model_of(vehicle: str, uncoupled: float = 0.0) -> VehicleModel:
    """Return the model of a vehicle, with a share of uncoupled crossflow drag."""
    model = build_model.build(config.load(vehicle))
    return model._replace(stations=model.stations._replace(uncoupled=uncoupled))


def in_numba(
    model: VehicleModel, water: Water, z_up_m: float, step_s: float = STEP_S
) -> Callable[[int], Vector]:
    """Return a function that runs the compiled Python model and returns the final state."""
    push, work = np.zeros(6), dynamics.work_array()
    shaft_rps = 0.58 * model.propeller.full_rps

    def run(steps: int) -> Vector:
        state = start(z_up_m)
        fly(state, steps, RUDDER_RAD, ELEVATOR_RAD, shaft_rps, push, water, step_s, model, work)
        return state

    return run


def compiled(flags: tuple[str, ...], folder: Path) -> Path:
    """Compile physics.c with the flags and return the library. Raises OperationError."""
    library = folder / f"physics{''.join(flags)}.so"
    compiler = shutil.which("cc")
    if compiler is None:
        raise OperationError("physics-step: no C compiler (cc) on the path")
    source = Path(__file__).with_name("physics.c")
    command = [compiler, *flags, "-shared", "-fPIC", "-o", str(library), str(source), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        reason = (done.stderr.strip().splitlines() or ["failed"])[0]
        raise OperationError(f"physics-step: {compiler}: {reason}")
    return library


def in_c(
    library: Path, model: VehicleModel, water: Water, z_up_m: float
) -> Callable[[int], Vector]:
    """Return a function that runs the C model and returns the final state.

    Raises OperationError if the structures of the library have other sizes.
    """
    functions = ctypes.CDLL(str(library))
    entry = functions.fly
    entry.restype = None
    shaft_rps, push = 0.58 * model.propeller.full_rps, np.zeros(6)
    c_model, c_water, double = mirrored(model), mirrored(water), ctypes.c_double
    sizes = [ctypes.sizeof(c_model), ctypes.sizeof(c_water)]
    if sizes != list((ctypes.c_long * 2).in_dll(functions, "sizes")):
        raise OperationError(
            "physics-step: the structures of physics.c are not those of sitl/vehicle/model.py and"
            " water.py"
        )

    def run(steps: int) -> Vector:
        """Return the state after some steps."""
        state = start(z_up_m)
        entry(
            state.ctypes,
            ctypes.c_long(steps),
            double(RUDDER_RAD),
            double(ELEVATOR_RAD),
            double(shaft_rps),
            push.ctypes,
            ctypes.byref(c_water),
            double(STEP_S),
            ctypes.byref(c_model),
        )
        return state

    return run


def of_peer(checkout: Path) -> Callable[[int], Vector]:
    """Return a function that runs Fossen's REMUS 100 with constant inputs and Euler steps."""
    sys.path.insert(0, str(checkout / "src"))
    peer = importlib.import_module("python_vehicle_simulator.vehicles.remus100").remus100()
    attitude = importlib.import_module("python_vehicle_simulator.lib.gnc").attitudeEuler

    def run(steps: int) -> Vector:
        """Return position and attitude after some steps."""
        eta, nu, actual = (
            np.zeros(6),
            np.array([1.5, 0, 0, 0, 0, 0], float),
            np.array([0.0, 0.0, 1200.0]),
        )
        command = np.array([RUDDER_RAD, ELEVATOR_RAD, 1200.0])
        for _ in range(steps):
            nu, actual = peer.dynamics(eta, nu, actual, command, STEP_S)
            eta = attitude(eta, nu, STEP_S)
        return eta

    return run


def microseconds(run: Callable[[int], Vector], steps: int) -> float:
    """Return the time per step."""
    began_s = time.perf_counter()
    run(steps)
    return 1e6 * (time.perf_counter() - began_s) / steps


def max_difference(libraries: Iterable[Path]) -> float:
    """Return the largest difference of states between Python and C, in deep and shallow water."""
    runs = [
        (model_of(name, uncoupled), water, z_up_m)
        for name in VEHICLES
        for uncoupled in UNCOUPLED
        for water, z_up_m in ((STILL, DEEP_M), (SHALLOW, -0.4))
    ]
    return max(
        float(np.abs(in_numba(*run)(steps) - in_c(library, *run)(steps)).max())
        for run in runs
        for library in libraries
        for steps in (1, 10, 100)
    )


def kernel_cpu_s(vehicle_s: float, step_s: float) -> float:
    """Return the processor time (s) of the physics alone for a vehicle time.

    The shortest of several rounds of the compiled loop counts.
    """
    run = in_numba(model_of(VEHICLE), STILL, DEEP_M, step_s)
    run(1)
    return vehicle_s / step_s * min(microseconds(run, STEPS) for _ in range(10)) / 1e6


def measure(session: Session) -> list[Measurement]:
    """Measure `physics-step`, after a check that Python and C give the same states."""
    with tempfile.TemporaryDirectory() as folder:
        libraries = {name: compiled(flags, Path(folder)) for name, flags in COMPILED.items()}
        difference = max_difference(libraries.values())
        if not difference < SAME:
            raise OperationError(
                f"physics-step: physics.c and the Python model differ: states by {difference:.2g}"
            )
        contestants = _contestants(libraries, session.peer)
        for run, _ in contestants.values():
            run(1)
        least = [_round(contestants) for _ in range(session.repetitions("physics-step"))]
    session.report(f"physics-step: {least[-1][CARIBOU]:.3f} us; C -O3 {least[-1][GENERIC]:.3f} us")
    return [
        Measurement(
            "physics-step",
            tuple(each[CARIBOU] for each in least),
            Reference(GENERIC, tuple(each[GENERIC] for each in least)),
            details={
                name: min(each[name] for each in least) for name in contestants if name != CARIBOU
            },
        )
    ]


def _contestants(
    libraries: dict[str, Path], peer: Path | None
) -> dict[str, tuple[Callable[[int], Vector], int]]:
    """Return each program with the number of steps of a round."""
    deep = model_of(VEHICLE), STILL, DEEP_M
    contestants = {CARIBOU: (in_numba(*deep), STEPS)}
    contestants |= {name: (in_c(library, *deep), STEPS) for name, library in libraries.items()}
    return contestants | ({PVS: (of_peer(peer), PEER_STEPS)} if peer else {})


def _round(contestants: dict[str, tuple[Callable[[int], Vector], int]]) -> dict[str, float]:
    """Return the shortest time of a step (us) of each program in alternating rounds."""
    rounds = [
        {name: microseconds(*contestant) for name, contestant in contestants.items()}
        for _ in range(ROUNDS)
    ]
    return {name: min(each[name] for each in rounds) for name in contestants}
