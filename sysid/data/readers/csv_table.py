"""CSV files: one row per time, columns with the unit in their name (docs/logs.md).

Angles in ``_deg`` or ``_rad``, rates in ``_degps`` or ``_radps``. Lines ``# NAME = VALUE`` before
the header are parameters, for example ``# ACT_TRAVEL_DEG = 15``. Axes are MAVLink's: heading
clockwise from north, pitch nose up, depth down; positive rudder turns the nose to starboard,
positive elevator turns it up; velocity u, v, w and specific force ax, ay, az forward, starboard
and down. Empty cells are allowed where a sensor has no sample.
"""

import csv
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_io.text_files import read_text
from sysid.data.dataset import (
    Actuators,
    Array,
    Attitude,
    Depth,
    Log,
    LogError,
    LogEvent,
    Setpoints,
    SpecificForce,
    Velocity,
    VelocitySource,
)
from sysid.data.events import StopReason, TestAxis, TestEnded, TestStarted, TestWave
from sysid.data.readers.samples import (
    FileDamage,
    MessageColumns,
    body_rates,
    clock_steps,
    derivative,
    foreign_log,
    format_damage,
    out_of_order,
    strictly_increasing,
    zero_depth,
)
from sysid.data.readers.servo_channels import (
    FIRST_THREE,
    READ_PARAMETERS,
    TRIMS,
    OutputOptions,
    travel_rad,
)
from sysid.data.segments import LOOP_RATE

LOOP = "loop"
"""Quantity of the column ``loop_hz``, the rate of the autopilot's loops in every row."""
_UNITS = {
    "heading": {"_deg": math.radians(1.0), "_rad": 1.0},
    "pitch": {"_deg": math.radians(1.0), "_rad": 1.0},
    "roll": {"_deg": math.radians(1.0), "_rad": 1.0},
    "p": {"_degps": math.radians(1.0), "_radps": 1.0},
    "q": {"_degps": math.radians(1.0), "_radps": 1.0},
    "r": {"_degps": math.radians(1.0), "_radps": 1.0},
    "rudder": {"_deg": math.radians(1.0), "_rad": 1.0},
    "elevator": {"_deg": math.radians(1.0), "_rad": 1.0},
    "thrust": {"_pct": 0.01},
    "depth": {"_m": 1.0},
    "depth_rate": {"_mps": 1.0},
    "u": {"_mps": 1.0},
    "v": {"_mps": 1.0},
    "w": {"_mps": 1.0},
    "ax": {"_mps2": 1.0},
    "ay": {"_mps2": 1.0},
    "az": {"_mps2": 1.0},
    LOOP: {"_hz": 1.0},
}
"""Factor to SI units by suffix, for each quantity."""
_MAX_ABS = {
    "pitch": 0.5 * math.pi,
    "rudder": 0.5 * math.pi,
    "elevator": 0.5 * math.pi,
    "thrust": 1.0,
}
"""Largest possible absolute value in SI units; a larger one is in another unit than the column."""
_ANGLE, _RATE, _SPEED = math.radians(1e6), math.radians(4000.0), 60.0
_RANGES = {
    "heading": (-_ANGLE, _ANGLE),  # unwrapped, over 2,700 turns
    "roll": (-_ANGLE, _ANGLE),
    "pitch": (-2.0 * math.pi, 2.0 * math.pi),
    "p": (-_RATE, _RATE),  # rate sensors end at 2000 deg/s
    "q": (-_RATE, _RATE),
    "r": (-_RATE, _RATE),
    "rudder": (-2.0 * math.pi, 2.0 * math.pi),
    "elevator": (-2.0 * math.pi, 2.0 * math.pi),
    "thrust": (-10.0, 10.0),
    "depth": (-10.0, 12_000.0),  # the ocean is 10,935 m deep
    "depth_rate": (-_SPEED, _SPEED),
    "u": (-_SPEED, _SPEED),
    "v": (-_SPEED, _SPEED),
    "w": (-_SPEED, _SPEED),
    "ax": (-1000.0, 1000.0),
    "ay": (-1000.0, 1000.0),
    "az": (-1000.0, 1000.0),
    LOOP: (1.0, 10_000.0),
}
"""Smallest and largest value of a single cell in SI units, which no vehicle exceeds."""
MIN_DEPTH_M = -1.0
"""Smallest depth of a vehicle at the surface: error of a pressure sensor's zero."""
MIN_THRUST = 0.01
"""Thrust up to which the column is a fraction, not percent: a vehicle does not cruise with 1 %."""
UNIT_QUANTILE = 0.95
"""Quantile of the absolute values that is compared with these limits.

A few spikes do not refuse a file; a twentieth of its values in another unit does."""
MAX_STEP_S = 2.0
"""Largest step of the time, in s: such a column holds milliseconds, or no tests can be seen."""
MAX_REPEATED = 0.2
"""Largest fraction of rows with the time of the row before: more of them are rounded times."""
MAX_DEPTH_JUMP_M = 0.5
"""Largest noise of a depth in metres; that of a depth in mm is 1000 times as large."""
MIN_TEST_RANGE_DEG = 0.5
"""Smallest range of a surface in its tests: a command in rad has less, or a test that is too small.
"""
MIN_WRAPS, MAX_WRAP_ERROR = 2, 0.02
"""Number of wraps of a heading that show its unit, and largest change of the heading in one row, in
turns. Radians in a column in degrees wrap by 6.28, span no more, and change by less than 0.13
otherwise; degrees also change by a value between."""
MAX_NAMED_LINES = 3
"""Number of left out rows whose line is named."""
_PARAMETERS = READ_PARAMETERS | {LOOP_RATE, *TRIMS}
"""Parameters that a line before the header may give."""
TIME = "time_s"
TEST = "test"
"""Column with the surface under test: ``rudder``, ``elevator``, ``both``, or empty."""
_PLANES = (("heading", "rudder"), ("pitch", "elevator", "depth"))
"""Quantities of the yaw plane and of the pitch plane; one of the planes must be complete."""
_AXES = {"rudder": TestAxis.RUDDER, "elevator": TestAxis.ELEVATOR, "both": TestAxis.BOTH}
_TABLE = "csv"
"""Name of the table for inspection."""


