"""Compilation of the numerical kernels of the simulator with numba, cached on disk.

``fastmath`` is off: mirror symmetry to rounding and byte-identical runs need the order of
operations as written.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba import types
from numba.experimental import structref
from numpy.typing import NDArray

Function = TypeVar("Function", bound=Callable[..., Any])
Vector = NDArray[np.float64]
Vector3 = tuple[float, float, float]
Wrench = tuple[float, float, float, float, float, float]
"""Generalised force (X, Y, Z, K, M, N) on the body in FLU axes about the origin, N and N m."""

_NEWEST_PHYSICS_NS = max(
    source.stat().st_mtime_ns for source in Path(__file__).parents[1].rglob("*.py")
)
"""Modification time of the newest source file of ``sitl``, ns."""


@structref.register
class NativeType(types.StructRef):
    """Numba type of a ``Native``."""


class Native(structref.StructRefProxy):
    """Reference to a value in memory of compiled code; ``native`` makes it, kernels read ``value``.

    Numba unpacks a NamedTuple argument at every call from Python; for a whole vehicle model this
    takes longer than an integration step.
    """

    value: Any


structref.define_proxy(Native, NativeType, ["value"])  # type: ignore[no-untyped-call]


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
        The compiled function; compilation happens at the first call.
    """
    return _compiled(function, forceinline=True)


def entry_point(function: Function) -> Function:
    """Compile a function that is not inlined; Python or other kernels call it.

    Parameters
    ----------
    function : callable
        Function of numbers, arrays and NamedTuples that numba can compile.

    Returns
    -------
    callable
        The compiled function; compilation happens at the first call.
    """
    return _compiled(function, forceinline=False)


def _compiled(function: Function, forceinline: bool) -> Function:
    """Return ``function`` compiled at its first call, with its machine code cached on disk.

    Numba recompiles a cached kernel when its own file changes, but not when a kernel that it calls
    changes in another file. Therefore cache entries older than the newest source file are removed.
    """
    dispatcher = numba.njit(cache=True, error_model="numpy", forceinline=forceinline)(function)
    module = function.__module__.rpartition(".")[2]
    for index in Path(str(dispatcher.stats.cache_path)).glob(
        f"{module}.{function.__qualname__}-*.nbi"
    ):
        if index.stat().st_mtime_ns < _NEWEST_PHYSICS_NS:
            index.unlink(missing_ok=True)
    return cast(Function, dispatcher)


def native(value: tuple[Any, ...]) -> Native:
    """Return a reference to ``value`` that kernels accept without unpacking it at every call.

    Parameters
    ----------
    value : NamedTuple
        Record of numbers, arrays and other such records.

    Returns
    -------
    Native
        Its attribute ``value`` is readable in compiled code.
    """
    return _packer(type(value))(value)


@cache
def _packer(kind: type) -> Callable[[Any], Native]:
    """Return a compiled function that wraps values of type ``kind``; one function per type.

    The cache index of a numba function lists all types that it was compiled for, and reading the
    index imports the modules of all of them. One function per type avoids these imports.
    """

    def pack(value: Any) -> Native:
        return Native(value)  # type: ignore[no-untyped-call]

    pack.__qualname__ = f"pack.{kind.__module__}.{kind.__qualname__}"
    return entry_point(pack)
