"""Garbled, inconsistent and wrong places of the paper, each with evidence that is computed here.

A place is settled by numbers: what the print gives, what the proposed reading gives, and what the
paper's own tables or statements require. `confirmed` states whether the numbers support the
reading. Axes and symbols are the paper's (x forward, y port, z up).
"""

from sysid.reproduction.discrepancies import (
    hydrodynamics,
    linear_model,
    rigid_body,
    tables,
    tailcone,
)
from sysid.reproduction.discrepancies.record import Discrepancy, Sources

__all__ = ["Discrepancy", "Sources", "all_discrepancies"]


def all_discrepancies(sources: Sources) -> list[Discrepancy]:
    """Return every place with its evidence, in the order of the paper.

    Parameters
    ----------
    sources : Sources
        Derivation of Table 1 and search for the tailcone behind Table 4.

    Returns
    -------
    list of Discrepancy
        Places with computed evidence.
    """
    return [
        *rigid_body.places(),
        *hydrodynamics.places(sources),
        *tailcone.places(),
        *linear_model.places(),
        *tables.places(sources),
    ]
