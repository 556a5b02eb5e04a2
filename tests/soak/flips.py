"""Soak row: single flipped bits in logs."""

import random
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np

from sysid.data import readers
from sysid.data.dataset import Log, LogError
from tests.fuzz.files import FILES
from tests.soak.row import Batch, Row

FORMATS = ("mcap", "tlog", "dataflash", "ulog")
LARGEST_HIDDEN = {
    "rad": 0.018,
    "radps": 0.053,
    "thrust": 0.07,
    "depth_m": 0.21,
    "rate_mps": 3.0,
    "mps": 0.35,
    "mps2": 0.5,
    "s": 0.025,
}
"""Largest change of a value, by the end of its name, that formats without checksums may hide.

They are the floors of ``sysid.data.readers.spikes``, and the interval of two samples."""


PARTS = (
    *("attitude", "actuators", "depth", "setpoints", "duct"),
    *("velocity", "specific_force", "position", "current"),
)
"""Arrays of a log."""


def content(log: Log) -> bytes:
    """Return all data that identification reads from a log."""
    parts = (getattr(log, part) for part in PARTS)
    arrays = [np.ascontiguousarray(v).tobytes() for part in parts for v in vars(part).values()]
    return b"".join(arrays) + repr((log.events, sorted(log.parameters.items()))).encode()


@cache
def _original(name: str) -> tuple[bytes, Log]:
    """Return an undamaged log and its content."""
    with tempfile.TemporaryDirectory() as folder:
        data = FILES[name].seeds(Path(folder))[0]
        path = Path(folder) / f"dive{FILES[name].suffix}"
        path.write_bytes(data)
        log = readers.read(path)
    return data, log


def hidden(log: Log, original: Log) -> bool:
    """Return whether two logs differ by less than `LARGEST_HIDDEN` in every value."""
    if log.events != original.events or log.parameters != original.parameters:
        return False
    for part in PARTS:
        for name, values in vars(getattr(original, part)).items():
            other = getattr(getattr(log, part), name)
            if not isinstance(values, np.ndarray):
                continue
            limit = next((v for end, v in LARGEST_HIDDEN.items() if name.endswith(end)), 0.0)
            if other.shape != values.shape or not np.allclose(
                other, values, rtol=0.0, atol=limit, equal_nan=True
            ):
                return False
    return True


def run(first: int, count: int) -> Batch:
    """Flip one bit of a log per format and case."""
    batch = Batch()
    with tempfile.TemporaryDirectory() as folder:
        for case in range(first, first + count):
            for name in FORMATS:
                _read(batch, name, case, Path(folder))
    return batch


def _read(batch: Batch, name: str, case: int, folder: Path) -> None:
    """Flip one bit and read the log."""
    data, original = _original(name)
    changed = bytearray(data)
    bit = random.Random(f"{name} {case}").randrange(8 * len(data))
    changed[bit // 8] ^= 1 << bit % 8
    path = folder / f"dive{FILES[name].suffix}"
    path.write_bytes(changed)
    batch.add("flips")
    try:
        log = readers.read(path)
    except LogError:
        batch.add(f"refused {name}")
        return
    if content(log) == content(original):
        batch.add(f"same {name}")
    elif log.damage != original.damage:
        batch.add(f"reported {name}")
    elif hidden(log, original):
        batch.add(f"hidden {name}")
    else:
        batch.add(f"silent {name}")
        batch.fail(case, f"{name}: byte {bit // 8} of {len(data)} read silently as other data")


def describe(counts: Mapping[str, float]) -> str:
    """Return the result."""
    parts = []
    for name in FORMATS:
        numbers = (f"{counts.get(f'{kind} {name}', 0):.0f}" for kind in KINDS)
        parts.append(f"{name} {'/'.join(numbers)}")
    return f"{'/'.join(KINDS)}: {', '.join(parts)}"


KINDS = ("refused", "reported", "same", "hidden", "silent")
"""Refused; read with the damage reported; no effect; a change within the noise; another change."""
ROW = Row(
    title="single bit flips in logs",
    full_size=1000,
    batch_size=50,
    run=run,
    describe=describe,
    holds=lambda counts: not any(counts.get(f"silent {name}") for name in FORMATS),
    requirement="0 read silently as other data",
)
