"""The truth log, read with a standard MCAP reader."""

import json
import resource
from pathlib import Path

import pytest
from mcap.reader import make_reader

from mavlink_io.tick import TICK_US
from sitl import scenario
from sitl.core import plant
from sitl.truth_log import TOPIC, TruthLog
from sitl.vehicle import config


def test_log_time_is_start_plus_vehicle_time(tmp_path: Path) -> None:
    truth = plant.initial_state(
        plant.build(config.load("caribou_truth"), scenario.load("disturbed")),
        plant.random_streams(1),
    )[0].truth
    log = TruthLog(tmp_path / "truth.mcap")
    for tick in range(5):
        log.write(truth._replace(time_us=tick * TICK_US))
    log.close()
    with (tmp_path / "truth.mcap").open("rb") as file:
        found = [
            (message.log_time, json.loads(message.data))
            for _, _, message in make_reader(file).iter_messages(TOPIC)
        ]
    assert [values["time_us"] for _, values in found] == [0, 20_000, 40_000, 60_000, 80_000]
    assert [at - found[0][0] for at, _ in found] == [
        0,
        20_000_000,
        40_000_000,
        60_000_000,
        80_000_000,
    ]
    assert found[0][1] == json.loads(json.dumps(truth._asdict()))
    assert found[0][1]["rudder_rad"] == truth.rudder_rad


def test_existing_log_is_not_overwritten(tmp_path: Path) -> None:
    file = tmp_path / "precious.mcap"
    file.write_bytes(b"precious")
    with pytest.raises(FileExistsError):
        TruthLog(file)
    assert file.read_bytes() == b"precious"


def test_failed_write_names_the_file(tmp_path: Path) -> None:
    """A limit of the file size stands in for a full disk."""
    log = TruthLog(tmp_path / "truth.mcap")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1, limits[1]))
    try:
        with pytest.raises(OSError, match="File too large") as failure:
            log.close()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    log._file.close()
    assert failure.value.filename == str(tmp_path / "truth.mcap")
