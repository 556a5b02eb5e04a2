"""Files that MAVLink FTP offers."""

from functools import partial

from autopilot.control.params import PARAMETERS, ParamTable
from autopilot.onboard_log.recorder import OnboardLog
from autopilot.param_file import to_text
from autopilot.telemetry import component_metadata
from mavlink_io.services import param_file_ftp
from mavlink_io.services.ftp.tree import FileTree


def file_tree(params: ParamTable, onboard_log: OnboardLog) -> FileTree:
    """Return the file tree of the vehicle.

    It holds the onboard logs, the parameters in the format that ``autopilot --params`` reads, the
    same in ArduPilot's packed format, and the component metadata."""
    tree = FileTree()
    if onboard_log.store is not None:
        tree.add_folder("/logs", onboard_log.store.folder)
    tree.add_file(
        "/params/current.param",
        lambda: to_text({name: params.get(name) for name in params.names()}).encode(),
    )
    for with_defaults in (False, True):
        path = param_file_ftp.PATH + (param_file_ftp.WITH_DEFAULTS if with_defaults else "")
        tree.add_file(path, partial(_packed_parameters, params, with_defaults))
    tree.add_file(component_metadata.GENERAL_PATH, component_metadata.general_json)
    tree.add_file(component_metadata.PARAMETERS_PATH, component_metadata.parameters_json)
    return tree


def _packed_parameters(params: ParamTable, with_defaults: bool) -> bytes:
    """Return all parameters in ArduPilot's packed format."""
    rows = {
        row.name: param_file_ftp.PackedParameter(params.get(row.name), row.default)
        for row in PARAMETERS
    }
    return param_file_ftp.pack(rows, with_defaults)
