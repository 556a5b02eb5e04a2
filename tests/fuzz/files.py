"""Fuzz targets on the readers of files: each file is read, or refused in one line."""

import json
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from autopilot import param_file, resume
from autopilot.comms.sensor_clock import SensorClock
from autopilot.control import lqg_file
from autopilot.record_json import from_json, to_json
from autopilot.resume import Checkpoint
from ground.client import param_file as ground_param_file
from ground.missions import plans, script
from mavlink_io.errors import CaribouError
from sitl import bathymetry, scenario
from sitl.vehicle import config
from sysid.data import readers
from sysid.models import json_record, model_file
from tests.fuzz.links import DefectError
from tests.helpers.fake_hil import Harness
from tests.sysid.data.readers import files as recorded
from tests.sysid.data.readers.test_csv_table import rows as csv_rows
from tests.sysid.data.readers.test_damage import write_own

ROOT = Path(__file__).parents[2]
CORPUS = Path(__file__).parent / "corpus"
"""Inputs that once caused a defect, and small files of each format: one folder per target."""
SEED_LOG_S = 3.0
"""Duration of the logs that are mutated, s of vehicle time."""
MAX_MESSAGE_LENGTH = 2000
"""Maximum characters of a refusal: one line that an operator reads."""

Read = Callable[[Path], object]


class FileTarget(NamedTuple):
    """One reader and valid files for it."""

    suffix: str
    read: Read
    seeds: Callable[[Path], list[bytes]]
    """Write valid files to a folder and return their content."""

    def run(self, data: bytes, path: Path) -> bool:
        """Read a file with this content; return whether it was accepted.

        Raises DefectError for any end other than a result or one line of refusal.
        """
        path.write_bytes(data)
        try:
            self.read(path)
        except CaribouError as error:
            said = str(error)
            if "\n" in said or len(said) > MAX_MESSAGE_LENGTH:
                raise DefectError(f"refusal of {len(said)} characters: {said[:200]!r}") from error
            return False
        except Exception as error:
            raise DefectError(f"{type(error).__name__}: {str(error)[:200]}") from error
        return True


@contextmanager
def short_logs() -> Iterator[None]:
    """Let the writers of test logs write `SEED_LOG_S` with a test inside."""
    seconds, test = recorded.SECONDS, recorded.TEST
    recorded.SECONDS, recorded.TEST = SEED_LOG_S, (1.0, 2.0)
    try:
        yield
    finally:
        recorded.SECONDS, recorded.TEST = seconds, test


def _recorded(write: Callable[[Path], object], suffix: str) -> Callable[[Path], list[bytes]]:
    """Return a function that writes one log and returns its content."""

    def seeds(folder: Path) -> list[bytes]:
        path = folder / f"seed{suffix}"
        with short_logs():
            write(path)
        return [path.read_bytes()]

    return seeds


def _written(pattern: str) -> Callable[[Path], list[bytes]]:
    """Return a function that returns the repository's files of a pattern."""
    return lambda _: [path.read_bytes() for path in sorted(ROOT.glob(pattern))]


def _text(*contents: str) -> Callable[[Path], list[bytes]]:
    """Return a function that returns texts."""
    return lambda _: [content.encode() for content in contents]


def _write_csv(path: Path) -> None:
    """Write a dive as CSV."""
    from tests.sysid.data.readers.test_csv_table import COLUMNS

    path.write_text("\n".join((COLUMNS, *csv_rows())) + "\n")


def _read_log(path: Path) -> None:
    """Read a log for identification, then all its messages."""
    log_format = readers.format_of(path)
    try:
        readers.read(path)
    finally:
        if log_format != "mcap":
            readers.load(path)


def _plan(_: Path) -> list[bytes]:
    """Return a mission in the two formats of plan files."""
    items = plans.load_items("square")
    wpl = "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t41.5\t-71.3\t0\t1\n"
    wpl += "1\t0\t3\t16\t0\t0\t0\t0\t41.5\t-71.3\t-2\t1\n"
    return [plans.write_plan(items).encode(), wpl.encode()]


