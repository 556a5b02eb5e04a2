"""Compilation of numerical functions, the same source with and without numba.

With numba the decorated functions are machine code; without it they are the Python functions
themselves. NUMBA_DISABLE_JIT=1 selects Python where numba is installed.
"""

import os
from array import array
from collections.abc import Callable
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Protocol, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., Any])

COMPILED = find_spec("numba") is not None and os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0")
"""Whether kernels are compiled."""


class Native(Protocol):
    """Reference to a record in memory of compiled code; made by ``native``, read by kernels.

    Numba unpacks a NamedTuple argument at every call from Python; for a whole vehicle model this
    takes longer than an integration step.
    """

    value: Any


class Numbers(Protocol):
    """Array of floats that Python and kernels read and write: a buffer."""

    def __getitem__(self, index: Any) -> Any:
        """Return a number or a part of the array."""

    def __setitem__(self, index: Any, value: Any) -> None:
        """Set a number or a part of the array."""

    def __len__(self) -> int:
        """Return the number of numbers."""

    def __buffer__(self, flags: int, /) -> memoryview:
        """Return the memory."""

    def tolist(self) -> list[float]:
        """Return the numbers."""


class _Compiler(Protocol):
    """What this module takes from ``mavlink_io.jit_stored``."""

    def compiled(self, function: Function, *, inline: bool) -> Function:
        """Return the compiled function."""

    def is_stored(self, function: Callable[..., Any]) -> bool:
        """Return whether the machine code is on disk."""

    def machine_code(self, function: Function, arguments: tuple[Any, ...]) -> Function:
        """Return the machine code for arguments of these types."""

    def native(self, value: tuple[Any, ...]) -> Native:
        """Return a reference to the record."""

    def c_function(self, name: str, types: str) -> Callable[..., int]:
        """Return a function of the C library."""

    def pack(self, octets: Any, at: int, values: tuple[Any, ...], layout: str) -> None:
        """Pack numbers into octets."""

    def unpack(self, octets: Any, at: int, layout: str) -> tuple[Any, ...]:
        """Unpack numbers from octets."""

    def numbers(self, count: int) -> Numbers:
        """Return an array of zeros."""

    def octets(self, count: int) -> Any:
        """Return memory of zeros."""

    def view(self, octets: Any, code: str) -> Any:
        """Return the same memory as numbers of another type."""


NUMERIC = set[Callable[..., Any]]()
"""Functions marked with ``numeric``."""


@cache
def _compiler() -> _Compiler:
    """Return the module that loads machine code, and compiles what is not stored.

    It is imported by name: the vehicle's computer has no numpy, and the autopilot must not depend
    on it.
    """
    return cast(_Compiler, import_module("mavlink_io.jit_stored"))


class _Record:
    """Reference to a record for kernels that are not compiled."""

    def __init__(self, value: Any) -> None:
        self.value = value


def numeric(function: Function) -> Function:
    """Mark a function that kernels may call; called from Python it is the function itself.

    For functions that Python calls with small records: to unpack them for compiled code would take
    longer than the function.

    Parameters
    ----------
    function : callable
        Function of numbers, arrays and NamedTuples that numba can compile.

    Returns
    -------
    callable
        The same function.
    """
    NUMERIC.add(function)
    return function


def kernel(function: Function) -> Function:
    """Compile a function that is inlined into the kernels that call it.

    Inlining avoids a copy of the model at every call: a step takes a quarter of the time.

    Parameters
    ----------
    function : callable
        Function of numbers, arrays and NamedTuples that numba can compile.

    Returns
    -------
    callable
        The compiled function, compiled at the first call; the function itself without numba.
    """
    return _compiler().compiled(function, inline=True) if COMPILED else function


def entry_point(function: Function) -> Function:
    """Compile a function that is not inlined; Python or other kernels call it.

    Parameters
    ----------
    function : callable
        Function of numbers, arrays and NamedTuples that numba can compile.

    Returns
    -------
    callable
        The compiled function, compiled at the first call; the function itself without numba.
    """
    return _compiler().compiled(function, inline=False) if COMPILED else function


