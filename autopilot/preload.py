"""Load what the autopilot needs and the machine code of its ticks, as a side effect of the import.

For a process from which autopilot processes are forked.
"""

from autopilot import start as _start  # noqa: F401 - imported to load what the command needs
from autopilot.pilot import Pilot
from mavlink_io import jit

Pilot(compiled=jit.COMPILED)
