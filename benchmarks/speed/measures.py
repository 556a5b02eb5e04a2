"""Which function measures which rows, in the order of a run."""

from benchmarks.speed import (
    campaigns,
    closed_loop,
    dives,
    fleet,
    messages,
    physics,
    processes,
    simulated_dive,
    studies,
)
from benchmarks.speed.session import Measures

MEASURES: Measures = {
    ("physics-step",): physics.measure,
    ("hil-codec",): messages.measure_codec,
    ("recorder",): messages.measure_recorder,
    ("closed-loop",): simulated_dive.measure_four_steps,
    ("closed-loop-20ms",): simulated_dive.measure_one_step,
    ("tick-by-tick",): closed_loop.measure,
    ("plain-tick",): closed_loop.measure_plain_tick,
    ("simulated-dive",): simulated_dive.measure,
    ("dive-tick", "dive-speed"): dives.measure,
    ("memory-sitl", "memory-autopilot"): processes.measure_memory,
    ("help",): processes.measure_help,
    ("vehicles-real-time",): fleet.measure_real_time,
    ("vehicles-max",): fleet.measure_max,
    ("campaign",): campaigns.measure_campaign,
    ("refit",): campaigns.measure_refit,
    ("fresh-clone",): campaigns.measure_fresh_clone,
    ("study-sysid",): studies.measure_sysid,
    ("study-control",): studies.measure_control,
}
"""Short measurements first."""
