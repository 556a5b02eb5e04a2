"""`docs/performance.md` is what its generator makes of the committed figures."""

from benchmarks import page
from benchmarks.speed.results import Conditions, Machine, Measurement, Reference, Results, to_figure
from benchmarks.speed.rows import ROWS, Mode

MACHINE = Machine(2, "a processor", "Linux x86_64", "3.11.7", "2.0", "0.68")


def page_of(*measured: Measurement, mode: Mode = Mode.IDLE, other_cores: float | None = 0.0) -> str:
    conditions = Conditions("2026-01-02T03:04:05Z", "abc1234", 0.5, 1.5, other_cores)
    figures = tuple(to_figure(each, mode, conditions) for each in measured)
    return page.text({mode: Results(mode, MACHINE, figures)})


def test_committed_page_is_that_of_committed_figures() -> None:
    assert page.PAGE.read_text(encoding="utf-8") == page.text(page.read()), (
        "run `python -m benchmarks.page`"
    )


def test_page_explains_every_row() -> None:
    text = page_of()
    for name, row in ROWS.items():
        assert f"### {name}\n" in text
        assert row.method in text.replace("\n", " ")


def test_page_names_machine_date_revision_and_load() -> None:
    text = page_of(Measurement("campaign", (20.0,))).replace("\n", " ")
    assert "2 cores, a processor, Linux x86_64, Python 3.11.7, numpy 2.0, numba 0.68" in text
    assert "2026-01-02, revision abc1234; load average of the last minute 0.5 to 1.5, cores" in text


def test_page_warns_when_other_programs_ran() -> None:
    measured, warning = Measurement("campaign", (20.0,)), "**Other programs used the machine"
    assert warning in page_of(measured, other_cores=0.9)
    assert warning not in page_of(measured, other_cores=0.1)
    assert warning not in page_of(measured, other_cores=None)


def test_page_counts_and_marks_missed_targets() -> None:
    floor = Reference("ping-pong", (10.0,))
    text = page_of(Measurement("campaign", (20.0,)), Measurement("dive-tick", (60.0,), floor))
    assert "1 of 2 targets are met." in text
    assert "| 60 us | ping-pong: 10 us | 6 | ratio at most 5 | **no** |" in text
    assert "| 20 s |  |  | at most 25 | yes |" in text


def test_page_shows_rows_that_were_not_measured() -> None:
    text = page_of(Measurement("closed-loop-20ms", (), note="not built"))
    title = ROWS["closed-loop-20ms"].title
    assert f"| `closed-loop-20ms` | {title} | not built |" in text
    assert f"| `campaign` | {ROWS['campaign'].title} | not measured |" in text


def test_page_shows_mode_that_was_not_measured() -> None:
    assert "## Busy machine\n\nNot measured yet.\n" in page_of()


def test_page_has_parts_of_a_value_by_mode() -> None:
    text = page_of(Measurement("campaign", (20.0,), details={"starting: wall time": 1.25}))
    assert "| part | idle |\n|---|---|\n| starting: wall time | 1.25 |" in text
