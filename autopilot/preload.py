"""Load what the autopilot needs and the machine code of its ticks, as a side effect of the import.

For a process from which autopilot processes are forked.
"""

from importlib import import_module

from autopilot import start as _start  # noqa: F401 - imported to load what the command needs
from autopilot.pilot import Pilot
from autopilot.steady_ticks import TELEMETRY
from mavlink_io import jit

Pilot(compiled=jit.COMPILED)
if jit.COMPILED:
    import_module(TELEMETRY).FrameEncoder()