class _Table(NamedTuple):
    """Content of a file."""

    quantities: dict[str, Array]
    """SI values by quantity; NaN for an empty cell."""
    time_s: Array
    tests: list[str]
    """Surface under test in each row; empty outside tests and without the column."""
    parameters: dict[str, float]
    damage: FileDamage
    """Rows that are left out."""


def read(path: Path, options: OutputOptions) -> Log:
    """Read one CSV file.

    Parameters
    ----------
    path : Path
        The file.
    options : OutputOptions
        Travel of the vehicle. Channels 1, 2 and 3 are the columns of rudder, elevator and thrust.

    Returns
    -------
    Log
        Arrays in MAVLink's axes. A plane that is not in the file is zero.

    Raises
    ------
    LogError
        A column is missing, or a cell is not a number; the message names line and column.
    """
    table = _without_empty_columns(_parse(path))
    complete = [all(name in table.quantities for name in plane) for plane in _PLANES]
    if not any(complete):
        raise LogError(
            f"{path}: needs {TIME}, thrust_pct and the columns of a plane: heading_deg and"
            f" rudder_deg, or pitch_deg, elevator_deg and depth_m; it has"
            f" {', '.join(sorted(table.quantities)) or 'none of them'}"
        )
    if options.channels is None:
        _check_tested_surfaces(path, table)
    return foreign_log(
        path,
        attitude=_attitude(path, table),
        actuators=_actuators(path, table, options),
        depth=_depth(path, table),
        setpoints=Setpoints(*(np.empty(0),) * 5),
        events=tuple(_events(table)),
        parameters=table.parameters,
        steps=clock_steps(TIME, table.time_s),
        damage=format_damage(table.damage, table.time_s),
        velocity=_velocity(path, table),
        specific_force=_specific_force(path, table),
    )


def load(path: Path) -> tuple[dict[str, MessageColumns], FileDamage]:
    """Return the quantities of a file in SI units; raise LogError for a bad file."""
    table = _parse(path)
    return {_TABLE: MessageColumns(table.time_s, table.quantities)}, table.damage


