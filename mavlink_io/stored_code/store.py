"""Files with the object code of kernels, one for each function, in ``__pycache__`` of its source.

A file belongs to the content of the source and of what it imports, to the versions of Python and
numba, and to the processor; with another of these it is not used.
"""

import pickle
import platform
import re
import sys
import sysconfig
import time
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from importlib.util import find_spec
from inspect import getfile
from itertools import accumulate
from pathlib import Path
from typing import NamedTuple
from uuid import uuid4

_PACKAGES = ("mavlink_io", "autopilot", "sitl", "sysid")
"""Packages that have kernels: a kernel depends on what its file imports from them."""
_IMPORT = re.compile(r"^from ([\w.]+) import (\([^)]*\)|[^\n]*)", re.MULTILINE)
_WORD = re.compile(r"\w+")
_COMPILER = Path(__file__).parent.parent / "jit_numba.py"
"""File that decides how code is compiled."""


class Source(NamedTuple):
    """Function whose machine code is stored."""

    file: Path
    qualname: str

    @classmethod
    def of(cls, function: Callable[..., object]) -> "Source":
        """Return the source of a function.

        Parameters
        ----------
        function : callable
            Function of Python.
        """
        return cls(Path(getfile(function)), function.__qualname__)

    @property
    def is_unique(self) -> bool:
        """Whether the name belongs to one function only: one that another makes is not stored."""
        return "<locals>" not in self.qualname

    @property
    def path(self) -> Path:
        """Path of the file with the object code."""
        name = f"{self.file.stem}.{self.qualname}.{sys.implementation.cache_tag}.kernel"
        return self.file.parent / "__pycache__" / name


class CompilerEnvironment(NamedTuple):
    """Objects of Python that compiled code refers to."""

    symbol: bytes
    """Variable of the object code that holds the environment."""
    constants: tuple[object, ...]


class ObjectCode(NamedTuple):
    """Machine code of a function for arguments of given types."""

    content: bytes
    """Object file."""
    symbol: bytes
    """Name of the function that Python calls."""
    environments: tuple[CompilerEnvironment, ...]


_STARTED_S = time.time()
"""Time of the import of this module: sources that changed later are not those of the process."""
_DAMAGED = (
    OSError,
    EOFError,
    ValueError,
    TypeError,
    LookupError,
    AttributeError,
    ImportError,
    pickle.UnpicklingError,
)
"""Errors of reading a damaged or missing file."""


def is_supported() -> bool:
    """Return whether object code of this machine can be placed in memory without the compiler."""
    return (
        sys.platform == "linux"
        and platform.machine() == "x86_64"
        and sys.implementation.name == "cpython"
        and not sysconfig.get_config_var("Py_GIL_DISABLED")
    )


def stored_types(source: Source) -> list[str]:
    """Return the types of arguments that a function is stored for.

    Empty if there is no file of the present source, versions and processor.
    """
    return list(_places(source))


def find(source: Source, types: str) -> ObjectCode | None:
    """Return the machine code for types of arguments; None if it is not stored, or damaged."""
    place = _places(source).get(types)
    if place is None:
        return None
    try:
        with source.path.open("rb") as file:
            file.seek(place)
            content, symbol, environments = pickle.load(file)
        return ObjectCode(
            content, symbol, tuple(CompilerEnvironment(*entry) for entry in environments)
        )
    except _DAMAGED:
        return None


def _places(source: Source) -> dict[str, int]:
    """Return the place in the file of a function for each of the types that it is stored for."""
    if not source.is_unique:
        return {}
    try:
        with source.path.open("rb") as file:
            key, places, types = pickle.load(file)
            if key != _key(source.file):
                return {}
            start = file.tell()
    except _DAMAGED:
        return {}
    return {name: start + place for name, place in zip(types, places, strict=True)}


def save(source: Source, types: str, code: ObjectCode) -> None:
    """Add machine code to the file of a function.

    Without effect where it cannot be written, if a source has changed since this process imported
    it, and for a function that another one makes.
    """
    if not source.is_unique or any(
        file.stat().st_mtime > _STARTED_S for file in _files_of(source.file)
    ):
        return
    others = {known: find(source, known) for known in stored_types(source) if known != types}
    stored = {known: entry for known, entry in others.items() if entry is not None}
    stored[types] = code
    parts = [
        pickle.dumps((entry.content, entry.symbol, [tuple(e) for e in entry.environments]))
        for entry in stored.values()
    ]
    places = list(accumulate(map(len, parts[:-1]), initial=0))
    temporary = source.path.with_suffix(f".{uuid4().hex[:16]}.tmp")
    try:
        source.path.parent.mkdir(exist_ok=True)
        with temporary.open("wb") as file:
            pickle.dump((_key(source.file), places, list(stored)), file)
            file.writelines(parts)
        temporary.replace(source.path)
    except OSError:
        temporary.unlink(missing_ok=True)


@cache
def _key(file: Path) -> tuple[str, ...]:
    """Return what stored machine code depends on."""
    return content_stamp(file), *_compiler_and_processor()


@cache
def _compiler_and_processor() -> tuple[str, ...]:
    """Return numba's version, and the instruction sets of the processor, which its code uses."""
    with Path("/proc/cpuinfo").open(encoding="utf-8") as file:
        flags = next((line for line in file if line.startswith("flags")), "")
    return version("numba"), *sorted(flags.split())


@cache
def content_stamp(path: Path) -> str:
    """Return a hash of a file, of the compiler's, and of all files of ``_PACKAGES`` it imports.

    Indirect imports count.

    Parameters
    ----------
    path : Path
        Source file.

    Returns
    -------
    str
        The same for the same content, whatever the times of the files.
    """
    return sha256(b"".join(sorted(_digest(file) for file in _files_of(path)))).hexdigest()


@cache
def _files_of(path: Path) -> frozenset[Path]:
    """Return a file, that of the compiler, and all files of ``_PACKAGES`` that it imports."""
    files, new = {path, _COMPILER}, [path]
    while new:
        added = _imported_files(new.pop()) - files
        files |= added
        new += added
    return frozenset(files)


@cache
def _digest(path: Path) -> bytes:
    """Return a hash of one file."""
    return sha256(path.read_bytes()).digest()


@cache
def _imported_files(path: Path) -> frozenset[Path]:
    """Return the files of the modules of ``_PACKAGES`` that a file imports.

    They are found on disk: which of them are loaded depends on the program.
    """
    names = [
        name
        for module, imported in _IMPORT.findall(path.read_text(encoding="utf-8"))
        if module.partition(".")[0] in _PACKAGES
        for name in (module, *(f"{module}.{word}" for word in _WORD.findall(imported)))
    ]
    return frozenset(file for name in names if (file := _file_of(name)) is not None)


@cache
def _file_of(name: str) -> Path | None:
    """Return the source file of a module of ``_PACKAGES``; None if the name is no module."""
    package, *parts = name.split(".")
    spec = find_spec(package)
    for folder in (spec and spec.submodule_search_locations) or ():
        path = Path(folder).joinpath(*parts)
        for file in (path / "__init__.py", path.with_suffix(".py")):
            if file.is_file():
                return file
    return None
