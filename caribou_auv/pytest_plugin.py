"""pytest plugin: the fixture `caribou_vehicle` flies missions with a simulated vehicle.

The marker `caribou` chooses the simulation of a test, with the keywords of `caribou_auv.fly`:
``@pytest.mark.caribou(seed=3, scenario="disturbed", faults=[...])``. `--caribou-seed` and
`--caribou-speed` set the defaults of all tests.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from caribou_auv.flying import Flight

_MARKER_LINE = (
    "caribou(vehicle, scenario, seed, speed, faults, parameters, autopilot): simulation that the"
    " fixture caribou_vehicle flies"
)


class CaribouVehicle:
    """Simulated vehicle of one test; every dive starts new processes on free ports.

    Parameters
    ----------
    folder : Path
        Folder for the logs.
    options : mapping
        Keywords of `caribou_auv.fly`.
    """

    def __init__(self, folder: Path, options: Mapping[str, Any]) -> None:
        self.folder = folder
        """Folder of the logs."""
        self.options = dict(options)
        """Keywords of `caribou_auv.fly` for each dive."""
        self._dives = 0

    def fly(self, mission: str | Path, **options: Any) -> "Flight":
        """Fly a mission and return when the vehicle has disarmed.

        Parameters
        ----------
        mission : str or Path
            Name of a shipped mission, or a mission file.
        **options
            Keywords of `caribou_auv.fly`, which replace those of the marker.

        Returns
        -------
        Flight
            Log, errors and failsafes.

        Raises
        ------
        CaribouError
            An input cannot be used, or the simulation failed.
        """
        from caribou_auv.flying import fly

        self._dives += 1
        log = self.folder / f"{self._dives}-{Path(mission).stem}.mcap"
        return fly(mission, log, **{**self.options, **options})


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of the command line."""
    group = parser.getgroup("caribou", "simulated vehicle of the fixture caribou_vehicle")
    group.addoption("--caribou-seed", type=int, default=1, help="seed of the simulation")
    group.addoption("--caribou-speed", default="max", help="vehicle time per wall time, or max")


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker."""
    config.addinivalue_line("markers", _MARKER_LINE)


@pytest.fixture
def caribou_vehicle(request: pytest.FixtureRequest, tmp_path: Path) -> CaribouVehicle:
    """Return a simulated vehicle; the marker `caribou` of the test chooses its simulation."""
    options: dict[str, Any] = {
        "seed": request.config.getoption("--caribou-seed"),
        "speed": request.config.getoption("--caribou-speed"),
    }
    for marker in reversed(list(request.node.iter_markers("caribou"))):
        if marker.args:
            raise pytest.UsageError(
                f"{request.node.nodeid}: @pytest.mark.caribou takes keywords only, such as seed=3"
            )
        options.update(marker.kwargs)
    return CaribouVehicle(tmp_path, options)