def _parse(path: Path) -> _Table:
    """Return the content of a file; raise LogError naming line and column."""
    try:
        text = read_text(path, "utf-8-sig").rstrip("\0")  # blocks that a loss of power left empty
    except OSError as error:
        raise LogError(f"{path}: {error.strerror}; give a CSV file") from None
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        raise LogError(f"{path}: line {line}: is no text in UTF-8; give a CSV file") from None
    lines = text.splitlines()
    parameters = _parameters(path, lines)
    numbered = [
        (number, line)
        for number, line in enumerate(lines, start=1)
        if line.strip() and not line.startswith("#")
    ]
    if len(numbered) < 3:
        raise LogError(f"{path}: has no rows; give a header and at least two rows")
    try:
        header, *rows = csv.reader([line for _, line in numbered], skipinitialspace=True)
    except csv.Error as error:
        raise LogError(f"{path}: is no CSV file: {error}") from None
    if len(rows) != len(numbered) - 1:
        raise LogError(f"{path}: a quotation mark is not closed; write one row per line")
    damage = list[str]()
    if len(rows) > 2 and len(rows[-1]) < len(header) and not text.endswith("\n"):
        rows.pop()
        damage.append(f"line {numbered.pop()[0]}, the last one, is cut off and left out")
    names = [name.strip() for name in header]
    duplicates = sorted({name for name in names if name and names.count(name) > 1})
    if duplicates:
        raise LogError(f"{path}: line {numbered[0][0]}: two columns {duplicates[0]!r}")
    if TIME not in names:
        raise LogError(f"{path}: line {numbered[0][0]}: {_without_time(names)}; see docs/logs.md")
    columns = _columns(path, names, rows, [number for number, _ in numbered[1:]])
    test = names.index(TEST) if TEST in names else None
    tests = ["" if test is None or test >= len(row) else row[test].strip() for row in rows]
    unknown = sorted(set(tests) - {"", *_AXES})
    if unknown:
        raise LogError(
            f"{path}: column {TEST}: {unknown[0]!r}; give rudder, elevator, both or nothing"
        )
    loop_hz, time_s = columns.pop(LOOP, np.array([])), columns.pop(TIME)
    if (known_hz := loop_hz[np.isfinite(loop_hz)]).size:
        parameters[LOOP_RATE] = float(known_hz[0])
    if not np.all(np.isfinite(time_s)):
        line = numbered[1 + int(np.argmin(np.isfinite(time_s)))][0]
        raise LogError(f"{path}: line {line}: no {TIME}; every row needs its time")
    if np.count_nonzero(strictly_increasing(time_s)) < 2:
        raise LogError(f"{path}: column {TIME}: never increases; give rows in the order of time")
    step_s = float(np.median(np.diff(time_s)))
    if step_s > MAX_STEP_S:
        raise LogError(
            f"{path}: column {TIME}: rows are {step_s:g} s apart; give seconds, and at least one"
            f" row every {MAX_STEP_S:g} s"
        )
    wrong = out_of_order(time_s)
    if not wrong.any():
        return _Table(columns, time_s, tests, parameters, FileDamage(texts=tuple(damage)))
    lines_of_rows = np.array([number for number, _ in numbered[1:]])
    return _Table(
        quantities={name: values[~wrong] for name, values in columns.items()},
        time_s=time_s[~wrong],
        tests=[test for test, left_out in zip(tests, wrong, strict=True) if not left_out],
        parameters=parameters,
        damage=FileDamage(texts=(_format_left_out(lines_of_rows[wrong], time_s[wrong]), *damage)),
    )


def _format_left_out(lines: NDArray[np.int64], time_s: Array) -> str:
    """Return the rows that are left out because of their time."""
    rows = "1 row is" if lines.size == 1 else f"{lines.size} rows are"
    named = [f"line {line} ({time:.6g})" for line, time in zip(lines, time_s, strict=True)]
    more = ["..."] if len(named) > MAX_NAMED_LINES else []
    where = ", ".join([*named[:MAX_NAMED_LINES], *more])
    return f"{rows} left out because {TIME} does not fit the rows around: {where}"


def _without_empty_columns(table: _Table) -> _Table:
    """Return a table without the columns in which no row has a value."""
    columns = table.quantities.items()
    return table._replace(
        quantities={name: values for name, values in columns if np.any(np.isfinite(values))}
    )


