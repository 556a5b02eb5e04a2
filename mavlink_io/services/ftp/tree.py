"""What an FTP client may see: a small tree of its own, in which folders of the disk and texts made
on demand hang.

No path leads out of it: names are looked up in the tree and never put together to a path of the
disk."""

import os
import stat
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, Protocol

Parts = tuple[str, ...]


class ListingEntry(NamedTuple):
    """One line of a listing."""

    name: str
    size: int | None
    """In bytes; None for a directory."""


class OpenFile(Protocol):
    """A file that can be read at any place."""

    size: int

    def read(self, offset: int, length: int) -> bytes: ...

    def close(self) -> None: ...


class FileTree:
    """Read-only, and the same for every client."""

    def __init__(self) -> None:
        self._folders: dict[Parts, Path] = {}
        self._texts: dict[Parts, Callable[[], bytes]] = {}

    def add_folder(self, path: str, folder: Path) -> None:
        """Show the files that lie in a folder of the disk; neither its folders nor what links point
        to."""
        self._folders[parts(path)] = folder

    def add_file(self, path: str, content: Callable[[], bytes]) -> None:
        """Show a file whose content is made when it is opened."""
        self._texts[parts(path)] = content

    def entries(self, path: str) -> list[ListingEntry]:
        """What lies in a directory, sorted by name. Raises FileNotFoundError."""
        at = parts(path)
        if at in self._folders:
            return _files(self._folders[at])
        found = {
            mount[len(at)]: mount for mount in (*self._folders, *self._texts) if _below(mount, at)
        }
        if not found and at:
            raise FileNotFoundError(path)
        return [
            ListingEntry(
                name,
                len(self._texts[mount]())
                if mount in self._texts and len(mount) == len(at) + 1
                else None,
            )
            for name, mount in sorted(found.items())
        ]

    def open(self, path: str) -> OpenFile:
        """Open a file. Raises FileNotFoundError, and OSError where the disk fails."""
        at = parts(path)
        if at in self._texts:
            return _Text(self._texts[at]())
        if at and at[:-1] in self._folders:
            return _DiskFile(self._folders[at[:-1]] / at[-1])
        raise FileNotFoundError(path)


def parts(path: str) -> Parts:
    """The names that a path is made of; with or without a slash in front it starts at the root of
    the tree.

    Raises:
        FileNotFoundError: a name that a tree can never hold, such as ``..``.
    """
    names = tuple(name for name in path.split("/") if name)
    if any(name in (".", "..") or "\0" in name or "\\" in name for name in names):
        raise FileNotFoundError(path)
    return names


def _below(mount: Parts, at: Parts) -> bool:
    return len(mount) > len(at) and mount[: len(at)] == at


def _files(folder: Path) -> list[ListingEntry]:
    try:
        found = [entry for entry in os.scandir(folder) if entry.is_file(follow_symlinks=False)]
        return sorted(
            ListingEntry(entry.name, entry.stat(follow_symlinks=False).st_size) for entry in found
        )
    except OSError:  # a folder that is not made yet is empty
        return []


class _Text:
    def __init__(self, content: bytes) -> None:
        self._content, self.size = content, len(content)

    def read(self, offset: int, length: int) -> bytes:
        return self._content[offset : offset + length]

    def close(self) -> None:
        pass


class _DiskFile:
    """A regular file, as long as it was when it was opened."""

    def __init__(self, path: Path) -> None:
        try:
            self._file = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
        except (OSError, ValueError) as error:
            raise FileNotFoundError(str(path)) from error
        about = os.fstat(self._file)
        if not stat.S_ISREG(about.st_mode):
            os.close(self._file)
            raise FileNotFoundError(str(path))
        self.size = about.st_size

    def read(self, offset: int, length: int) -> bytes:
        return os.pread(self._file, min(length, max(0, self.size - offset)), offset)

    def close(self) -> None:
        os.close(self._file)
