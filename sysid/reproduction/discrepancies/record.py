"""Record of one garbled place, and the computed results that its evidence uses."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from sitl.vehicle.slender_body import Derivation
from sysid.reproduction.paper_poles import SinglePoleCondition, TransferReading


class Discrepancy(NamedTuple):
    """One place of the paper."""

    place: str
    printed: str
    reading: str
    """Proposed reading, or the reason of the contradiction."""
    evidence: str
    """Computed numbers in words."""
    values: dict[str, float]
    """Computed numbers by name, with the unit in the name."""
    confirmed: bool
    """Whether the numbers support the reading."""


class Sources(NamedTuple):
    """Computed results that the evidence uses."""

    steps: Mapping[str, Derivation]
    """Steps of the first-principles derivation, by symbol."""
    readings: Sequence[TransferReading]
    alone: Sequence[SinglePoleCondition]
