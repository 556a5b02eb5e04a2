"""Which tests together tell most in the water time there is: begun with any pair, filled greedily, then exchanged until
nothing is gained."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.experiment.excursions import Excursion
from sysid.experiment.information import Slopes
from sysid.experiment.manoeuvre import Manoeuvre
from sysid.runs import Plane

Array = NDArray[np.float64]


class Candidate(NamedTuple):
    """A test at the size that limits allow."""

    manoeuvre: Manoeuvre
    excursion: Excursion
    told: Array
    """Information about z."""
    water_s: float
    """Of the test and of the recovery after it."""
    elevator: Excursion | None = None
    """In pitch, of a test of both surfaces; ``excursion`` is then that in yaw."""


Criterion = Callable[[Array], float]
"""Of an information matrix; smaller is better."""


def criterion(slopes: dict[Plane, Slopes], judge: Callable[[Slopes, Array], float]) -> Criterion:
    """Both planes' together."""

    def of_information(total: Array) -> float:
        covariance = np.asarray(np.linalg.inv(total), dtype=np.float64)
        return sum([judge(slope, covariance) for slope in slopes.values()])

    return of_information


def choose(candidates: Sequence[Candidate], known: Array, water_s: float, left: Criterion) -> list[Candidate]:
    """Tests that fit into ``water_s`` and leave least unknown beside ``known``, each plane's first one twice.

    Twice, because the two are flown to opposite sides: what differs between them is no small motion. No exchange of one
    test gets past a first pair, so each has its turn as that. Empty where no pair fits.
    """
    pairs = [[c, c] for c in candidates if 2.0 * c.water_s <= water_s]
    sets = [_completed(pair, candidates, known, water_s, left) for pair in pairs]
    return min(sets, key=lambda chosen: (-len(planes(chosen)), left(total(chosen, known))), default=[])


def _completed(
    pair: Sequence[Candidate], candidates: Sequence[Candidate], known: Array, water_s: float, left: Criterion
) -> list[Candidate]:
    chosen = _paired_up(pair, candidates, known, water_s, left)
    chosen = _filled(chosen, candidates, known, water_s, left)
    while (better := _exchanged(chosen, candidates, known, water_s, left)) is not None:
        chosen = _filled(better, candidates, known, water_s, left)
    return chosen


def total(chosen: Sequence[Candidate], known: Array) -> Array:
    return known + sum((c.told for c in chosen), np.zeros_like(known))


def water_of(chosen: Sequence[Candidate]) -> float:
    return sum(c.water_s for c in chosen)


def planes(chosen: Sequence[Candidate]) -> set[Plane]:
    """Those that are tested."""
    return {plane for c in chosen for plane in c.manoeuvre.planes}


def paired(chosen: Sequence[Candidate]) -> bool:
    """Whether every plane that is tested at all has a test that is flown at least twice."""
    shapes = [c.manoeuvre for c in chosen]
    return planes(chosen) == {plane for shape in shapes if shapes.count(shape) > 1 for plane in shape.planes}


def _rate(c: Candidate, so_far: Array, known_left: float, left: Criterion, times: int = 1) -> float:
    """What a test takes from the criterion in a second of water."""
    return (known_left - left(so_far + times * c.told)) / (times * c.water_s)


def _paired_up(
    pair: Sequence[Candidate], candidates: Sequence[Candidate], known: Array, water_s: float, left: Criterion
) -> list[Candidate]:
    """``pair`` and, of each plane that it is not of, the most telling pair a second."""
    chosen = list(pair)
    for plane in sorted(planes(candidates) - planes(pair)):
        so_far = total(chosen, known)
        before = left(so_far)
        own = [c for c in candidates if plane in c.manoeuvre.planes]
        fits = [c for c in own if water_of(chosen) + 2.0 * c.water_s <= water_s]
        if fits:
            best = max(fits, key=lambda c: _rate(c, so_far, before, left, 2))
            chosen += [best, best]
    return chosen


def _filled(
    chosen: Sequence[Candidate], candidates: Sequence[Candidate], known: Array, water_s: float, left: Criterion
) -> list[Candidate]:
    """The most telling test a second, again and again, while one fits."""
    full = list(chosen)
    while fits := [c for c in candidates if water_of(full) + c.water_s <= water_s]:
        so_far = total(full, known)
        before = left(so_far)
        full.append(max(fits, key=lambda c: _rate(c, so_far, before, left)))
    return full


def _exchanged(
    chosen: Sequence[Candidate], candidates: Sequence[Candidate], known: Array, water_s: float, left: Criterion
) -> list[Candidate] | None:
    """The best of all exchanges of one test for another that betters the set; None without one."""
    so_far, used_s = total(chosen, known), water_of(chosen)
    best, least = None, left(so_far) - 1e-6
    for out in {id(c): n for n, c in enumerate(chosen)}.values():
        rest = [*chosen[:out], *chosen[out + 1 :]]
        for c in candidates:
            if used_s - chosen[out].water_s + c.water_s > water_s or not paired([*rest, c]):
                continue
            now = left(so_far - chosen[out].told + c.told)
            if now < least:
                best, least = [*rest, c], now
    return best
