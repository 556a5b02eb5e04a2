"""The engine of the studies: cells that evaluate the same campaigns."""

from benchmarks import study
from benchmarks.study import Cell


def test_trials_of_a_seed_run_one_after_the_other() -> None:
    calls = list[tuple[str, int]]()

    def first(case: str, seed: int) -> list[float]:
        calls.append(("first", seed))
        return [seed, 1.0]

    def second(case: str, seed: int) -> list[float]:
        calls.append(("second", seed))
        return [10.0 * seed]

    cells = [
        Cell(name, "about", trial, lambda case, rows: [], campaigns="same")
        for name, trial in (("first", first), ("second", second))
    ]
    alone = Cell("alone", "about", first, lambda case, rows: [])
    assert study.with_same_campaigns([(cell, "a") for cell in (*cells, alone)]) == [
        ("same", "a", cells),
        ("alone", "a", [alone]),
    ]
    rows = study.run_trials({cells[0]: range(1, 4), cells[1]: range(1, 3)}, "a")
    assert rows[cells[0]].tolist() == [[1.0, 1.0], [2.0, 1.0], [3.0, 1.0]]
    assert rows[cells[1]].tolist() == [[10.0], [20.0]]
    assert calls == [("first", 1), ("second", 1), ("first", 2), ("second", 2), ("first", 3)]
