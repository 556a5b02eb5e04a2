"""Load all libraries of the simulator and compile its physics, as a side effect of the import.

For a process from which simulator processes are forked.
"""

from sitl import app, scenario
from sitl import cli as _command  # noqa: F401 - imported to load what the command needs
from sitl.backends import factory as _factory  # noqa: F401 - the same
from sitl.core import plant
from sitl.vehicle import config

app.report_compilation()
app.warm_up(plant.build(config.load("caribou_truth"), scenario.load("calm")))
