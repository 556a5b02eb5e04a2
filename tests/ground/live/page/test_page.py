"""The live page in a real browser: it moves, keeps its layout, and asks its own server only."""

import threading
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from ground.client.vehicle import StatusText
from ground.live.page import server
from ground.live.page.page_state import PageState
from ground.live.page.server import PageServer
from mavlink_io.mission_items import FENCE_TYPE, MavCmd, MissionItem
from tests.browser import HEIGHT_TOLERANCE_PX, WINDOWS_PX, Page, needs_chromium, opened
from tests.ground.live.page.telemetry import heartbeat, motion
from tests.helpers.subprocesses import wait_for

LOCAL = 1
PICTURES = """
return Object.fromEntries([...document.querySelectorAll('.chart')].map(
  chart => [chart.id, chart.querySelector('canvas').toDataURL()]));
"""
ESTIMATE = {
    "trouble": "",
    "planes": [
        {"plane": plane, "testing": not enough, "enough": enough, "verdict": verdict, "rows": []}
        for plane, enough, verdict in (
            ("heading", True, "you may stop"),
            ("pitch", False, "phase to +-5 deg"),
        )
    ],
}
WAYPOINTS = [
    MissionItem(n, LOCAL, MavCmd.NAV_WAYPOINT, x=300_000 * n, y=100_000 * n) for n in range(3)
]
FENCE = MissionItem(0, LOCAL, MavCmd.NAV_FENCE_CIRCLE_INCLUSION, p1=60.0, mission_type=FENCE_TYPE)


class Flight:
    """A page server with a vehicle that dives in a circle until it is stopped."""

    def __init__(self) -> None:
        self.state, self.listener = PageState(), server.listen(port=None)
        self.server = PageServer(self.state, self.listener)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._fly)

    def __enter__(self) -> "Flight":
        with self.state.dive("circle") as dive:
            dive.items, dive.estimate = [*WAYPOINTS, FENCE], ESTIMATE
            dive.on_text(StatusText(4, "A <b>warning</b>"))
        self.server.__enter__()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
        self.server.__exit__(None, None, None)

    def _fly(self) -> None:
        time_s = 0.0
        while not self._stop.wait(0.05):
            time_s += 0.5
            with self.state.dive("circle") as dive:
                for received in (heartbeat(), *motion(time_s)):
                    dive.on_frame(received)


@pytest.fixture(scope="module")
def flight() -> Iterator[Flight]:
    with Flight() as flight:
        yield flight


@pytest.fixture(scope="module")
def shown(flight: Flight, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    profile = tmp_path_factory.mktemp("live") / "profile"
    with opened(server.url(flight.listener), profile) as page:
        yield page


@needs_chromium
@pytest.mark.process
@pytest.mark.timeout(240)
class LivePageTestCase:
    def test_every_picture_moves(self, shown: Page) -> None:
        wait_for(lambda: shown.text("mode") != "–")
        before = shown.run(PICTURES)
        moving = set(before) - {"thrust"}  # constant
        wait_for(lambda: all(shown.run(PICTURES)[key] != before[key] for key in moving))
        assert moving == {"hull", "map", "depth", "heading", "pitch", "surfaces"}

    def test_page_shows_state_texts_and_estimate(self, shown: Page) -> None:
        wait_for(lambda: shown.text("armed") == "ARMED")
        assert shown.text("link") == "link good"
        assert shown.text("texts").startswith("A <b>warning</b>")
        planes = shown.text("planes")
        assert "Enough: you may stop" in planes
        assert "Continue: phase to +-5 deg" in planes

    def test_rounded_angles_have_no_sign_of_zero(self, shown: Page) -> None:
        wait_for(lambda: shown.text("angles").startswith("heading "))
        assert shown.text("angles").endswith("roll 0.0 deg")

    def test_layout_at_every_width_keeps_heights(self, shown: Page) -> None:
        first = shown.chart_heights()
        assert len(first) == 7
        for window in WINDOWS_PX:
            shown.resize(*window)
            assert shown.width() <= window[0]
            heights = shown.chart_heights()
            assert heights == pytest.approx(first, abs=HEIGHT_TOLERANCE_PX)
            assert min(heights.values()) > 90.0

    def test_heading_of_many_turns_has_few_lines(self, shown: Page) -> None:
        steps = shown.run_async(
            "const done = arguments[arguments.length - 1];"
            "import('/charts.js').then(({turnStep}) => done([10, 300, 5400, 1e6].map(turnStep)));"
        )
        assert steps == [5, 90, 1440, 250_200]

    def test_numbers_of_close_waypoints_do_not_cover_each_other(self, shown: Page) -> None:
        numbers = shown.run_async(
            "const done = arguments[arguments.length - 1];"
            "const points = Array.from({length: 300}, (_, n) => ({north_m: 0, east_m: n}));"
            "import('/charts.js').then(({readable}) =>"
            " done(readable(points, (east) => east, (north) => -north, 100)));"
        )
        assert numbers[0]["text"] == "101"
        lefts = sorted((number["left"], number["right"]) for number in numbers)
        assert 5 < len(lefts) < 30
        assert all(after[0] > before[1] for before, after in pairwise(lefts))

    def test_dark_page_is_printed_in_light_colours(self, shown: Page) -> None:
        ink = "return getComputedStyle(document.documentElement).getPropertyValue('--ink').trim()"
        light = shown.run(ink)
        shown.emulate(media="", scheme="dark")
        dark = shown.run(ink)
        shown.run("dispatchEvent(new Event('beforeprint'))")
        assert shown.run(ink) == light != dark
        shown.run("dispatchEvent(new Event('afterprint'))")
        assert shown.run(ink) == dark
        shown.emulate(media="", scheme="light")

    def test_page_asks_its_own_server_only_and_logs_no_error(
        self, shown: Page, flight: Flight
    ) -> None:
        requests = shown.requests()
        assert requests
        own = server.url(flight.listener)
        assert [request for request in requests if not request.startswith(own)] == []
        assert shown.errors() == []


@needs_chromium
@pytest.mark.process
@pytest.mark.timeout(240)
def test_page_shows_that_its_server_hangs(tmp_path: Path) -> None:
    with Flight() as flight, opened(server.url(flight.listener), tmp_path / "profile") as page:
        wait_for(lambda: page.text("link") == "link good")
        with flight.state.dive("circle"):  # the server waits for the dive
            wait_for(lambda: page.text("banner").startswith("nothing received from ground for"))
            assert page.text("link") == "link unknown"
        wait_for(lambda: page.text("link") == "link good" and not page.text("banner"))


@needs_chromium
@pytest.mark.process
@pytest.mark.timeout(240)
def test_page_shows_the_end_of_its_server(tmp_path: Any) -> None:
    with Flight() as flight, opened(server.url(flight.listener), tmp_path / "profile") as page:
        wait_for(lambda: page.text("armed") == "ARMED")
        flight.__exit__()
        wait_for(lambda: "has ended" in page.text("banner"))
        assert page.errors() == []
