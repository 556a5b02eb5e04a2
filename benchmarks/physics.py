"""What one Runge-Kutta step of the six-degree-of-freedom vehicle costs, beside two others, in one run on one machine.

The same equations in C (benchmarks/physics.c), compiled with ``cc -O3`` for any machine of the kind and for this one,
and one Euler step of the REMUS 100 of Fossen's PythonVehicleSimulator, when a checkout of it is given
(https://github.com/cybergalactic/PythonVehicleSimulator). Rounds alternate between the contestants.

    python benchmarks/physics.py [--peer CHECKOUT] [--vehicle NAME|FILE] [--rounds N]
"""

import argparse
import ctypes
import importlib
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

from sitl.vehicle import calibrate, config, dynamics
from sitl.vehicle.kernel import Vector
from sitl.vehicle.water import STILL

STEP_S = 0.005
STEPS = 40_000
PEER_STEPS = 2_000
RUDDER_RAD, ELEVATOR_RAD = 0.1, -0.05
COMPILED = {"C -O3": ("-O3",), "C -O3 -march=native": ("-O3", "-march=native")}


class Array(ctypes.Structure):
    """A numpy array as C sees it."""

    _fields_ = (("at", ctypes.POINTER(ctypes.c_double)), ("count", ctypes.c_long))


def mirrored(value: Any) -> Any:
    """A tree of NamedTuples, floats and arrays as C structures of the same layout."""
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
        "Mirrored", (ctypes.Structure,), {"_fields_": [(n, type(p)) for n, p in zip(names, parts, strict=True)]}
    )
    twin = kind(*parts)
    twin.keep = parts
    return twin


@njit(cache=False)
def fly(state, steps, rudder_rad, elevator_rad, shaft_rps, push, water, dt, model, work):
    for _ in range(steps):
        dynamics.rk4_step(state, rudder_rad, elevator_rad, shaft_rps, push, water, dt, model, work)


def start() -> Vector:
    """Deep, turning and climbing: every term at work."""
    state = dynamics.state_at_rest(-500.0)
    state[dynamics.NU] = 1.2, 0.05, -0.04, 0.02, 0.03, -0.05
    return state


def in_numba(vehicle: str) -> Callable[[int], Vector]:
    model, push, work = calibrate.build(config.load(vehicle)), np.zeros(6), dynamics.work_array()
    shaft_rps = 0.58 * model.propeller.full_rps

    def run(steps: int) -> Vector:
        state = start()
        fly(state, steps, RUDDER_RAD, ELEVATOR_RAD, shaft_rps, push, STILL, STEP_S, model, work)
        return state

    return run


def in_c(vehicle: str, flags: tuple[str, ...], folder: Path) -> Callable[[int], Vector]:
    library = folder / f"physics{''.join(flags)}.so"
    compiler = shutil.which("cc") or sys.exit("benchmarks/physics.py: no C compiler (cc) on the path")
    source = Path(__file__).with_name("physics.c")
    subprocess.run([compiler, *flags, "-shared", "-fPIC", "-o", library, source, "-lm"], check=True)
    entry = ctypes.CDLL(str(library)).fly
    entry.restype = None
    model = calibrate.build(config.load(vehicle))
    shaft_rps, push = 0.58 * model.propeller.full_rps, np.zeros(6)
    c_model, c_water, double = mirrored(model), mirrored(STILL), ctypes.c_double

    def run(steps: int) -> Vector:
        state = start()
        entry(
            state.ctypes, ctypes.c_long(steps), double(RUDDER_RAD), double(ELEVATOR_RAD), double(shaft_rps),
            push.ctypes, ctypes.byref(c_water), double(STEP_S), ctypes.byref(c_model),
        )  # fmt: skip
        return state

    return run


def of_peer(checkout: Path) -> Callable[[int], Vector]:
    """Fossen's REMUS 100 with constant inputs: its ``dynamics`` and the attitude's Euler step."""
    sys.path.insert(0, str(checkout / "src"))
    peer = importlib.import_module("python_vehicle_simulator.vehicles.remus100").remus100()
    attitude = importlib.import_module("python_vehicle_simulator.lib.gnc").attitudeEuler

    def run(steps: int) -> Vector:
        eta, nu, actual = np.zeros(6), np.array([1.5, 0, 0, 0, 0, 0], float), np.array([0.0, 0.0, 1200.0])
        command = np.array([RUDDER_RAD, ELEVATOR_RAD, 1200.0])
        for _ in range(steps):
            nu, actual = peer.dynamics(eta, nu, actual, command, STEP_S)
            eta = attitude(eta, nu, STEP_S)
        return eta

    return run


def microseconds(run: Callable[[int], Vector], steps: int) -> float:
    began_s = time.perf_counter()
    run(steps)
    return 1e6 * (time.perf_counter() - began_s) / steps


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vehicle", default="field")
    parser.add_argument("--peer", type=Path, help="checkout of PythonVehicleSimulator")
    parser.add_argument("--rounds", type=int, default=9)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        ours = in_numba(asked.vehicle)
        theirs = {name: in_c(asked.vehicle, flags, Path(folder)) for name, flags in COMPILED.items()}
        apart = max(float(np.abs(ours(2_000) - run(2_000)).max()) for run in theirs.values())
        if not apart < 1e-9:
            sys.exit(f"benchmarks/physics.py: physics.c is no longer the same vehicle: states differ by {apart:.2g}")
        contestants = {"caribou": (ours, STEPS)} | {name: (run, STEPS) for name, run in theirs.items()}
        if asked.peer:
            contestants["PythonVehicleSimulator"] = (of_peer(asked.peer), PEER_STEPS)
        rounds = [{name: microseconds(*of) for name, of in contestants.items()} for _ in range(asked.rounds)]
    medians = {name: statistics.median(each[name] for each in rounds) for name in contestants}
    for name, cost in medians.items():
        sys.stdout.write(f"{name:24}{cost:10.3f} us a step\n")
    sys.stdout.write(f"states after 2000 steps differ by {apart:.1e}\n")
    for name in list(contestants)[1:]:
        ratio = statistics.median(each["caribou"] / each[name] for each in rounds)
        sys.stdout.write(f"caribou / {name}: {ratio:.4g} (1 / {1 / ratio:.4g})\n")


if __name__ == "__main__":
    main()
