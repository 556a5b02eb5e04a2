"""Cost of a sweep: CPU time of a dive, overhead of chunks, throughput on one and two processes.

    python -m benchmarks.sweep                     # overhead; also on a loaded machine
    python -m benchmarks.sweep --throughput 3000   # and dives per minute; on an idle machine only
    python -m benchmarks.sweep --throughput 3000 --dask   # the same on a local dask cluster

The overhead is CPU time over that of flight and metrics: what a worker spends on a chunk besides
(measured with a flight that returns at once), and what the process of the sweep spends (key,
pickle, part).

The efficiency is measured beside the machine's own limit: one program, then two at once, that fly
dives without a sweep. Cores that share caches, memory and clock do not reach twice the speed.
"""

import argparse
import math
import pickle
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from importlib import import_module
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

from ground.missions import plans
from ground.sweep import engine as engines
from sitl.vehicle import config as vehicle_files
from sysid.models.parameters import CandidateVehicle
from sysid.monte_carlo import metrics, samples, simulate
from sysid.monte_carlo.metrics import DiveMetrics
from sysid.monte_carlo.simulate import Sea
from sysid.sweep import dives, gains
from sysid.sweep.campaigns import SweepMission
from sysid.sweep.dives import Part, SweepDive, fly_chunk
from sysid.sweep.parts import PartStore
from sysid.sweep.points import ParameterRange
from sysid.sweep.sweep_request import Chunks, SweepRequest, SweepVehicle
from sysid.test_design import prior as design_priors
from sysid.trials import Engine, key_of, map_trials

SPREAD = 0.2
"""Factor on the standard deviations of the first-principles vehicle: as after a refit."""
ROUNDS = 5
"""Number of repetitions; the least time counts."""
SIZES = (1, 8, 64)
"""Numbers of dives in a chunk."""
LIMIT_DIVES = 160
"""Number of dives of each program that measures the machine's limit."""


class ChunkCost(NamedTuple):
    """CPU time (s) and size (bytes) of a chunk."""

    bare_s: float
    """Flight and metrics."""
    worker_s: float
    """Everything else that a worker does, with the building of vehicles and pickling."""
    sweep_s: float
    """Everything that the process of the sweep does for it."""
    sent: int
    received: int


def request_of(count: int, chunk: int) -> SweepRequest:
    """Return a sweep of 150 s dives, each of another vehicle."""
    prior = design_priors.with_trim(
        design_priors.from_file(vehicle_files.load("caribou_nominal")),
        math.radians(6.0),
        math.radians(0.4),
    )
    trims = samples.trims_deg(prior.vehicle(prior.mean))
    return SweepRequest(
        name="plan.toml",
        vehicles=(SweepVehicle("caribou", prior, SPREAD, (gains.read("default", {}, trims),)),),
        missions=(SweepMission("combined", plans.load_items("combined")),),
        conditions={
            "disturbance_scale": ParameterRange(0.5, 2.0),
            "current_mps": ParameterRange(0.0, 0.3),
        },
        samples=count,
        chunk=chunk,
    )


def measure_chunk(size: int, folder: Path) -> ChunkCost:
    """Return the cost of a chunk of this size."""
    (chunk,) = chunks = Chunks(request_of(size, size))
    store = PartStore(folder)
    store.prepare([])
    part = fly_chunk(chunk)

    flights = [(dive, dive.prior.vehicle(dive.z)) for dive in chunk.dives]

    def bare() -> list[DiveMetrics]:
        """Fly and evaluate the dives, without anything else."""
        return [fly(dive, vehicle) for dive, vehicle in flights]

    sent, received = pickle.dumps((fly_chunk, chunk)), pickle.dumps(part)

    def worker() -> None:
        """Do what a worker does."""
        function, value = pickle.loads(sent)
        pickle.dumps(function(value))

    def sweep() -> None:
        """Do what the process of the sweep does."""
        key = key_of(fly_chunk, chunks[0])
        pickle.dumps((fly_chunk, chunks[0]))
        store.add(key, pickle.loads(received))

    bare_s = _cpu_s(bare)
    ended = bare()[0]
    with patch.object(dives, "_fly", lambda *_: ended):
        worker_s = _cpu_s(worker)
    sweep_s = _cpu_s(sweep)
    return ChunkCost(bare_s, worker_s, sweep_s, len(sent), len(received))


