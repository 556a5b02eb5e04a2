"""The paper's Table 4: dominant poles of its nine loops by our own means, and which tailcone its
printed ones ask for.

The paper gives neither the mass nor which form of delay it used, and prints the actuator's transfer
function garbled. ``rows`` reckons the table for a given tailcone, ``readings`` looks for the
tailcone that explains all nine rows best, ``alone`` for what each row asks for by itself."""

from sysid.reproduction.paper_poles.conditions import Alone, alone
from sysid.reproduction.paper_poles.poles import (
    CASES,
    LAG,
    LOOPS,
    Case,
    Row,
    closed,
    dominant,
    models,
    of_case,
    opened,
    pole,
    printed,
    rows,
)
from sysid.reproduction.paper_poles.search import FORMS, Form, Reading, Search, readings

__all__ = [
    "CASES",
    "FORMS",
    "LAG",
    "LOOPS",
    "Alone",
    "Case",
    "Form",
    "Reading",
    "Row",
    "Search",
    "alone",
    "closed",
    "dominant",
    "models",
    "of_case",
    "opened",
    "pole",
    "printed",
    "readings",
    "rows",
]
