"""All cells of the study by name."""

from benchmarks.identification import efficiency, screening, vehicles
from benchmarks.identification.convergence import CONVERGENCE
from benchmarks.identification.excitation import EXCITATION
from benchmarks.identification.joint_time import JOINT_TIME
from benchmarks.identification.judging import JUDGING
from benchmarks.identification.linear_time import TIME as LINEAR_TIME
from benchmarks.identification.online import ONLINE
from benchmarks.identification.online_outside import ONLINE_OUTSIDE
from benchmarks.identification.outside import OUTSIDE
from benchmarks.identification.outside_drawn import OUTSIDE_DRAWN
from benchmarks.identification.prediction import PREDICTION
from benchmarks.identification.verdicts import VERDICTS
from benchmarks.study import Cell

CELLS: dict[str, Cell] = {
    cell.name: cell
    for cell in (
        OUTSIDE,
        OUTSIDE_DRAWN,
        VERDICTS,
        *efficiency.CELLS,
        CONVERGENCE,
        LINEAR_TIME,
        PREDICTION,
        JOINT_TIME,
        EXCITATION,
        JUDGING,
        ONLINE,
        ONLINE_OUTSIDE,
        *screening.CELLS,
    )
}


def cases_of(cell: Cell) -> tuple[str, ...]:
    """Return the cases of a cell: its own, or the vehicles of the study."""
    return cell.cases or tuple(case.name for case in vehicles.cases())
