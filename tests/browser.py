"""Headless Chromium for tests of HTML pages: sizes, console errors and network requests.

Chromium is the browser in ``CHROMIUM``, else ``chromium`` on the PATH; its driver is
``chromedriver`` on the PATH. Debian: ``apt-get install chromium chromium-driver``. Without them
the tests are skipped.
"""

import json
import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

FLAGS = (
    "--headless",
    "--no-sandbox",  # Chromium refuses to run as root, as in a container, with its sandbox
    "--disable-dev-shm-usage",  # containers have a small /dev/shm
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
LOCAL_SCHEMES = ("file:", "data:", "blob:", "chrome:", "chrome-untrusted:")
"""Addresses that need no network, or belong to the browser's own start page."""
WINDOWS_PX = ((768, 1024), (390, 844), (844, 390), (1440, 900))
"""A tablet, a telephone upright and turned, and the desktop that the page was opened on."""
HEIGHT_TOLERANCE_PX = 5.0
"""Rounding of a layout to whole pixels, and the one-pixel borders."""
LAYOUT_TIMEOUT_S = 30.0
"""Plotly redraws 100 ms after the last resize event; a busy machine takes longer."""
STABLE_S = 0.4
"""A layout that has not changed for this long is final."""
_CHROMIUM = os.environ.get("CHROMIUM") or shutil.which("chromium")
_DRIVER = shutil.which("chromedriver")

needs_chromium = pytest.mark.skipif(
    not (_CHROMIUM and Path(_CHROMIUM).exists() and _DRIVER),
    reason="no chromium or no chromedriver: apt-get install chromium chromium-driver",
)

_CHARTS = """
return Object.fromEntries([...document.querySelectorAll('.chart')].map(chart => {
  const drawing = chart.querySelector('.main-svg, canvas');
  return [chart.id, [chart, drawing].map(e => {
    const box = e ? e.getBoundingClientRect() : {width: 0, height: 0};
    return [box.width, box.height];
  })];
}));
"""
_DRAWN = """
return !document.getElementById('charts') || 'drawn' in document.documentElement.dataset;
"""
"""Whether a report has drawn its last chart; true for other pages."""
_PRINTED = """
dispatchEvent(new Event('beforeprint'));
const result = [...document.querySelectorAll('.chart')].map(chart => {
  const figure = chart.closest('.figure');
  return { key: chart.id, heading: Boolean(figure && figure.querySelector('h3, h4')),
           together: figure && getComputedStyle(figure).breakInside,
           height: figure && figure.offsetHeight,
           width: chart.querySelector('.main-svg').getBoundingClientRect().width };
});
const texts = [...document.querySelectorAll('.scroll, .chart, .figure, .pair, .triple')]
  .map(e => e.previousElementSibling).filter(e => e && e.tagName === 'P');
const apart = texts.filter(e => getComputedStyle(e).breakAfter !== 'avoid').map(e => e.innerText);
const color = getComputedStyle(document.body).backgroundColor;
dispatchEvent(new Event('afterprint'));
return { charts: result, apart, color };
"""
"""Charts with their headings, as printed; texts that a sheet may separate from their charts."""
SHEET_PX = (688.0, 950.0)
"""Width of A4 and height of US letter paper less margins of 14 mm, at 96 px per inch."""


class Page:
    """A page that is open in the browser."""

    def __init__(self, driver: Any) -> None:
        self._driver = driver

    def open(self, address: str, width_px: int, height_px: int) -> None:
        """Open an address in a viewport of a size, and wait until it is drawn."""
        self._driver.get("about:blank")
        self._set_viewport(width_px, height_px)
        self._driver.get(address)
        self._settle()

    def resize(self, width_px: int, height_px: int) -> None:
        """Set the viewport, and wait until the charts keep their boxes."""
        self._set_viewport(width_px, height_px)
        self._settle()

    def charts(self) -> dict[str, list[list[float]]]:
        """Return (width, height) in px of each chart's element and of the drawing in it, by id."""
        boxes: dict[str, list[list[float]]] = self._driver.execute_script(_CHARTS)
        return boxes

    def chart_heights(self) -> dict[str, float]:
        """Return the height of the drawing of each chart in px, by id."""
        return {key: drawing[1] for key, (_, drawing) in self.charts().items()}

    def width(self) -> int:
        """Return the width in px that the document needs without scrolling."""
        return int(self.run("return document.documentElement.scrollWidth"))

    def run(self, script: str) -> Any:
        """Run a piece of JavaScript and return its result."""
        return self._driver.execute_script(script)

    def text(self, element: str) -> str:
        """Return the text that the element of an id shows."""
        return str(self.run(f"return document.getElementById('{element}').innerText"))

    def save_picture(self, path: Path) -> None:
        """Write what the viewport shows as PNG."""
        if not self._driver.save_screenshot(str(path)):
            raise OSError(f"{path}: could not be written")

    def run_async(self, script: str) -> Any:
        """Run a piece of JavaScript that calls its last argument with the result."""
        self._driver.set_script_timeout(LAYOUT_TIMEOUT_S * 2.0)
        return self._driver.execute_async_script(script)

    def run_at_next_opening(self, script: str) -> None:
        """Run a piece of JavaScript in the next documents, before their own scripts."""
        self._driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": script})

    def emulate(self, media: str, scheme: str) -> None:
        """Show the page as for a medium, such as print, and a colour scheme, light or dark."""
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        self._driver.execute_cdp_cmd(
            "Emulation.setEmulatedMedia", {"media": media, "features": features}
        )

    def errors(self) -> list[str]:
        """Return the errors in the console."""
        entries = self._driver.get_log("browser")
        return [entry["message"] for entry in entries if entry["level"] == "SEVERE"]

    def requests(self) -> list[str]:
        """Return the addresses fetched since the page was opened that need a network."""
        entries = self._driver.get_log("performance")
        messages = [json.loads(entry["message"])["message"] for entry in entries]
        sent = [m["params"] for m in messages if m["method"] == "Network.requestWillBeSent"]
        urls = [params["request"]["url"] for params in sent]
        return [url for url in urls if not url.startswith(LOCAL_SCHEMES)]

    def _set_viewport(self, width_px: int, height_px: int) -> None:
        size = {"width": width_px, "height": height_px, "deviceScaleFactor": 1, "mobile": False}
        self._driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)

    def _settle(self) -> None:
        deadline_s = time.monotonic() + LAYOUT_TIMEOUT_S
        while not self.run(_DRAWN) and time.monotonic() < deadline_s:
            time.sleep(0.05)
        time.sleep(STABLE_S)
        before, now = None, self.charts()
        while before != now:
            if time.monotonic() > deadline_s:
                raise TimeoutError(f"the layout still changed after {LAYOUT_TIMEOUT_S:g} s")
            time.sleep(STABLE_S)
            before, now = now, self.charts()


