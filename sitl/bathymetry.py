"""Sea floors from files: ESRI ASCII grids (.asc), in metres east and north of the scenario's site.

Format: Esri, "ASCII raster format": a header of keys and numbers, then one line of heights per grid
row, from north to south.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mavlink_io.text_files import read_text
from sitl.scenario_types import ScenarioError

_CORNER = ("xllcorner", "yllcorner")
_CENTRE = ("xllcenter", "yllcenter")
_REQUIRED = ("ncols", "nrows", "cellsize")


class Grid(NamedTuple):
    """Heights of the sea floor at the nodes of a square grid."""

    height_m: NDArray[np.float64]
    """Height above the still surface (negative); rows south to north, columns west to east."""
    south_m: float
    """Position of the southernmost row, m north of the site."""
    west_m: float
    """Position of the westernmost column, m east of the site."""
    cell_m: float
    """Distance between adjacent nodes."""


def read(path: Path) -> Grid:
    """Read a grid file.

    Raises
    ------
    ScenarioError
        The file cannot be used; the message names the file, the fault and the expected content.
    """
    try:
        lines = read_text(path, "ascii").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not ASCII text"
        raise ScenarioError(f"floor {path}: {reason}; expected an ESRI ASCII grid") from None
    header = _header(path, lines)
    rows = _rows(path, lines[len(header) :], header)
    cell_m = header["cellsize"]
    half_m = cell_m / 2 if _CORNER[0] in header else 0.0
    x, y = _CORNER if _CORNER[0] in header else _CENTRE
    return Grid(
        height_m=rows[::-1].copy(),
        south_m=header[y] + half_m,
        west_m=header[x] + half_m,
        cell_m=cell_m,
    )


def _header(path: Path, lines: list[str]) -> dict[str, float]:
    """Parse and check the lines of the header."""
    header: dict[str, float] = {}
    for line in lines:
        key, *value = line.split() or [""]
        if not key[:1].isalpha():
            break
        known = (*_REQUIRED, *_CORNER, *_CENTRE, "nodata_value")
        if key.lower() not in known:
            raise ScenarioError(f"floor {path}: {key}: unknown key; known here: {', '.join(known)}")
        header[key.lower()] = _number(path, key, " ".join(value))
    corner = _CORNER if _CORNER[0] in header or _CORNER[1] in header else _CENTRE
    for key in (*_REQUIRED, *corner):
        if key not in header:
            raise ScenarioError(f"floor {path}: {key}: missing key")
    for key, minimum in (("ncols", 2), ("nrows", 2)):
        if header[key] < minimum or header[key] != round(header[key]):
            raise ScenarioError(
                f"floor {path}: {key} = {header[key]:g}: expected a whole number, {minimum} or more"
            )
    if header["cellsize"] <= 0.0:
        raise ScenarioError(
            f"floor {path}: cellsize = {header['cellsize']:g}: expected metres, more than 0"
        )
    return header


def _number(path: Path, key: str, text: str) -> float:
    """Parse a finite number.

    Raises ScenarioError.
    """
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        raise ScenarioError(f"floor {path}: {key} = {text!r}: expected a number")
    return value


def _rows(path: Path, lines: list[str], header: dict[str, float]) -> NDArray[np.float64]:
    """Parse and check the heights, shape (nrows, ncols), north to south."""
    shape = round(header["nrows"]), round(header["ncols"])
    rows = [line.split() for line in lines if line.strip()]
    if len(rows) != shape[0]:
        raise ScenarioError(
            f"floor {path}: nrows = {shape[0]}: expected as many rows, found {len(rows)}"
        )
    for number, row in enumerate(rows, 1):
        if len(row) != shape[1]:
            raise ScenarioError(
                f"floor {path}: row {number}: expected ncols = {shape[1]} heights, found {len(row)}"
            )
    heights = np.array(
        [[_number(path, f"row {n}", text) for text in row] for n, row in enumerate(rows, 1)]
    )
    if (heights == header.get("nodata_value", -9999.0)).any():
        row, column = np.argwhere(heights == header.get("nodata_value", -9999.0))[0] + 1
        raise ScenarioError(
            f"floor {path}: row {row}, column {column}: no data; expected a height everywhere"
        )
    if (heights >= 0.0).any():
        row, column = np.argwhere(heights >= 0.0)[0] + 1
        raise ScenarioError(
            f"floor {path}: row {row}, column {column}: {heights[row - 1, column - 1]:g}: "
            "expected a height below the surface, negative"
        )
    return heights
