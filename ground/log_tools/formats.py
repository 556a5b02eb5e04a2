"""Formats of exports, and viewers with a layout."""

from enum import StrEnum


class ExportFormat(StrEnum):
    """Format of an export."""

    CSV = "csv"
    MAT = "mat"
    TLOG = "tlog"
    MCAP = "mcap"


class Viewer(StrEnum):
    """Log viewer with a layout."""

    FOXGLOVE = "foxglove"
    PLOTJUGGLER = "plotjuggler"

    @property
    def file_name(self) -> str:
        """Usual name of the layout file."""
        return "caribou.foxglove.json" if self == Viewer.FOXGLOVE else "caribou.plotjuggler.xml"
