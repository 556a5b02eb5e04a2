"""The read-only file tree that FTP clients see: folders of the disk and files made on demand.

No path leads out of the tree: folder names are looked up in the tree and never joined to a path of
the disk. Only the name of a file is joined to the folder that was added.
"""

import os
import stat
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, Protocol

Parts = tuple[str, ...]


class ListingEntry(NamedTuple):
    """One entry of a directory listing."""

    name: str
    size: int | None
    """Size in bytes; None for a directory."""


class OpenFile(Protocol):
    """An open file with random access."""

    size: int
    """Size in bytes when the file was opened."""

    def read(self, offset: int, length: int) -> bytes:
        """Return up to ``length`` bytes from ``offset`` on; b"" at the end of the file."""
        ...

    def close(self) -> None:
        """Close the file."""
        ...


class FileTree:
    """A read-only tree of folders and files, the same for every client."""

    def __init__(self) -> None:
        self._folders: dict[Parts, Path] = {}
        self._generated: dict[Parts, Callable[[], bytes]] = {}

    def add_folder(self, path: str, folder: Path) -> None:
        """Show the regular files of a folder of the disk, without subfolders and links.

        Parameters
        ----------
        path : str
            Path in the tree.
        folder : Path
            The folder; it may not exist yet.
        """
        self._folders[parts(path)] = folder

    def add_file(self, path: str, content: Callable[[], bytes]) -> None:
        """Show a file whose content is made when it is opened.

        Parameters
        ----------
        path : str
            Path in the tree.
        content : callable
            Return the content.
        """
        self._generated[parts(path)] = content

    def entries(self, path: str) -> list[ListingEntry]:
        """Return the entries of a directory.

        Parameters
        ----------
        path : str
            Path in the tree; "" or "/" is the root.

        Returns
        -------
        list of ListingEntry
            Entries sorted by name.

        Raises
        ------
        FileNotFoundError
            The tree has no such directory.
        """
        directory = parts(path)
        if directory in self._folders:
            return _regular_files(self._folders[directory])
        depth = len(directory)
        children = {
            mount[depth]: mount
            for mount in (*self._folders, *self._generated)
            if _is_below(mount, directory)
        }
        if not children and directory:
            raise FileNotFoundError(path)
        return [
            ListingEntry(
                name,
                len(self._generated[mount]())
                if mount in self._generated and len(mount) == depth + 1
                else None,
            )
            for name, mount in sorted(children.items())
        ]

    def open(self, path: str) -> OpenFile:
        """Open a file.

        Parameters
        ----------
        path : str
            Path in the tree.

        Returns
        -------
        OpenFile
            The open file; the caller closes it.

        Raises
        ------
        FileNotFoundError
            The tree has no such file.
        OSError
            The disk fails.
        """
        file = parts(path)
        if file in self._generated:
            return _GeneratedFile(self._generated[file]())
        if file and file[:-1] in self._folders:
            return _DiskFile(self._folders[file[:-1]] / file[-1])
        raise FileNotFoundError(path)


def parts(path: str) -> Parts:
    """Return the names in a path from the root of the tree, with or without a leading slash.

    Parameters
    ----------
    path : str
        Path in the tree.

    Returns
    -------
    tuple of str
        The names; empty for the root.

    Raises
    ------
    FileNotFoundError
        The path contains a name that no tree contains, such as ``..``.
    """
    names = tuple(name for name in path.split("/") if name)
    if any(name in (".", "..") or "\0" in name or "\\" in name for name in names):
        raise FileNotFoundError(path)
    return names


def _is_below(mount: Parts, directory: Parts) -> bool:
    """Return whether a mount point is inside a directory."""
    return len(mount) > len(directory) and mount[: len(directory)] == directory


def _regular_files(folder: Path) -> list[ListingEntry]:
    """Return the regular files of a folder, sorted by name; none if it does not exist yet."""
    try:
        files = [entry for entry in os.scandir(folder) if entry.is_file(follow_symlinks=False)]
        return sorted(
            ListingEntry(entry.name, entry.stat(follow_symlinks=False).st_size) for entry in files
        )
    except OSError:
        return []


class _GeneratedFile:
    """A file whose content was made when it was opened."""

    def __init__(self, content: bytes) -> None:
        self._content, self.size = content, len(content)

    def read(self, offset: int, length: int) -> bytes:
        return self._content[offset : offset + length]

    def close(self) -> None:
        pass


class _DiskFile:
    """A regular file of the disk; bytes that are appended after the opening are not read."""

    def __init__(self, path: Path) -> None:
        try:
            self._file = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
        except (OSError, ValueError) as error:
            raise FileNotFoundError(str(path)) from error
        status = os.fstat(self._file)
        if not stat.S_ISREG(status.st_mode):
            os.close(self._file)
            raise FileNotFoundError(str(path))
        self.size = status.st_size

    def read(self, offset: int, length: int) -> bytes:
        return os.pread(self._file, min(length, max(0, self.size - offset)), offset)

    def close(self) -> None:
        os.close(self._file)
