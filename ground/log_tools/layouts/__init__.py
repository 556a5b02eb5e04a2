"""Layouts of log viewers for logs of `ground log export --format mcap`."""

from importlib import resources

from ground.log_tools.formats import Viewer


def read(viewer: Viewer) -> str:
    """Return the layout file of a viewer.

    Parameters
    ----------
    viewer : Viewer
        Foxglove (also Lichtblick) or PlotJuggler.

    Returns
    -------
    str
        Content of the file.
    """
    return (resources.files(__package__) / viewer.file_name).read_text(encoding="utf-8")
