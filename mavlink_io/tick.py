"""Period of the autopilot's tick, which is also the simulator's and that of controllers in files.

It stands here because autopilot and simulator import nothing of each other.
"""

TICK_US = 20_000
TICK_S = TICK_US * 1e-6
"""Period of a tick of Caribou's own autopilot: 50 Hz."""