def _columns(
    path: Path, names: Sequence[str], rows: Sequence[Sequence[str]], lines: Sequence[int]
) -> dict[str, Array]:
    """Return time and known quantities in SI units; NaN for an empty cell."""
    for row, line in zip(rows, lines, strict=True):
        if any(cell.strip() for cell in row[len(names) :]):
            raise LogError(
                f"{path}: line {line}: has {len(row)} cells, the header {len(names)}; separate"
                " cells by commas and write decimals with a point"
            )
    columns = {}
    for index, name in enumerate(names):
        known = [
            (quantity, factor)
            for quantity, units in _UNITS.items()
            for suffix, factor in units.items()
            if name == quantity + suffix
        ]
        if name == TIME:
            known = [(TIME, 1.0)]
        for quantity, factor in known:
            if quantity in columns:
                raise LogError(f"{path}: {quantity} is given in two units")
            values = [
                _number(path, row, index, name, line) for row, line in zip(rows, lines, strict=True)
            ]
            columns[quantity] = factor * np.array(values)
            _check_unit(path, name, quantity, columns[quantity], factor)
            _check_range(path, name, quantity, columns[quantity], factor, lines)
    return columns


def _without_time(names: Sequence[str]) -> str:
    """Return why a header has no column of the time."""
    for separator, name in ((";", "semicolons"), ("\t", "tabs")):
        if any(separator in header for header in names):
            return f"cells are separated by {name}; write commas, and decimals with a point"
    other = next((name for name in names if name.lower().startswith("time")), "")
    return f"no column {TIME}" + (f" (time in seconds), but {other!r}" if other else "")


def _check_unit(path: Path, name: str, quantity: str, values: Array, factor: float) -> None:
    """Raise LogError for a column of values that cannot be in its unit."""
    known = values[np.isfinite(values)]
    if not known.size:
        return
    if quantity == "depth" and (high_m := float(np.quantile(known, UNIT_QUANTILE))) < MIN_DEPTH_M:
        raise LogError(
            f"{path}: column {name}: values of {high_m / factor:.6g}; depth is positive down, and"
            f" at least {MIN_DEPTH_M / factor:g} at the surface"
        )
    if quantity == "depth" and (jump_m := _median_jump_m(values)) > MAX_DEPTH_JUMP_M:
        raise LogError(
            f"{path}: column {name}: changes by {jump_m / factor:.3g} from value to value in the"
            " median; give metres, not millimetres"
        )
    if quantity == "u" and not np.any(known > 0.0):
        raise LogError(
            f"{path}: column {name}: no value above 0; give the speed forward as positive, or leave"
            " the column out"
        )
    if quantity == "heading":
        _check_wraps(path, name, known / factor, factor)
    if quantity not in _MAX_ABS:
        return
    finite = np.abs(known)
    large, limit = float(np.quantile(finite, UNIT_QUANTILE)), _MAX_ABS[quantity]
    if large > limit * (1.0 + 1e-9):
        raise LogError(
            f"{path}: column {name}: values of {large / factor:.6g}; at most {limit / factor:.4g}"
            " is possible in this unit"
        )
    if quantity == "thrust" and 0.0 < large <= MIN_THRUST:
        raise LogError(
            f"{path}: column {name}: values of {large / factor:.6g}; give percent of full thrust,"
            " not a fraction"
        )


def _check_wraps(path: Path, name: str, heading: Array, factor: float) -> None:
    """Raise LogError if a heading wraps as one in the other unit does, by 2 pi or 360."""
    turn, other = (2.0 * math.pi, "rad") if factor != 1.0 else (360.0, "deg")
    steps = np.abs(np.diff(heading)) / turn
    wraps = np.count_nonzero(np.abs(steps - 1.0) <= MAX_WRAP_ERROR)
    is_other = wraps == np.count_nonzero(steps > MAX_WRAP_ERROR) and np.ptp(heading) <= turn
    if is_other and wraps >= MIN_WRAPS:
        raise LogError(
            f"{path}: column {name}: wraps {wraps} times between {np.min(heading):.4g} and"
            f" {np.max(heading):.4g}: its values are in {other}; name it heading_{other}"
        )


