"""Every cell of the study by name."""

from benchmarks.identification import efficiency, screening
from benchmarks.identification.prediction import PREDICTION
from benchmarks.identification.study import Cell

CELLS: dict[str, Cell] = {cell.name: cell for cell in (*efficiency.CELLS, PREDICTION, *screening.CELLS)}
