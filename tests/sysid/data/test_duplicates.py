"""A dive that is given twice is rejected in any file format; two different dives are accepted."""

import math
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as mavlink
from scipy.signal import lfilter

from sysid import refit
from sysid.data import duplicates, readers, segments, state_table
from sysid.data.segments import MarkedInterval
from sysid.models.model_file import DataFile
from sysid.planes import Plane
from sysid.refit import RefitRequest
from tests.sysid import recording
from tests.sysid.data.test_dataset import actuators, dive, position
from tests.sysid.recording import Entry

COLUMNS = ("time", "heading_rad", "pitch", "q", "r_", "rudder", "elevator", "thrust", "depth_m")
"""Starts of the names of the columns of both planes: no roll, no roll rate."""
NOISE_RADPS = 1e-3
"""Standard deviation of the gyro noise, as in sitl: 0.06 deg/s."""


def noisy_dive(seed: int, start: int = 0, stop: int = 2000) -> list[Entry]:
    """Return the dive of test_dataset with noise on the rates, cut to a range of samples."""
    noise = np.random.default_rng(seed).normal(0.0, NOISE_RADPS, (2000, 3))
    entries = []
    for time_s, message in dive():
        k = round(50 * time_s)
        if not start <= k < stop:
            continue
        if message.msgname == "ATTITUDE":
            p, q, r = (float(v) for v in noise[k] + (0.0, 0.0, 0.1))
            angles = message.roll, message.pitch, message.yaw
            message = mavlink.MAVLink_attitude_message(message.time_boot_ms, *angles, p, q, r)
        entries.append((time_s, message))
    return entries


def as_tlog(path: Path, entries: list[Entry]) -> Path:
    """Write a tlog as MAVProxy does: 8 bytes of microseconds, big-endian, then the frame."""
    link = mavlink.MAVLink(None, 1, 1)
    frames = (struct.pack(">Q", round(1e6 * t)) + bytes(m.pack(link)) for t, m in entries)
    path.write_bytes(b"".join(frames))
    return path


def mcap(path: Path, entries: list[Entry]) -> Path:
    return recording.write(path, entries, {})


def shifted(entries: list[Entry], by_s: float) -> list[Entry]:
    """Return the same dive, recorded by a clock that is ahead by a given time."""
    return [(time_s + by_s, message) for time_s, message in entries]


def thinned(entries: list[Entry]) -> list[Entry]:
    """Return the dive with every second attitude sample, as over a slower link."""
    kept, count = [], 0
    for time_s, message in entries:
        count += message.msgname == "ATTITUDE"
        if message.msgname != "ATTITUDE" or count % 2:
            kept.append((time_s, message))
    return kept


def as_table(path: Path, folder: Path) -> Path:
    """Write the columns of both planes of the first dive, as an engineer would."""
    log = readers.read(folder / "dive.mcap")
    table = state_table.state_table(log)
    names = [name for name in table if name.startswith(COLUMNS)]
    ((start_s, stop_s),) = segments.times_of_tests(log, ())
    lines = [",".join([*names, "test"])]
    for row in zip(*(table[name].tolist() for name in names), strict=True):
        test = "rudder" if start_s <= row[0] <= stop_s else ""
        lines.append(",".join([*("" if math.isnan(x) else repr(x) for x in row), test]))
    path.write_text("\n".join(lines))
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dives")
    (folder / "copies").mkdir()
    mcap(folder / "dive.mcap", noisy_dive(1))
    mcap(folder / "other.mcap", noisy_dive(2))
    return folder


COPIES: dict[str, Callable[[Path, Path], Path]] = {
    "same path": lambda folder, copy: folder / "dive.mcap",
    "path written otherwise": lambda folder, copy: folder / "copies" / ".." / "dive.mcap",
    "copied": lambda folder, copy: mcap(copy, noisy_dive(1)),
    "trimmed": lambda folder, copy: mcap(copy, noisy_dive(1, 500, 1400)),
    "trimmed within the test": lambda folder, copy: mcap(copy, noisy_dive(1, 900, 1100)),
    "clock ahead": lambda folder, copy: mcap(copy, shifted(noisy_dive(1), 1234.5)),
    "slower link": lambda folder, copy: mcap(copy, thinned(noisy_dive(1))),
    "converted": lambda folder, copy: as_tlog(copy.with_suffix(".tlog"), noisy_dive(1)),
    "table without roll": lambda folder, copy: as_table(copy.with_suffix(".csv"), folder),
}


@pytest.mark.parametrize("copy", COPIES)
def test_fitted_log_as_held_out_is_rejected(copy: str, folder: Path) -> None:
    path, held = folder / "dive.mcap", COPIES[copy](folder, folder / "copies" / "c.mcap")
    with pytest.raises(refit.RefitError, match="hold out another dive") as refused:
        refit.refit(RefitRequest(paths=[folder / "other.mcap", path], held_out=[held]))
    assert str(refused.value).startswith(f"{held}, held out, holds the same samples as {path},")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("copy", COPIES)
def test_log_fitted_twice_is_rejected(copy: str, folder: Path) -> None:
    path, again = folder / "dive.mcap", COPIES[copy](folder, folder / "copies" / "c.mcap")
    with pytest.raises(refit.RefitError, match="give one of them") as refused:
        refit.refit(RefitRequest(paths=[path, folder / "other.mcap", again]))
    assert str(refused.value).startswith(f"{path} and {again} hold the same samples")


