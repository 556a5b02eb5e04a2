"""A sweep as a request, and its dives in chunks.

The dives are numbered sample by sample, so that more samples append dives to a sweep and leave the
numbers of the first ones.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import NamedTuple, overload

from sysid.models.parameters import NAMES
from sysid.sweep import dives, points
from sysid.sweep.campaigns import SweepMission
from sysid.sweep.dives import Conditions, DiveChunk, DiveLimits, SweepDive, SweepGains
from sysid.sweep.points import ParameterRange, Sampler
from sysid.test_design.prior import DesignPrior
from sysid.trials import hash_of, source_hash

Levels = tuple[float, ...] | ParameterRange
"""Values of an input: each of them is flown, or samples of a range are."""


class SweepVehicle(NamedTuple):
    """A distribution of vehicles, and the sets of gains that fly them."""

    name: str
    prior: DesignPrior
    spread: float
    """Factor on the standard deviations; 0 flies the mean vehicle."""
    gains: tuple[SweepGains, ...]


class SweepRequest(NamedTuple):
    """A sweep: every combination is flown with every sample."""

    name: str
    """File name of the plan, for the command in each row."""
    vehicles: tuple[SweepVehicle, ...]
    missions: tuple[SweepMission, ...]
    conditions: Mapping[str, Levels]
    """Values of the fields of `Conditions`; a field that is missing has its default."""
    limits: DiveLimits = DiveLimits()
    sampler: Sampler = Sampler.SOBOL
    samples: int = 64
    repeats: int = 1
    """Number of dives of each combination and sample, with other noise."""
    seed: int = 1
    chunk: int = 8
    """Number of dives that a process flies at a time, and of rows of a part."""


class Chunks(Sequence[DiveChunk]):
    """The chunks of a sweep, each made when it is read: a sweep may have a million dives.

    Parameters
    ----------
    request : SweepRequest
        The sweep.
    """

    def __init__(self, request: SweepRequest) -> None:
        self._request = request
        self._ranges = {
            name: levels
            for name, levels in request.conditions.items()
            if isinstance(levels, ParameterRange)
        }
        grid = {
            name: levels
            for name, levels in request.conditions.items()
            if not isinstance(levels, ParameterRange)
        }
        self._combinations = [
            (vehicle, gains, mission, key, dict(zip(grid, values, strict=True)))
            for vehicle, gains, mission, key in _keyed(request)
            for values in product(*grid.values())
        ]
        self._points = points.draw(
            request.sampler, request.samples, len(self._ranges) + len(NAMES), request.seed
        )
        self._roots = {v.name: dives.root(v.prior, v.spread) for v in request.vehicles}

    @property
    def combinations(self) -> int:
        """Number of combinations of vehicle, gains, mission and listed values."""
        return len(self._combinations)

    @property
    def dives(self) -> int:
        """Number of dives."""
        return self._request.samples * self.combinations * self._request.repeats

    def __len__(self) -> int:
        """Return the number of chunks."""
        return -(-self.dives // self._request.chunk)

    @overload
    def __getitem__(self, index: int) -> DiveChunk: ...
    @overload
    def __getitem__(self, index: slice) -> list[DiveChunk]: ...
    def __getitem__(self, index: int | slice) -> DiveChunk | list[DiveChunk]:
        """Return one chunk or several."""
        if isinstance(index, slice):
            return [self[n] for n in range(*index.indices(len(self)))]
        if not 0 <= index < len(self):
            raise IndexError(index)
        first = index * self._request.chunk
        return self.of_dives(range(first, min(first + self._request.chunk, self.dives)))

    def of_dives(self, numbers: Sequence[int]) -> DiveChunk:
        """Return a chunk with these dives.

        Parameters
        ----------
        numbers : sequence of int
            Numbers of dives, from 0.

        Returns
        -------
        DiveChunk
            Inputs of the dives.
        """
        return DiveChunk(
            plan=self._request.name,
            limits=self._request.limits,
            source=source_hash(),
            dives=tuple(map(self._dive, numbers)),
        )

    def _dive(self, number: int) -> SweepDive:
        """Return the inputs of a dive: repeats vary fastest, samples slowest."""
        request = self._request
        others, repeat = divmod(number, request.repeats)
        sample, combination = divmod(others, self.combinations)
        vehicle, gains, mission, shared_key, listed = self._combinations[combination]
        point, count = self._points[sample], len(self._ranges)
        sampled = points.to_ranges(point[:count].tolist(), tuple(self._ranges.values()))
        values = listed | dict(zip(self._ranges, sampled, strict=True))
        return SweepDive(
            number=number,
            vehicle=vehicle.name,
            prior=vehicle.prior,
            spread=vehicle.spread,
            gains=gains,
            mission=mission,
            conditions=Conditions(**values),
            shared_key=shared_key,
            z=vehicle.prior.mean + self._roots[vehicle.name] @ points.to_normal(point[count:]),
            seed=request.seed,
            sample=sample,
            repeat=repeat,
        )


def _keyed(
    request: SweepRequest,
) -> Iterator[tuple[SweepVehicle, SweepGains, SweepMission, str]]:
    """Yield vehicle, gains, mission and their key for each combination of them."""
    for vehicle in request.vehicles:
        for gains in vehicle.gains:
            for mission in request.missions:
                shared = (vehicle.prior, vehicle.spread, gains, mission)
                yield vehicle, gains, mission, hash_of(shared)
