"""What an FTP client may see of the vehicle: a line for each."""

from functools import partial

from autopilot import metadata
from autopilot.logbook.book import Logbook
from autopilot.param_file import text_of
from autopilot.params import PARAMETERS, ParamTable
from link import param_pack
from link.files.tree import FileTree


def file_tree(params: ParamTable, logbook: Logbook) -> FileTree:
    """The vehicle's logs, her parameters as a file that ``autopilot --params`` reads, and what they mean."""
    tree = FileTree()
    if logbook.store is not None:
        tree.add_folder("/logs", logbook.store.folder)
    tree.add_file(
        "/params/current.param", lambda: text_of({name: params.get(name) for name in params.names()}).encode()
    )
    for with_defaults in (False, True):
        path = param_pack.PATH + (param_pack.WITH_DEFAULTS if with_defaults else "")
        tree.add_file(path, partial(_packed, params, with_defaults))
    tree.add_file(metadata.GENERAL_PATH, metadata.general_json)
    tree.add_file(metadata.PARAMETERS_PATH, metadata.parameters_json)
    return tree


def _packed(params: ParamTable, with_defaults: bool) -> bytes:
    rows = {row.name: param_pack.Parameter(params.get(row.name), row.default) for row in PARAMETERS}
    return param_pack.pack(rows, with_defaults)