def numbers(count: int) -> Numbers:
    """Return an array of zeros for kernels; an array of the standard library without numba.

    Parameters
    ----------
    count : int
        Length.

    Returns
    -------
    Numbers
        The array.
    """
    return _compiler().numbers(count) if COMPILED else array("d", bytes(8 * count))


def octets(count: int) -> Any:
    """Return memory of zeros for kernels and sockets.

    Parameters
    ----------
    count : int
        Number of octets.

    Returns
    -------
    sequence of int
        An array; a memory view without numba.
    """
    return _compiler().octets(count) if COMPILED else memoryview(bytearray(count))


def view(octets: Any, code: str) -> Any:
    """Return memory as numbers of another type.

    Parameters
    ----------
    octets : sequence of int
        Memory from ``octets``.
    code : str
        Type of the numbers, as in the module ``struct``.

    Returns
    -------
    sequence of numbers
        Array or memory view on the same memory.
    """
    return _compiler().view(octets, code) if COMPILED else octets.cast(code)


def packer() -> Callable[[Any, int, tuple[Any, ...], str], None]:
    """Return the function of kernels that packs numbers into octets.

    Returns
    -------
    callable
        ``pack(memory, at, values, layout)`` writes a tuple of numbers and of such tuples from an
        octet of an array on. The layout is a constant format of the module ``struct`` that begins
        with "<"; a number must fit into its field. Only compiled code can call it.
    """
    return _compiler().pack


def unpacker() -> Callable[[Any, int, str], tuple[Any, ...]]:
    """Return the function of kernels that unpacks numbers from octets.

    Returns
    -------
    callable
        ``unpack(memory, at, layout)`` returns the numbers from an octet of an array on, with the
        layout of ``pack``; a letter with a count gives a tuple in the result. Unsigned integers of
        64 bits are negative above 2^63. Only compiled code can call it.
    """
    return _compiler().unpack


def c_function(name: str, types: str) -> Callable[..., int]:
    """Return a function of the C library for kernels; only compiled code can call it.

    Parameters
    ----------
    name : str
        Name of the function.
    types : str
        Its result and its arguments, as in the module ``struct``: ``i`` and ``I`` are int and
        unsigned int, ``l`` is long, ``P`` a size or the address of memory.

    Returns
    -------
    callable
        The function.
    """
    if COMPILED:
        return _compiler().c_function(name, types)

    def missing(*_: int) -> int:
        """Refuse to be called."""
        raise NotImplementedError(f"{name}: only compiled code can call it")

    return missing


def is_stored(function: Callable[..., Any]) -> bool:
    """Return whether the machine code of an entry point is on disk; never without numba.

    Parameters
    ----------
    function : callable
        Function marked with ``entry_point``.

    Returns
    -------
    bool
        Whether its first call only loads it. Otherwise that call compiles it, for up to a minute.
    """
    return COMPILED and _compiler().is_stored(function)


def machine_code(function: Function, *arguments: Any) -> Function:
    """Return the code of an entry point for arguments of given types.

    A call of it does not look at the types again, which takes longer than many a kernel. Other
    types in a later call are an error that is not noticed.

    Parameters
    ----------
    function : callable
        Function marked with ``entry_point``.
    *arguments : object
        Arguments with the types of all later calls.

    Returns
    -------
    callable
        The machine code; the function itself without numba.
    """
    return _compiler().machine_code(function, arguments) if COMPILED else function


def native(value: tuple[Any, ...]) -> Native:
    """Return a reference to ``value`` that kernels accept without unpacking it at every call.

    Parameters
    ----------
    value : NamedTuple
        Record of numbers, arrays, random generators and other such records.

    Returns
    -------
    Native
        Its attribute ``value`` is readable in kernels.
    """
    return _compiler().native(value) if COMPILED else _Record(value)
