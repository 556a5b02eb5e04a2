"""Soak row: fuzzed frames on the links of the autopilot."""

import random
from collections.abc import Callable, Mapping

from tests.fuzz.links import MAX_TICK_CPU_S, LinkFuzz, LinkReport
from tests.soak.row import Batch, Row

MAX_CASE_BYTES = 3000
"""Maximum number of bytes from which the frames of a case are made."""


def run(first: int, count: int) -> Batch:
    """Send frames on the ground link, the HIL link and by the file transfer in turn."""
    batch, fuzz = Batch(), LinkFuzz()
    links: tuple[tuple[str, Callable[[bytes], LinkReport]], ...] = (
        ("ground", fuzz.ground),
        ("hil", fuzz.hil),
        ("ftp", fuzz.file_transfer),
    )
    frames = 0
    case = first
    while frames < count:
        rng = random.Random(case)
        name, send = links[case % len(links)]
        try:
            report = send(rng.randbytes(rng.randrange(MAX_CASE_BYTES)))
        except Exception as error:
            fuzz.close()
            batch.fail(case, f"{name}: {type(error).__name__}: {error}")
            frames += 1
        else:
            frames += report.frames
            batch.add(f"frames {name}", report.frames)
            batch.add("frames armed", report.frames * report.armed)
            batch.add("max tick CPU s", report.tick_cpu_s)
            batch.add("slow ticks", report.tick_cpu_s > MAX_TICK_CPU_S)
        case += 1
    fuzz.close()
    return batch


def describe(counts: Mapping[str, float]) -> str:
    """Return the result."""
    frames = "/".join(
        f"{counts.get(f'frames {name}', 0.0):.0f}" for name in ("ground", "hil", "ftp")
    )
    armed, failures, slow = (
        counts.get(name, 0.0) for name in ("frames armed", "failures", "slow ticks")
    )
    slowest_ms = 1e3 * counts.get("max tick CPU s", 0.0)
    return (
        f"{frames} frames, {armed:.0f} of them with an armed vehicle, {failures:.0f} defects;"
        f" tick CPU at most {slowest_ms:.1f} ms, {slow:.0f} above 20 ms"
    )


ROW = Row(
    title="fuzzed frames on ground, HIL and FTP links",
    full_size=10_000_000,
    batch_size=50_000,
    run=run,
    describe=describe,
    holds=lambda counts: not counts.get("failures") and not counts.get("slow ticks"),
    requirement="0 exits or internal errors, tick within 20 ms of CPU",
)
