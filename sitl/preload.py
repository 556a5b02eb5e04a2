"""Imported, it has done what every simulator does before it is heard: libraries are loaded and the
physics compiled.

For a process that has others forked from it.
"""

from sitl import __main__ as _command  # noqa: F401 - is loaded, and what it needs with it
from sitl import app, scenario
from sitl.core import plant
from sitl.vehicle import config

app.warm_up(plant.build(config.load("caribou_truth"), scenario.load("calm")))
