"""Python interface of Caribou: fly, load logs, identify, design, simulate and compare.

The functions are thin: `ground` and `sysid` do the work, and the command line gives the same
results. Errors of input are `CaribouError` with a message of one line. Page: docs/python.md.

A name is imported at its first use, so that the pytest plugin loads no numerical library.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from caribou_auv.flying import Flight, fly
    from caribou_auv.identification import design, identify, load_model, save_model
    from caribou_auv.logs import load_log, load_messages, to_arrays, to_frame
    from caribou_auv.parameters import load_parameters, save_parameters
    from caribou_auv.simulation import replay, simulate
    from ground.log_tools.comparison import Comparison, DiveErrors, compare
    from mavlink_io.errors import CaribouError
    from sysid.data.dataset import Log
    from sysid.design.pid import Design, Spec
    from sysid.models.model_file import IdentifiedModel
    from sysid.monte_carlo.replay import Replayed
    from sysid.monte_carlo.simulate import Sea, SimulatedDive

__all__ = [
    "CaribouError",
    "Comparison",
    "Design",
    "DiveErrors",
    "Flight",
    "IdentifiedModel",
    "Log",
    "Replayed",
    "Sea",
    "SimulatedDive",
    "Spec",
    "compare",
    "design",
    "fly",
    "identify",
    "load_log",
    "load_messages",
    "load_model",
    "load_parameters",
    "replay",
    "save_model",
    "save_parameters",
    "simulate",
    "to_arrays",
    "to_frame",
]

_NAMES = {
    "ground.log_tools.comparison": ("Comparison", "DiveErrors", "compare"),
    "caribou_auv.flying": ("Flight", "fly"),
    "caribou_auv.identification": ("design", "identify", "load_model", "save_model"),
    "caribou_auv.logs": ("load_log", "load_messages", "to_arrays", "to_frame"),
    "caribou_auv.parameters": ("load_parameters", "save_parameters"),
    "caribou_auv.simulation": ("replay", "simulate"),
    "mavlink_io.errors": ("CaribouError",),
    "sysid.data.dataset": ("Log",),
    "sysid.design.pid": ("Design", "Spec"),
    "sysid.models.model_file": ("IdentifiedModel",),
    "sysid.monte_carlo.replay": ("Replayed",),
    "sysid.monte_carlo.simulate": ("Sea", "SimulatedDive"),
}
_MODULE_OF = {name: module for module, names in _NAMES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Return a public name from its module."""
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_MODULE_OF[name]), name)
