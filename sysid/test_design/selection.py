"""Which tests together tell most in the water time there is: begun with any pair, filled greedily;
the best of these then exchange one or two tests until nothing is gained."""

from collections.abc import Callable, Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sysid.data.segments import Plane
from sysid.test_design.information import Slopes
from sysid.test_design.safety_margins import Excursion
from sysid.test_design.simulate import Manoeuvre

Array = NDArray[np.float64]

N_STARTS = 5
"""Of the sets begun with each pair, how many are bettered. Of 20 000 made-up problems one in a
thousand then ended short of the best of all sets, by .04 of the criterion at most; with one
beginning it is one in a hundred, by .4."""

MIN_IMPROVEMENT = 1e-6
"""Of the criterion; less is no gain."""


class SizedTest(NamedTuple):
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


def select_tests(
    candidates: Sequence[SizedTest], known: Array, water_s: float, left: Criterion
) -> list[SizedTest]:
    """Tests that fit into ``water_s`` and leave least unknown beside ``known``, each plane's first
    one twice.

    Twice, because the two are flown to opposite sides: what differs between them is no small
    motion. No exchange gets far from a first pair, so each has its turn as that. Empty where no
    pair fits."""

    def rank(chosen: Sequence[SizedTest]) -> tuple[int, float]:
        return -len(planes(chosen)), left(total(chosen, known))

    pairs = [
        _add_pair([c, c], candidates, known, water_s, left)
        for c in candidates
        if 2.0 * c.water_s <= water_s
    ]
    begun = [_greedy_fill(chosen, candidates, known, water_s, left) for chosen in pairs]
    best = sorted(begun, key=rank)[:N_STARTS]
    return min(
        (_exchange(chosen, candidates, known, water_s, left) for chosen in best),
        key=rank,
        default=[],
    )


def total(chosen: Sequence[SizedTest], known: Array) -> Array:
    return known + sum((c.told for c in chosen), np.zeros_like(known))


def total_test_time_s(chosen: Sequence[SizedTest]) -> float:
    return sum(c.water_s for c in chosen)


def planes(chosen: Sequence[SizedTest]) -> set[Plane]:
    """Those that are tested."""
    return {plane for c in chosen for plane in c.manoeuvre.planes}


def has_repeats(chosen: Sequence[SizedTest]) -> bool:
    """Whether every plane that is tested at all has a test that is flown at least twice."""
    shapes = [c.manoeuvre for c in chosen]
    return planes(chosen) == {
        plane for shape in shapes if shapes.count(shape) > 1 for plane in shape.planes
    }


def _improvement_rate(
    c: SizedTest, so_far: Array, known_left: float, left: Criterion, times: int = 1
) -> float:
    """What a test takes from the criterion in a second of water."""
    return (known_left - left(so_far + times * c.told)) / (times * c.water_s)


def _add_pair(
    pair: Sequence[SizedTest],
    candidates: Sequence[SizedTest],
    known: Array,
    water_s: float,
    left: Criterion,
) -> list[SizedTest]:
    """``pair`` and, of each plane that it is not of, the most telling pair a second."""
    chosen = list(pair)
    for plane in sorted(planes(candidates) - planes(pair)):
        so_far = total(chosen, known)
        before = left(so_far)
        own = [c for c in candidates if plane in c.manoeuvre.planes]
        fits = [c for c in own if total_test_time_s(chosen) + 2.0 * c.water_s <= water_s]
        if fits:
            best = max(fits, key=lambda c: _improvement_rate(c, so_far, before, left, 2))
            chosen += [best, best]
    return chosen


def _greedy_fill(
    chosen: Sequence[SizedTest],
    candidates: Sequence[SizedTest],
    known: Array,
    water_s: float,
    left: Criterion,
) -> list[SizedTest]:
    """The most telling test a second, again and again, while one fits."""
    full = list(chosen)
    while fits := [c for c in candidates if total_test_time_s(full) + c.water_s <= water_s]:
        so_far = total(full, known)
        before = left(so_far)
        full.append(max(fits, key=lambda c: _improvement_rate(c, so_far, before, left)))
    return full


def _exchange(
    chosen: Sequence[SizedTest],
    candidates: Sequence[SizedTest],
    known: Array,
    water_s: float,
    left: Criterion,
) -> list[SizedTest]:
    """By the best of all exchanges, again and again, until none betters it."""
    best = list(chosen)
    least = left(total(best, known))
    while True:
        others = list(_exchanges(best, candidates, known, water_s, left))
        telling = [left(total(other, known)) for other in others]
        if min(telling, default=least) > least - MIN_IMPROVEMENT:
            return best
        least = min(telling)
        best = others[telling.index(least)]


def _exchanges(
    chosen: Sequence[SizedTest],
    candidates: Sequence[SizedTest],
    known: Array,
    water_s: float,
    left: Criterion,
) -> Iterator[list[SizedTest]]:
    """Every set with another test for one or two of its own, and with what then fits."""
    kept = {}
    for count in (1, 2):
        for out in combinations(range(len(chosen)), count):
            kept[tuple(sorted(id(chosen[n]) for n in out))] = [
                c for n, c in enumerate(chosen) if n not in out
            ]
    for rest in kept.values():
        for c in candidates:
            if total_test_time_s(rest) + c.water_s <= water_s:
                full = _greedy_fill([*rest, c], candidates, known, water_s, left)
                if has_repeats(full):
                    yield full
