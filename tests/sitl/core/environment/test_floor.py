"""The sea floor: planes, grids, invalid files, and sonar beams compared with geometry."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl import bathymetry
from sitl.core.environment import floor
from sitl.environment_schema import FloorTable
from sitl.scenario_types import ScenarioError

HEADER = "ncols 3\nnrows 2\nxllcorner -15\nyllcorner -10\ncellsize 10\nNODATA_value -9999\n"
GRID = HEADER + "-10 -12 -14\n-20 -22 -24\n"
DOWN = (0.0, 0.0, -1.0)


def written(folder: Path, text: str) -> Path:
    path = folder / "floor.asc"
    path.write_text(text)
    return path


def gridded(folder: Path, text: str = GRID) -> floor.SeaFloor:
    return floor.build(FloorTable(file=str(written(folder, text))))


def test_grid_rows_run_north_to_south_from_cell_corner(
    tmp_path: Path,
) -> None:
    """Nodes are at cell centres: 10 m west to 10 m east of the site, 5 m south to 5 m north."""
    grid = bathymetry.read(written(tmp_path, GRID))
    assert (grid.south_m, grid.west_m, grid.cell_m) == (-5.0, -10.0, 10.0)
    np.testing.assert_array_equal(grid.height_m, [[-20.0, -22.0, -24.0], [-10.0, -12.0, -14.0]])


def test_grid_height_is_bilinear_and_level_outside(tmp_path: Path) -> None:
    """The floor rises 1 m per metre north and falls 0.2 m per metre east; west is positive."""
    ground = gridded(tmp_path)
    assert floor.height_and_slope(ground, 0.0, 0.0) == pytest.approx((-17.0, 1.0, 0.2))
    assert floor.height_and_slope(ground, 2.5, -5.0) == pytest.approx((-15.5, 1.0, 0.2))
    assert floor.height_and_slope(ground, 80.0, 0.0) == pytest.approx((-12.0, 0.0, 0.2))
    assert floor.height_and_slope(ground, 80.0, 80.0) == pytest.approx((-10.0, 0.0, 0.0))


def test_slope_deepens_in_given_direction() -> None:
    ground = floor.build(FloorTable(depth_m=20.0, slope_deg=10.0, deepens_towards_deg=90.0))
    fall = math.tan(math.radians(10.0))
    assert floor.height_and_slope(ground, 33.0, -5.0)[0] == pytest.approx(-20.0 - 5.0 * fall)
    normal = floor.normal(*floor.height_and_slope(ground, 0.0, 0.0)[1:])
    assert normal == pytest.approx(
        (0.0, -math.sin(math.radians(10.0)), math.cos(math.radians(10.0))), abs=1e-15
    )


@given(st.floats(0.0, 45.0), st.floats(0.0, 360.0), st.floats(-0.9, 0.9), st.floats(-0.9, 0.9))
def test_beam_ends_on_slope(slope: float, towards: float, north: float, west: float) -> None:
    ground = floor.build(FloorTable(depth_m=20.0, slope_deg=slope, deepens_towards_deg=towards))
    origin = np.array([1.0, 2.0, -5.0])
    along = np.array([north, west, -1.0]) / math.hypot(north, west, 1.0)
    distance = floor.range_m(ground, tuple(origin), tuple(along))
    if math.isfinite(distance):
        end = origin + distance * along
        assert end[2] == pytest.approx(floor.height_and_slope(ground, end[0], end[1])[0], abs=1e-9)
    else:
        far = origin + 1e4 * along
        assert far[2] > floor.height_and_slope(ground, far[0], far[1])[0]


@given(st.floats(-12.0, 12.0), st.floats(-12.0, 12.0), st.floats(-0.9, 0.9), st.floats(-0.9, 0.9))
def test_beam_ends_at_first_hit_on_grid(
    tmp_path_factory: pytest.TempPathFactory, x: float, y: float, north: float, west: float
) -> None:
    ground = gridded(tmp_path_factory.mktemp("grid"), HEADER + "-10 -18 -11\n-20 -12 -24\n")
    origin = np.array([x, y, -2.0])
    along = np.array([north, west, -1.0]) / math.hypot(north, west, 1.0)
    distance = floor.range_m(ground, tuple(origin), tuple(along))
    ends = origin + np.linspace(0.0, 1.0, 50)[:, None] * distance * along
    above = [end[2] - floor.height_and_slope(ground, end[0], end[1])[0] for end in ends]
    assert above[-1] == pytest.approx(0.0, abs=1e-6)
    assert min(above[:-1]) > 0.0


def test_upward_beam_hits_only_steep_floor(tmp_path: Path) -> None:
    flat, ground = floor.build(FloorTable(depth_m=20.0)), gridded(tmp_path)
    level, climbing = (1.0, 0.0, 0.0), (math.cos(0.1), 0.0, math.sin(0.1))
    assert floor.range_m(flat, (0.0, 0.0, -5.0), level) == math.inf
    assert floor.range_m(flat, (0.0, 0.0, -5.0), (0.0, 0.0, 1.0)) == math.inf
    assert floor.range_m(ground, (0.0, 0.0, -5.0), level) == math.inf
    assert floor.range_m(ground, (0.0, 0.0, -15.0), level) == pytest.approx(2.0)
    assert floor.range_m(ground, (0.0, 0.0, -15.0), climbing) == pytest.approx(
        2.0 / (math.cos(0.1) - math.sin(0.1))
    )
    assert floor.range_m(flat, (0.0, 0.0, -5.0), DOWN) == pytest.approx(15.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (GRID.replace("ncols 3", "ncols 4"), "row 1: expected ncols = 4 heights, found 3"),
        (GRID.replace("nrows 2", "nrows 3"), "nrows = 3: expected as many rows, found 2"),
        (GRID.replace("nrows 2", "nrows 1"), "nrows = 1: expected a whole number, 2 or more"),
        (GRID.replace("cellsize 10", "cellsize 0"), "cellsize = 0: expected metres, more than 0"),
        (GRID.replace("cellsize 10\n", ""), "cellsize: missing key"),
        (GRID.replace("yllcorner", "yllcenter"), "yllcorner: missing key"),
        (GRID.replace("cellsize", "cell"), "cell: unknown key; known here: ncols, nrows"),
        (GRID.replace("-22", "deep"), "row 2 = 'deep': expected a number"),
        (GRID.replace("-22", "-9999"), "row 2, column 2: no data; expected a height everywhere"),
        (
            GRID.replace("-22", "22"),
            "row 2, column 2: 22: expected a height below the surface, negative",
        ),
    ],
)
def test_invalid_floor_file_error_names_place(tmp_path: Path, text: str, message: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(ScenarioError) as caught:
        bathymetry.read(path)
    assert str(caught.value).startswith(f"floor {path}: {message}")


def test_missing_floor_file_error_names_file(tmp_path: Path) -> None:
    with pytest.raises(
        ScenarioError, match=r"none\.asc: No such file or directory; expected an ESRI ASCII grid"
    ):
        bathymetry.read(tmp_path / "none.asc")
