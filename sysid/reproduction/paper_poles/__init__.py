"""The paper's Table 4: dominant poles of its nine loops by our own means, and which tailcone its
printed ones ask for.

The paper gives neither the mass nor which form of delay it used, and prints the actuator's transfer
function garbled. ``rows`` reckons the table for a given tailcone, ``readings`` looks for the
tailcone that explains all nine rows best, ``single_pole_conditions`` for what each row asks for by
itself."""

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