def _median_jump_m(depth_m: Array) -> float:
    """Return the median size of the noise in a depth: of second differences over sqrt(6)."""
    known = depth_m[np.isfinite(depth_m)]
    return float(np.median(np.abs(np.diff(known, 2)))) / math.sqrt(6.0) if known.size > 2 else 0.0


def _check_tested_surfaces(path: Path, table: _Table) -> None:
    """Raise LogError for a tested surface without a column, too small, or in rad named deg."""
    tests = np.array(table.tests)
    for surface in ("rudder", "elevator"):
        tested = (tests == surface) | (tests == "both")
        if not tested.any():
            continue
        if surface not in table.quantities:
            raise LogError(
                f"{path}: column {TEST} marks tests of the {surface}, and there is no column"
                f" {surface}_deg or {surface}_rad"
            )
        commands_deg = np.degrees(table.quantities[surface][tested])
        known = commands_deg[np.isfinite(commands_deg)]
        range_deg = float(np.ptp(known)) if known.size else 0.0
        if math.radians(1.0) < range_deg < MIN_TEST_RANGE_DEG:
            raise LogError(
                f"{path}: the {surface} changes by {range_deg:.2g} deg in its tests, at least"
                f" {MIN_TEST_RANGE_DEG:g} needed: fly larger tests, or, if these are rad"
                f" ({math.degrees(range_deg):.2g} deg), name the column {surface}_rad"
            )


def _check_range(
    path: Path, name: str, quantity: str, values: Array, factor: float, lines: Sequence[int]
) -> None:
    """Raise LogError for a cell with a value that no vehicle can have."""
    if quantity not in _RANGES:
        return
    smallest, largest = _RANGES[quantity]
    impossible = np.flatnonzero((values < smallest) | (values > largest))
    if impossible.size:
        first = impossible[0]
        raise LogError(
            f"{path}: line {lines[first]}, column {name}: {values[first] / factor:.6g} is"
            f" impossible; give {smallest / factor:.6g} to {largest / factor:.6g}, or leave the"
            " cell empty"
        )


def _number(path: Path, row: Sequence[str], index: int, name: str, line: int) -> float:
    """Return the number in a cell; NaN for an empty one, and for ``nan``."""
    if index >= len(row):
        raise LogError(f"{path}: line {line}: has {len(row)} cells; column {name} is missing")
    text = row[index].strip()
    try:
        value = float(text) if text else math.nan
    except ValueError:
        raise LogError(f"{path}: line {line}, column {name}: {text!r} is no number") from None
    if math.isinf(value):
        raise LogError(
            f"{path}: line {line}, column {name}: {text!r} is impossible; leave a cell without a"
            " value empty"
        )
    return value


def _parameters(path: Path, lines: Sequence[str]) -> dict[str, float]:
    """Return the parameters in lines ``# NAME = VALUE``; a remark may have an equals sign too."""
    parameters = {}
    for number, line in enumerate(lines, start=1):
        if not line.startswith("#"):
            continue
        name, found, value = line.lstrip("# ").partition("=")
        name = name.strip()
        if not found:
            first = name.replace(":", " ").partition(" ")[0]
            if first in _PARAMETERS:
                raise LogError(
                    f"{path}: line {number}: {line.strip()!r} has no '='; write a parameter as"
                    f" '# {first} = VALUE'"
                )
            continue
        try:
            parameters[name] = float(value)
        except ValueError:
            if name in _PARAMETERS:
                raise LogError(
                    f"{path}: line {number}, {name}: {value.strip()!r} is no number"
                ) from None
    return parameters


def _present(table: _Table, names: Iterable[str]) -> list[str]:
    """Return the quantities that a file has."""
    return [name for name in names if name in table.quantities]


def _samples(path: Path, table: _Table, names: Sequence[str]) -> tuple[Array, dict[str, Array]]:
    """Return times and values of the rows in which all of ``names`` have a value."""
    values = np.stack([table.quantities[name] for name in names], axis=1)
    filled = np.all(np.isfinite(values), axis=1)
    repeated = int(np.count_nonzero(np.diff(table.time_s[filled]) == 0.0))
    if repeated > MAX_REPEATED * np.count_nonzero(filled):
        raise LogError(
            f"{path}: column {TIME}: {repeated} of {np.count_nonzero(filled)} rows with values of"
            f" {', '.join(names)} have the time of the row before; give times to 1 ms"
        )
    filled[filled] = strictly_increasing(table.time_s[filled])
    if np.count_nonzero(filled) < 2:
        raise LogError(f"{path}: fewer than two rows have values of {', '.join(names)}")
    return table.time_s[filled], {name: table.quantities[name][filled] for name in names}