def fly(dive: SweepDive, vehicle: CandidateVehicle) -> DiveMetrics:
    """Return the metrics of a dive without faults."""
    sea = Sea(dive.conditions.disturbance_scale, dive.conditions.current_mps)
    seed, settings = (dive.seed, dive.sample, dive.repeat), dive.gains.config
    flown = simulate.fly(vehicle, dive.prior.noise, dive.mission.items, settings, sea, seed)
    return metrics.of_dive(flown, settings.travel_rad, vehicle.model.hydrostatics.radius_m)


def _cpu_s(work: Callable[[], object]) -> float:
    """Return the least CPU time of a function (s)."""
    times = []
    for _ in range(ROUNDS):
        start_s = time.process_time()
        work()
        times.append(time.process_time() - start_s)
    return min(times)


def dives_per_minute(count: int, jobs: int, folder: Path, *, dask: bool) -> float:
    """Return the throughput of a sweep, with the start of local processes, not of a cluster."""
    with cluster(jobs) if dask else nullcontext() as engine:
        start_s = time.monotonic()
        keep = PartStore(folder)
        map_trials(
            fly_chunk, Chunks(request_of(count, 8)), Part, jobs=jobs, keep=keep, engine=engine
        )
        return 60.0 * count / (time.monotonic() - start_s)


def limit() -> float:
    """Return the speed of two programs at once over twice that of one; all fly the same dives."""
    alone_s, together_s = (max(_programs_s(count)) for count in (1, 2))
    return alone_s / together_s


def _programs_s(count: int) -> list[float]:
    """Return the time (s) of each of several programs that fly `LIMIT_DIVES` dives at once."""
    words = [sys.executable, "-m", "benchmarks.sweep", "--fly", str(LIMIT_DIVES)]
    with ExitStack() as stack:
        programs = [
            stack.enter_context(
                subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
            )
            for _ in range(count)
        ]
        pipes = [(p.stdin, p.stdout) for p in programs if p.stdin and p.stdout]
        for _, output in pipes:
            output.readline()  # until it is ready
        for started, _ in pipes:
            started.write("\n")
            started.flush()
        return [float(output.readline()) for _, output in pipes]


def _fly_on_request(count: int) -> None:
    """Print a line when ready, wait for one, fly dives, and print the time of the flights (s)."""
    chunks = Chunks(request_of(count, 8))
    fly_chunk(chunks[0])
    print("ready", flush=True)
    sys.stdin.readline()
    start_s = time.monotonic()
    for chunk in chunks:
        fly_chunk(chunk)
    print(time.monotonic() - start_s, flush=True)


@contextmanager
def cluster(workers: int) -> Iterator[Engine | None]:
    """Start a local dask cluster whose workers have flown a dive, and return its engine."""
    distributed = import_module("distributed")
    options = {"n_workers": workers, "threads_per_worker": 1, "dashboard_address": None}
    with (
        distributed.LocalCluster(**options) as local,
        distributed.Client(local.scheduler_address, set_as_default=False) as client,
    ):
        client.run(fly_chunk, Chunks(request_of(1, 1))[0])
        yield engines.parse(f"dask={local.scheduler_address}")


def main() -> None:
    """Print the figures."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--throughput", type=int, default=0, metavar="DIVES")
    options.add_argument("--dask", action="store_true")
    options.add_argument("--fly", type=int, metavar="DIVES", help=argparse.SUPPRESS)
    asked = options.parse_args()
    if asked.fly:
        _fly_on_request(asked.fly)
        return
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for size in SIZES:
            cost = measure_chunk(size, folder / str(size))
            extra_s = cost.worker_s + cost.sweep_s
            print(
                f"chunk of {size}: {1e3 * cost.bare_s / size:.2f} ms CPU a dive; overhead"
                f" {100.0 * extra_s / cost.bare_s:.2f} %: worker"
                f" {1e3 * cost.worker_s:.2f} ms, sweep {1e3 * cost.sweep_s:.2f} ms"
                f" a chunk; {cost.sent} bytes sent, {cost.received} received",
                flush=True,
            )
        rates = [
            dives_per_minute(asked.throughput, jobs, folder / f"jobs-{jobs}", dask=asked.dask)
            for jobs in (1, 2)
            if asked.throughput
        ]
        for jobs, rate in enumerate(rates, 1):
            print(f"{jobs} processes: {rate:.0f} dives a minute")
        if rates:
            efficiency, most = rates[1] / (2.0 * rates[0]), limit()
            print(f"efficiency 1 -> 2: {efficiency:.3f}")
            print(f"two independent programs: {most:.3f}; of that {efficiency / most:.3f}")


if __name__ == "__main__":
    main()