def _checkpoint(_: Path) -> list[bytes]:
    """Return the checkpoint of a vehicle in a mission."""
    harness = Harness()
    harness.tick(20, depth_m=2.0)
    checkpoint = Checkpoint(
        written_unix_s=0.0,
        hil="udpin:127.0.0.1:14560",
        state=resume._continuable(harness.vehicle.state._replace(armed=True)),
        clock=SensorClock(1),
        intended_mode=1,
        ground_was_received=True,
    )
    return [to_json(checkpoint).encode()]


def _read_checkpoint(path: Path) -> None:
    """Read a checkpoint or refuse it."""
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        return
    from_json(Checkpoint, text)


def _controller(_: Path) -> list[bytes]:
    """Return a controller file of minimal size."""
    document: dict[str, object] = {
        "format": 1,
        "tick_s": 0.02,
        "speed_mps": 1.3,
        "pitch_per_metre": 0.1,
    }
    for key, measured in lqg_file.MEASURED.items():
        document[key] = {
            "rows": [[0.1] * (2 + measured)],
            "feedback": [1.0],
            "start": [[0.5] * measured],
            "loads": 0,
        }
    return [json.dumps(document).encode()]


def _model(folder: Path) -> list[bytes]:
    """Return a model file."""
    from sysid.test_design import prior
    from tests.sysid.monte_carlo.files import model_of

    return [json_record.encode(model_of(prior.from_file(config.load("caribou_nominal"))))]


GRID = "ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 10\n-10 -11 -12\n-10 -11 -12\n"
PARAMETERS = "# gains\nHDG_P,0.7\nTHR_CRUISE_PCT 58 # percent\nFS_DEPTH_M,100\n"


def _load_mission(path: Path) -> None:
    """Read a mission."""
    script.load(str(path))


def _load_scenario(path: Path) -> None:
    """Read a scenario."""
    scenario.load(str(path))


FILES: dict[str, FileTarget] = {
    "mcap": FileTarget(".mcap", _read_log, _recorded(write_own, ".mcap")),
    "tlog": FileTarget(".tlog", _read_log, _recorded(recorded.tlog, ".tlog")),
    "dataflash": FileTarget(".bin", _read_log, _recorded(recorded.dataflash, ".bin")),
    "ulog": FileTarget(".ulg", _read_log, _recorded(recorded.ulog, ".ulg")),
    "csv": FileTarget(".csv", _read_log, _recorded(_write_csv, ".csv")),
    "mission": FileTarget(".toml", _load_mission, _written("ground/missions/*.toml")),
    "plan": FileTarget(".plan", lambda p: plans.load_items(str(p)), _plan),
    "vehicle": FileTarget(".toml", config.load, _written("sitl/vehicle/*.toml")),
    "scenario": FileTarget(".toml", _load_scenario, _written("sitl/scenarios/*.toml")),
    "grid": FileTarget(".asc", bathymetry.read, _text(GRID)),
    "parameters": FileTarget(".param", ground_param_file.load, _text(PARAMETERS)),
    "vehicle_parameters": FileTarget(".param", param_file.load, _text(PARAMETERS)),
    "controller": FileTarget(".json", lqg_file.load, _controller),
    "model": FileTarget(".json", model_file.read, _model),
    "checkpoint": FileTarget(".json", _read_checkpoint, _checkpoint),
}
"""Fuzz targets by name."""


def seeds_of(name: str) -> list[bytes]:
    """Return valid files of a target and those of the corpus."""
    with tempfile.TemporaryDirectory() as folder:
        made = FILES[name].seeds(Path(folder))
    return made + corpus_of(name)


def corpus_of(name: str) -> list[bytes]:
    """Return the files of the corpus of a target."""
    return [path.read_bytes() for path in sorted((CORPUS / name).glob("*"))]
