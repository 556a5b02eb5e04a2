"""Table 4 of the paper: dominant poles of its nine loops, and the tailcone that they imply.

The paper states neither the mass nor the form of its delay, and the actuator's transfer function is
printed incorrectly. ``rows`` computes the table for a given tailcone, ``readings`` finds the
tailcone that explains all nine rows best, ``single_pole_conditions`` gives the delay and the gain
that each row implies.
"""

from sysid.reproduction.paper_poles.conditions import SinglePoleCondition, single_pole_conditions
from sysid.reproduction.paper_poles.poles import (
    CASES,
    LAG,
    LOOPS,
    Case,
    PoleRow,
    close_case,
    close_loop,
    dominant,
    models,
    open_loop,
    pole,
    printed_cases,
    rows,
)
from sysid.reproduction.paper_poles.search import (
    FORMS,
    Form,
    TailconeSearch,
    TransferReading,
    readings,
)

__all__ = [
    "CASES",
    "FORMS",
    "LAG",
    "LOOPS",
    "Case",
    "Form",
    "PoleRow",
    "SinglePoleCondition",
    "TailconeSearch",
    "TransferReading",
    "close_case",
    "close_loop",
    "dominant",
    "models",
    "open_loop",
    "pole",
    "printed_cases",
    "readings",
    "rows",
    "single_pole_conditions",
]