def test_log_held_out_twice_is_rejected(folder: Path) -> None:
    path = folder / "dive.mcap"
    with pytest.raises(refit.RefitError, match="held out, hold the same samples"):
        refit.refit(RefitRequest(paths=[folder / "other.mcap"], held_out=[path, path]))


def found(paths: list[Path], marks: tuple[MarkedInterval, ...] = ()) -> list[duplicates.NamedLog]:
    return [duplicates.named_log(path, readers.read(path), marks) for path in paths]


def test_two_dives_of_the_same_test_are_accepted(folder: Path) -> None:
    """The two dives differ only by noise."""
    one, other = found([folder / "dive.mcap", folder / "other.mcap"])
    assert len(one.samples) == len(other.samples) == 501
    assert one.samples & other.samples == frozenset()
    assert duplicates.refusal([one], [other]) == ""


def disturbed_dive(seed: int) -> list[Entry]:
    """Return the noisy dive in a sea that turns the vehicle by 0.4 deg/s rms within 0.5 s."""
    white = np.random.default_rng(seed).normal(0.0, 1.0, (2000, 2))
    sea = lfilter([0.04], [1.0, -0.96], white, axis=0) * 0.05
    entries = []
    for time_s, message in noisy_dive(seed):
        if message.msgname == "ATTITUDE":
            q, r = sea[round(50 * time_s)]
            message.pitchspeed, message.yawspeed = message.pitchspeed + q, message.yawspeed + r
        entries.append((time_s, message))
    return entries


def resampled(entries: list[Entry], rate_hz: float, by_s: float) -> list[Entry]:
    """Return a dive with interpolated attitude, by a clock that is ahead by a given time."""
    names = ("pitch", "yaw", "pitchspeed", "yawspeed")
    attitude = [(t, m) for t, m in entries if m.msgname == "ATTITUDE"]
    times_s = [t for t, _ in attitude]
    new_s = np.arange(times_s[0] + 0.007, times_s[-1], 1.0 / rate_hz)
    columns = [np.interp(new_s, times_s, [getattr(m, name) for _, m in attitude]) for name in names]
    messages = [
        (t, mavlink.MAVLink_attitude_message(round(1e3 * t), 0.0, pitch, yaw, 0.0, q, r))
        for t, pitch, yaw, q, r in zip(new_s.tolist(), *columns, strict=True)
    ]
    others = [entry for entry in entries if entry[1].msgname != "ATTITUDE"]
    return shifted(sorted([*others, *messages], key=lambda entry: entry[0]), by_s)


@pytest.mark.parametrize("rate_hz", [5.0, 12.5, 50.0])
def test_resampled_copy_is_rejected(rate_hz: float, tmp_path: Path) -> None:
    """It has no sample of the dive, and passed as held out."""
    path = mcap(tmp_path / "dive.mcap", disturbed_dive(1))
    copy = mcap(tmp_path / "copy.mcap", resampled(disturbed_dive(1), rate_hz, 12.34))
    one, other = found([path, copy])
    assert not one.samples & other.samples
    assert duplicates.refusal([one], [other]).startswith(
        f"{copy}, held out, holds the same motion as {path}, which is fitted"
    )
    assert duplicates.refusal([one, other], []).startswith(
        f"{path} and {copy} hold the same motion"
    )


@pytest.mark.parametrize("rate_hz", [5.0, 12.5, 50.0])
def test_repetition_of_a_test_at_another_rate_is_accepted(rate_hz: float, tmp_path: Path) -> None:
    """It has the same commands, in another sea."""
    path = mcap(tmp_path / "dive.mcap", disturbed_dive(1))
    again = mcap(tmp_path / "again.mcap", resampled(disturbed_dive(2), rate_hz, 12.34))
    one, other = found([path, again])
    assert duplicates.refusal([one], [other]) == ""


def test_constant_samples_do_not_count_as_copy(tmp_path: Path) -> None:
    """A marked test contains the same sample for ten seconds."""
    still = [
        entry
        for k in range(2000)
        for entry in (
            (k / 50, mavlink.MAVLink_attitude_message(20 * k, 0, 0, 0, 0, 0, 0)),
            actuators(k / 50, 0.0, 0.0),
            position(k / 50, 4.0 + k % 3),
        )
    ]
    paths = [mcap(tmp_path / "a.mcap", still), mcap(tmp_path / "b.mcap", still[:-300])]
    one, other = found(paths, (MarkedInterval(10.0, 20.0, Plane.YAW),))
    assert len(one.samples) == 1
    assert duplicates.refusal([one], [other]) == ""


@pytest.mark.parametrize(("shared", "refused"), [(65, False), (100, True)])
def test_tests_of_a_simulator_without_noise_are_no_copies(
    shared: int, refused: bool, tmp_path: Path
) -> None:
    """All tests begin alike: of 2833 samples 65 were equal to those of another dive."""
    paths = [mcap(tmp_path / f"{k}.mcap", noisy_dive(k)) for k in (1, 2)]
    numbers = range(2833), range(2833 - shared, 2 * 2833 - shared)
    one, other = (
        log._replace(samples=frozenset(str(k).encode() for k in part))
        for log, part in zip(found(paths), numbers, strict=True)
    )
    assert bool(duplicates.refusal([one], [other])) is refused


def test_log_of_prior_fit_is_rejected(folder: Path) -> None:
    (one,) = found([folder / "dive.mcap"])
    said = duplicates.refusal([], [one], [DataFile("first.mcap", one.log.sha256)])
    assert said.startswith(f"{one.path}: the prior model was already fitted to it")
    assert "first.mcap" in said
