"""All cells of the study by name."""

from benchmarks.identification import efficiency, screening
from benchmarks.identification.convergence import CONVERGENCE
from benchmarks.identification.excitation import EXCITATION
from benchmarks.identification.joint_time import JOINT_TIME
from benchmarks.identification.judging import JUDGING
from benchmarks.identification.linear_time import TIME as LINEAR_TIME
from benchmarks.identification.online import ONLINE
from benchmarks.identification.outside import OUTSIDE
from benchmarks.identification.prediction import PREDICTION
from benchmarks.study import Cell

CELLS: dict[str, Cell] = {
    cell.name: cell
    for cell in (
        OUTSIDE,
        *efficiency.CELLS,
        CONVERGENCE,
        LINEAR_TIME,
        PREDICTION,
        JOINT_TIME,
        EXCITATION,
        JUDGING,
        ONLINE,
        *screening.CELLS,
    )
}
