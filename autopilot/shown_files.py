"""What an FTP client may see of the vehicle: a line for each."""

from autopilot import metadata
from autopilot.logbook.book import Logbook
from autopilot.param_file import text_of
from autopilot.params import ParamTable
from link.files.tree import FileTree


def file_tree(params: ParamTable, logbook: Logbook) -> FileTree:
    """The vehicle's logs, her parameters as a file that ``autopilot --params`` reads, and what they mean."""
    tree = FileTree()
    if logbook.store is not None:
        tree.add_folder("/logs", logbook.store.folder)
    tree.add_file(
        "/params/current.param", lambda: text_of({name: params.get(name) for name in params.names()}).encode()
    )
    tree.add_file(metadata.GENERAL_PATH, metadata.general_json)
    tree.add_file(metadata.PARAMETERS_PATH, metadata.parameters_json)
    return tree
