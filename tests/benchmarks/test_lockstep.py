"""The benchmark of recorded dives: its output text, and its load processes."""

from benchmarks import lockstep


def test_in_words_gives_median_and_range() -> None:
    text = lockstep.in_words([30.0, 90.0, 60.0], 300.0)
    assert "3 dives: median 60 x real time (30 to 90)" in text
    assert "300 x; ratio 0.20" in text


def test_busy_loops_run_until_the_context_ends() -> None:
    with lockstep.busy_loops(2) as loops:
        assert [loop.poll() for loop in loops] == [None, None]
    assert all(loop.poll() is not None for loop in loops)