def check_layout(page: Page) -> None:
    """Resize the window as a reader does: charts keep their height, and nothing is too wide."""
    first = page.chart_heights()
    assert min(first.values()) > 200.0
    assert page.width() <= WINDOWS_PX[-1][0]
    heights: dict[tuple[int, int], dict[str, float]] = {}
    too_wide: dict[tuple[tuple[int, int], str], list[list[float]]] = {}
    for window in WINDOWS_PX:
        page.resize(*window)
        boxes = page.charts()
        heights[window] = {key: drawing[1] for key, (_, drawing) in boxes.items()}
        too_wide |= {(window, key): box for key, box in boxes.items() if box[1][0] > box[0][0]}
        if (width_px := page.width()) > window[0]:
            too_wide[window, "page"] = [[width_px]]
    same = pytest.approx(first, abs=HEIGHT_TOLERANCE_PX)
    assert all(found == same for found in heights.values()), heights
    assert too_wide == {}
    assert page.errors() == []
    assert page.requests() == []


def check_print(page: Page) -> None:
    """Print a page from a dark window: each chart is on one white sheet with its heading.

    A paragraph before a table or a chart stays with it, and no table is wider than the sheet.
    """
    page.emulate(media="print", scheme="dark")
    printed = page.run(_PRINTED)
    page.resize(*map(int, SHEET_PX))
    width_px = page.width()
    page.emulate(media="", scheme="light")
    assert {chart["key"] for chart in printed["charts"]} == set(page.charts())
    for chart in printed["charts"]:
        assert chart["heading"], chart
        assert chart["together"] == "avoid", chart
        assert chart["width"] <= SHEET_PX[0], chart
        assert chart["height"] <= SHEET_PX[1], chart
    assert printed["apart"] == []
    assert width_px <= SHEET_PX[0]
    assert printed["color"] == "rgb(255, 255, 255)"


@contextmanager
def opened(target: Path | str, profile: Path) -> Iterator[Page]:
    """Open a file or an address in a browser of its own.

    The browser keeps its data in the empty folder ``profile``.
    """
    from selenium import webdriver
    from selenium.webdriver.chrome.options import Options
    from selenium.webdriver.chrome.service import Service

    options = Options()
    options.binary_location = str(_CHROMIUM)
    for flag in (*FLAGS, f"--user-data-dir={profile}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(str(_DRIVER)))
    try:
        page = Page(driver)
        address = target if isinstance(target, str) else target.resolve().as_uri()
        page.open(address, *WINDOWS_PX[-1])
        yield page
    finally:
        driver.quit()
