"""Load what the autopilot needs and the machine code of its ticks, as a side effect of the import.

For a process from which autopilot processes are forked.
"""

import sys
from importlib import import_module

from autopilot import start as _start  # noqa: F401 - imported to load what the command needs
from autopilot.pilot import Pilot
from autopilot.steady_ticks import TELEMETRY, is_compiled
from mavlink_io import jit

if jit.COMPILED and not is_compiled():
    print("autopilot: compiling its ticks, once, for up to 4 minutes", file=sys.stderr, flush=True)
Pilot(compiled=jit.COMPILED)
if jit.COMPILED:
    import_module(TELEMETRY).FrameEncoder()
