"""Soak rows: simulated dives with faults, pairs of faults, extreme parameters, random missions."""

import math
from collections.abc import Callable, Mapping
from functools import partial

from benchmarks.safety import cases, deflection, flight
from benchmarks.safety.cases import Case
from tests.soak.row import LARGEST, Batch, Row

SEEDS, N_PAIRS, N_MISSIONS = 20, 2000, 1000
"""Full sizes: seeds of each fault and vehicle, pairs of faults, and random missions."""


def fault_case(number: int) -> Case:
    """Return a dive with one fault: all faults of a vehicle, then all vehicles, then all seeds."""
    names, vehicles = cases.catalogue_names(), cases.VEHICLES
    number, name = divmod(number, len(names))
    seed, vehicle = divmod(number, len(vehicles))
    return cases.single_fault(*names[name], vehicles[vehicle], seed)


def fly_cases(case_of: Callable[[int], Case], first: int, count: int) -> Batch:
    """Fly dives by number of the first and count."""
    batch = Batch()
    for number in range(first, first + count):
        case = case_of(number)
        _add(batch, number, case, flight.fly(case))
    return batch


def _add(batch: Batch, number: int, case: Case, outcome: flight.Outcome) -> None:
    """Add a dive to the counts."""
    batch.add("dives")
    batch.add(f"ending {outcome.ending}")
    batch.add("contacts", not math.isnan(outcome.contact_s))
    if reason := outcome.failure:
        batch.add(f"fails {reason}")
        batch.fail(number, f"{reason}: {cases.command(case)}")
    if not math.isnan(outcome.safe_s) and case.name.startswith("fault:"):
        fault = case.name.removeprefix("fault:")
        batch.add(f"safe {fault}")
        batch.add(f"safe s {fault}", outcome.safe_s)
        batch.add(f"{LARGEST}safe s {fault}", outcome.safe_s)


def describe(counts: Mapping[str, float]) -> str:
    """Return the result."""
    endings = ", ".join(
        f"{value:.0f} {name.removeprefix('ending ')}"
        for name, value in sorted(counts.items())
        if name.startswith("ending ")
    )
    failures = ", ".join(
        f"{value:.0f} {name.removeprefix('fails ')}"
        for name, value in sorted(counts.items())
        if name.startswith("fails ")
    )
    contacts = counts.get("contacts", 0.0)
    return (
        f"{counts.get('dives', 0):.0f} dives, {failures or '0 fail'}; endings: {endings};"
        f" {contacts:.0f} touch the floor"
    )


def times_to_safe(counts: Mapping[str, float]) -> list[str]:
    """Return the times from fault to disarming at the surface, one line for each fault."""
    lines = []
    for unit, kind in cases.catalogue_names():
        fault = f"{unit}-{kind}"
        if count := counts.get(f"safe {fault}"):
            mean_s = counts[f"safe s {fault}"] / count
            longest_s = counts[f"{LARGEST}safe s {fault}"]
            lines.append(f"{fault}: {count:.0f} afloat, mean {mean_s:.0f} s, max {longest_s:.0f} s")
    return ["time to safe:", *lines] if lines else []


def _row(title: str, full_size: int, case_of: Callable[[int], Case], requirement: str) -> Row:
    """Return a row of dives."""
    return Row(
        title=title,
        full_size=full_size,
        batch_size=10,
        run=partial(fly_cases, case_of),
        describe=describe,
        holds=lambda counts: not counts.get("failures"),
        requirement=requirement,
        details=times_to_safe,
    )


def sensor_case(number: int) -> Case:
    """Return a dive with one sensor fault: all faults of a vehicle, then vehicles, then seeds."""
    names, vehicles = deflection.sensor_faults(), cases.VEHICLES
    number, name = divmod(number, len(names))
    seed, vehicle = divmod(number, len(vehicles))
    return deflection.sensor_dive(*names[name], vehicles[vehicle], seed)


def measure_deflections(first: int, count: int) -> Batch:
    """Measure the time at full deflection that sensor faults command."""
    batch = Batch()
    for number in range(first, first + count):
        case = sensor_case(number)
        full_s = deflection.longest_full_s(case)
        batch.add("dives")
        batch.add(f"{LARGEST}full s", full_s)
        if full_s > deflection.MAX_FULL_S:
            batch.fail(number, f"full travel for {full_s:.2f} s: {case.faults[0]}, {case.vehicle}")
    return batch


def describe_deflections(counts: Mapping[str, float]) -> str:
    """Return the result of ``measure_deflections``."""
    longest_s = counts.get(f"{LARGEST}full s", 0.0)
    return f"{counts.get('dives', 0):.0f} dives; full travel for {longest_s:.2f} s at most"


_PARAMETER_DIVES = cases.parameter_dives()
FAULTS = _row(
    f"catalogue of {len(cases.catalogue_names())} faults x {len(cases.VEHICLES)} vehicles x seeds",
    SEEDS * len(cases.VEHICLES) * len(cases.catalogue_names()),
    fault_case,
    "0 endless, 0 end armed at depth, 0 avoidable floor contacts",
)
PAIRS = _row(
    "pairs of faults over the whole range",
    N_PAIRS,
    cases.pair,
    "0 endless, 0 avoidable floor contacts",
)
PARAMETERS = _row(
    "parameters at least, most and least useful value",
    len(_PARAMETER_DIVES),
    _PARAMETER_DIVES.__getitem__,
    "0 beyond the depth limit",
)
MISSIONS = _row(
    "missions with random sea, faults, link loss 0 to 30 %",
    N_MISSIONS,
    cases.random_mission,
    "each ends safe",
)
DEFLECTION = Row(
    title=f"{len(deflection.sensor_faults())} sensor faults x {len(cases.VEHICLES)} vehicles"
    " x seeds",
    full_size=SEEDS * len(cases.VEHICLES) * len(deflection.sensor_faults()),
    batch_size=10,
    run=measure_deflections,
    describe=describe_deflections,
    holds=lambda counts: not counts.get("failures"),
    requirement=f"no sensor commands full travel for more than {deflection.MAX_FULL_S:g} s",
)