def _attitude(path: Path, table: _Table) -> Attitude:
    """Return the attitude; rates that are not in the file are derivatives of the angles."""
    names = _present(table, ("heading", "pitch", "roll", "p", "q", "r"))
    time_s, values = _samples(path, table, names)
    still = np.zeros(time_s.size)
    roll, pitch = values.get("roll", still), values.get("pitch", still)
    yaw = np.unwrap(values.get("heading", still))
    p, q, r = body_rates(time_s, roll, pitch, yaw)
    return Attitude(
        time_s=time_s,
        roll_rad=roll,
        pitch_rad=pitch,
        yaw_rad=yaw,
        p_radps=values.get("p", p),
        q_radps=values.get("q", q),
        r_radps=values.get("r", r),
    )


def _actuators(path: Path, table: _Table, options: OutputOptions) -> Actuators:
    """Return the commands; channel numbers reorder and reverse the three columns."""
    if "thrust" not in table.quantities:
        raise LogError(f"{path}: no column thrust_pct; give the thrust in percent of full thrust")
    time_s, values = _samples(path, table, _present(table, ("rudder", "elevator", "thrust")))
    channels = options.channels or FIRST_THREE
    if max(abs(number) for number in channels) > len(FIRST_THREE):
        raise LogError(
            f"{path}: --servo-channels: a CSV file has the outputs 1 (rudder), 2 (elevator) and 3"
            " (thrust)"
        )
    columns = [values.get(name, np.zeros(time_s.size)) for name in ("rudder", "elevator", "thrust")]
    rudder, elevator, thrust = (
        math.copysign(1.0, number) * columns[abs(number) - 1] for number in channels
    )
    if not np.any(thrust > 0.0):
        raise LogError(
            f"{path}: column thrust_pct: no value above 0; give percent of full thrust, positive"
            " ahead, as it was in the tests"
        )
    return Actuators(
        time_s=time_s,
        rudder_rad=rudder,
        elevator_rad=elevator,
        thrust=thrust,
        travel_rad=travel_rad(table.parameters, options),
    )


def _depth(path: Path, table: _Table) -> Depth:
    """Return the depth; zero throughout for a vehicle without, such as a ship."""
    if "depth" not in table.quantities:
        return zero_depth(table.time_s)
    time_s, values = _samples(path, table, _present(table, ("depth", "depth_rate")))
    return Depth(
        time_s, values["depth"], values.get("depth_rate", derivative(time_s, values["depth"]))
    )


def _velocity(path: Path, table: _Table) -> Velocity:
    """Return the velocity in body axes; a component that is not in the file is NaN."""
    if "u" not in table.quantities:
        return Velocity()
    time_s, values = _samples(path, table, _present(table, ("u", "v", "w")))
    unknown = np.full(time_s.size, np.nan)
    u, v, w = (values.get(name, unknown) for name in ("u", "v", "w"))
    return Velocity(time_s, u, v, w, VelocitySource.COLUMN)


def _specific_force(path: Path, table: _Table) -> SpecificForce:
    """Return the acceleration, if the file has all three axes."""
    names = ("ax", "ay", "az")
    if any(name not in table.quantities for name in names):
        return SpecificForce()
    time_s, values = _samples(path, table, names)
    return SpecificForce(time_s, *(values[name] for name in names))


def _events(table: _Table) -> Iterable[LogEvent]:
    """Yield start and end of each range of rows with the same surface under test.

    After a restart they have the latest time before it, as the samples are left out until then.
    """
    previous, times_s = "", np.maximum.accumulate(table.time_s)
    for time_s, test in zip(times_s.tolist(), table.tests, strict=True):
        if test != previous and previous:
            yield LogEvent(time_s, TestEnded(StopReason.COMPLETE))
        if test != previous and test:
            yield LogEvent(time_s, TestStarted(_AXES[test], TestWave.MARKED))
        previous = test
