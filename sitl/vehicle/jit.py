"""How every numerical kernel of the simulator is compiled: numba, cached on disk, IEEE arithmetic.

``fastmath`` stays off: mirror symmetry to rounding and byte-identical runs rest on the order of
operations as written."""

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


@structref.register
class NativeType(types.StructRef):
    """Numba's type of a ``Native``."""


class Native(structref.StructRefProxy):
    """A value kept where compiled code can reach it, as ``native`` makes it; kernels read its
    ``value``.

    Numba takes a NamedTuple apart at every call from Python, which for a whole model costs more
    than a step of it."""

    value: Any


structref.define_proxy(Native, NativeType, ["value"])  # type: ignore[no-untyped-call]


def kernel(function: Function) -> Function:
    """Compile a piece of the physics, merged into whatever kernel calls it.

    Inlining spares the copy of the model at every call: a step costs a quarter of what it does
    without."""
    return _compiled(function, forceinline=True)


def entry_point(function: Function) -> Function:
    """Compile a kernel that stays one function, called from loops elsewhere."""
    return _compiled(function, forceinline=False)


def _compiled(function: Function, forceinline: bool) -> Function:
    """``function`` compiled on first call, its machine code cached on disk.

    Numba renews a cached kernel when its own file changes, not when a kernel it calls lives in
    another file and changes there. Dropping cache entries older than the newest physics source
    closes that gap."""
    dispatcher = numba.njit(cache=True, error_model="numpy", forceinline=forceinline)(function)
    module = function.__module__.rpartition(".")[2]
    for index in Path(str(dispatcher.stats.cache_path)).glob(
        f"{module}.{function.__qualname__}-*.nbi"
    ):
        if index.stat().st_mtime_ns < _NEWEST_PHYSICS_NS:
            index.unlink(missing_ok=True)
    return cast(Function, dispatcher)


def native(value: tuple[Any, ...]) -> Native:
    """``value``, a NamedTuple of numbers and arrays, once for all calls."""
    return _packer(type(value))(value)


@cache
def _packer(kind: type) -> Callable[[Any], Native]:
    """A function of its own for every type: numba's index of what it has cached names all types
    that a function was compiled for, and to read it is to import the modules of them all, whoever
    they belong to."""

    def pack(value: Any) -> Native:
        return Native(value)  # type: ignore[no-untyped-call]

    pack.__qualname__ = f"pack.{kind.__module__}.{kind.__qualname__}"
    return entry_point(pack)
