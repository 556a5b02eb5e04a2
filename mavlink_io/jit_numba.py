"""Compilation with numba, with the machine code cached on disk.

Numba learns two things here: to call the functions marked with ``jit.numeric``, and the method
``_replace`` of NamedTuples.

``fastmath`` is off: mirror symmetry to rounding and byte-identical runs need the order of
operations as written.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from struct import calcsize
from types import FunctionType
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba import types
from numba.core import cgutils
from numba.core.caching import FunctionCache, InTreeCacheLocator, UserWideCacheLocator
from numba.core.runtime.nrt import rtsys
from numba.core.typing.templates import (
    AbstractTemplate,
    AttributeTemplate,
    infer_getattr,
    signature,
)
from numba.experimental import structref
from numba.extending import intrinsic, lower_builtin, typeof_impl

from mavlink_io.jit import NUMERIC

Function = TypeVar("Function", bound=Callable[..., Any])

_PACKAGES = ("mavlink_io", "autopilot", "sitl", "sysid")
"""Packages that have kernels: a kernel depends on what its file imports from them."""
_IMPORT = re.compile(r"^from ([\w.]+) import (\([^)]*\)|[^\n]*)", re.MULTILINE)
_WORD = re.compile(r"\w+")


@structref.register
class NativeType(types.StructRef):
    """Numba type of a ``Native``."""

    @property
    def key(self) -> object:
        """Return what tells two types apart.

        Numba takes the name, which is the same for two records of one name in two modules: one
        record's reference is then taken for the other's.
        """
        return type(self), self._fields


class Native(structref.StructRefProxy):
    """Reference to a value in memory of compiled code."""

    value: Any
    source: Any
    """The value in Python, which owns the arrays."""


structref.define_proxy(Native, NativeType, ["value"])


@typeof_impl.register(FunctionType)
def _type_of_function(function: FunctionType, context: Any) -> types.Type | None:
    """Return the type of a function marked with ``jit.numeric``; None for others."""
    return types.Dispatcher(_called(function)) if function in NUMERIC else None


@cache
def _called(function: FunctionType) -> Any:
    """Return a numeric function, compiled for the kernels that call it.

    It is inlined: the parameters of the autopilot are a record of 127 numbers, which every call
    would copy.
    """
    return numba.njit(error_model="numpy", forceinline=True)(function)


class _ReplaceFields(AbstractTemplate):
    """Type of ``record._replace(name=value)``: the record with the types of the new values."""

    key = "NamedTuple._replace"
    this: Any

    def generic(self, args: tuple[Any, ...], kws: dict[str, Any]) -> Any:
        """Return the signature; a field that keeps its value is an omitted argument."""
        old = self.this
        given = [kws.get(name, types.Omitted(None)) for name in old.fields]
        kept = zip(old.types, given, strict=True)
        new = [was if isinstance(now, types.Omitted) else now for was, now in kept]
        made = types.BaseTuple.from_types(new, old.instance_class)
        keyword = inspect.Parameter.POSITIONAL_OR_KEYWORD
        fields = [inspect.Parameter(name, keyword, default=None) for name in old.fields]
        typed = signature(made, *given, recvr=old)
        return typed.replace(pysig=inspect.Signature(fields))


@infer_getattr
class _RecordMethods(AttributeTemplate):
    """Methods of NamedTuples."""

    key = types.BaseNamedTuple

    def resolve__replace(self, record: Any) -> Any:
        """Return the bound method ``_replace``."""
        return types.BoundFunction(_ReplaceFields, record)


@lower_builtin(_ReplaceFields.key, types.BaseNamedTuple, types.VarArg(types.Any))
def _replace_fields(context: Any, builder: Any, typed: Any, args: tuple[Any, ...]) -> Any:
    """Return the machine code of ``_replace``."""
    record, *new = args
    given = zip(typed.args[1:], new, strict=True)
    items = [
        builder.extract_value(record, i) if isinstance(kind, types.Omitted) else value
        for i, (kind, value) in enumerate(given)
    ]
    return context.make_tuple(builder, typed.return_type, items)


class _SourceStamp:
    """Source stamp of a kernel: its own file and the files that it imports kernels from.

    Numba by itself notices a change of the kernel's own file only.
    """

    _py_file: str

    def get_source_stamp(self) -> str:
        """Return the stamp; machine code with another stamp is not used."""
        return _content_stamp(Path(self._py_file))


class InTreeLocator(_SourceStamp, InTreeCacheLocator):
    """Cache next to the source file."""


class UserWideLocator(_SourceStamp, UserWideCacheLocator):
    """Cache in the user's folder, for sources in a folder that cannot be written."""


numba.config.CACHE_LOCATOR_CLASSES = ",".join(  # type: ignore[attr-defined]
    f"{__name__}.{locator.__name__}" for locator in (InTreeLocator, UserWideLocator)
)


@cache
def _content_stamp(path: Path) -> str:
    """Return a hash of a file, of this one, and of all files of ``_PACKAGES`` that it imports.

    Indirect imports count. This file counts because it decides how code is compiled.

    Parameters
    ----------
    path : Path
        Source file.

    Returns
    -------
    str
        The same for the same content, whatever the times of the files.
    """
    files, new = {path, Path(__file__)}, [path]
    while new:
        added = _imported_files(new.pop()) - files
        files |= added
        new += added
    return sha256(b"".join(sorted(_digest(file) for file in files))).hexdigest()


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


class _MachineCodeCache(FunctionCache):
    """Machine code of a function on disk, loaded without what only a compilation needs.

    Before it looks for machine code, numba imports the implementation of every function that it can
    compile: 0.3 s and 60 MB. The code itself needs only numba's memory management. A function that
    is not found is compiled, for which numba imports them then.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled function for a signature; None if it is not on disk."""
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)

    def is_empty(self) -> bool:
        """Return whether the disk has no machine code of the present source."""
        return not self._cache_file._load_index()


def compiled(function: Function, *, inline: bool) -> Function:
    """Return ``function`` compiled at its first call, with its machine code cached on disk.

    Parameters
    ----------
    function : callable
        Function of numbers, arrays and NamedTuples.
    inline : bool
        Whether it is inlined into the kernels that call it.

    Returns
    -------
    callable
        The compiled function.
    """
    dispatcher: Any = numba.njit(error_model="numpy", forceinline=inline)(function)
    dispatcher._cache = _MachineCodeCache(function)
    return cast(Function, dispatcher)


def is_stored(function: Any) -> bool:
    """Return whether the machine code of a compiled function is on disk.

    Parameters
    ----------
    function : callable
        Result of ``compiled``.

    Returns
    -------
    bool
        Whether its first call only loads it.
    """
    return not function._cache.is_empty()


def machine_code(function: Any, arguments: tuple[Any, ...]) -> Any:
    """Return the machine code of a compiled function for arguments of given types.

    Parameters
    ----------
    function : callable
        Result of ``compiled``.
    arguments : tuple
        Arguments with the types of all later calls.

    Returns
    -------
    callable
        Function of C that converts the arguments and calls the code.
    """
    given = tuple(map(function.typeof_pyval, arguments))
    function.compile(given)
    return function.overloads[given].entry_point


_C_TYPES: dict[str, Any] = {"i": types.intc, "I": types.uintc, "l": types.int_, "P": types.uintp}
"""Type of numba by its letter in the module ``struct``."""


def c_function(name: str, letters: str) -> Callable[..., int]:
    """Return a function of the C library for compiled code.

    Parameters
    ----------
    name : str
        Name of the function.
    letters : str
        Its result and its arguments, as in the module ``struct``.

    Returns
    -------
    callable
        The function.
    """
    result, *arguments = (_C_TYPES[letter] for letter in letters)
    return cast(Callable[..., int], types.ExternalFunction(name, result(*arguments)))


def numbers(count: int) -> Any:
    """Return an array of zeros.

    Parameters
    ----------
    count : int
        Length.

    Returns
    -------
    ndarray
        Array of float64.
    """
    return np.zeros(count)


def octets(count: int) -> Any:
    """Return memory of zeros.

    Parameters
    ----------
    count : int
        Length.

    Returns
    -------
    ndarray
        Array of uint8.
    """
    return np.zeros(count, np.uint8)


def view(octets: Any, code: str) -> Any:
    """Return memory as numbers of another type.

    Parameters
    ----------
    octets : ndarray
        Array of uint8.
    code : str
        Type of the numbers, as in the module ``struct``.

    Returns
    -------
    ndarray
        Array on the same memory.
    """
    return octets.view(np.dtype(code))


def native(value: tuple[Any, ...]) -> Native:
    """Return a reference to ``value`` in memory of compiled code.

    Parameters
    ----------
    value : NamedTuple
        Record of numbers, arrays, random generators and other such records.

    Returns
    -------
    Native
        Its attribute ``value`` is readable in compiled code.
    """
    packed = _packer(type(value))(value)
    packed.source = value
    return packed


def _type_borrow(_: Any, value: Any) -> Any:
    """Type ``_borrow(record)``: the record without reference counts of its arrays and generators.

    Compiled code counts the references of every array of a record at each call that it inlines: for
    a vehicle model that takes a tenth of a tick.
    """

    def codegen(context: Any, builder: Any, typed: Any, arguments: Any) -> Any:
        return _borrowed(context, builder, typed.return_type, arguments[0])

    return value(value), codegen


_borrow = cast(Callable[[Any], Any], intrinsic(_type_borrow))


def _borrowed(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """Return the machine code of ``_borrow`` for a value of a type."""
    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder, value)
        array.meminfo = array.parent = cgutils.get_null_value(array.meminfo.type)
        return array._getvalue()
    if isinstance(kind, types.NumPyRandomGeneratorType):
        generator = cgutils.create_struct_proxy(kind)(context, builder, value)
        generator.meminfo = cgutils.get_null_value(generator.meminfo.type)
        return generator._getvalue()
    if isinstance(kind, types.BaseTuple):
        for index, part in enumerate(cast(Iterable[Any], kind)):
            item = _borrowed(context, builder, part, builder.extract_value(value, index))
            value = builder.insert_value(value, item, index)
    return value


def _places(builder: Any, context: Any, memory: Any, at: Any, layout: str) -> list[tuple[Any, Any]]:
    """Return type and address of each number of a layout in the memory of an array."""
    start = builder.gep(builder.bitcast(memory.data, cgutils.voidptr_t), [at])
    places, offset = [], 0
    for letter in _letters(layout):
        kind = _FIELD_TYPES[letter]
        place = builder.gep(start, [context.get_constant(types.intp, offset)])
        places.append((kind, builder.bitcast(place, context.get_value_type(kind).as_pointer())))
        offset += calcsize(f"<{letter}")
    return places


def _letters(layout: str) -> list[str]:
    """Return the type of each number of a format of the module ``struct``."""
    return [letter for count, letter in _FIELD.findall(layout) for _ in range(int(count or 1))]


def _type_pack(_: Any, memory: Any, at: Any, values: Any, layout: Any) -> Any:
    """Type ``pack(memory, at, values, layout)``."""

    def codegen(context: Any, builder: Any, typed: Any, arguments: Any) -> Any:
        array = context.make_array(memory)(context, builder, arguments[0])
        start = context.cast(builder, arguments[1], at, types.intp)
        places = _places(builder, context, array, start, layout.literal_value)
        items = _flat_items(builder, values, arguments[2])
        for (stored, place), (kind, item) in zip(places, items, strict=True):
            builder.store(context.cast(builder, item, kind, stored), place, align=1)
        return context.get_dummy_value()

    return types.void(memory, at, values, layout), codegen


def _type_unpack(_: Any, memory: Any, at: Any, layout: Any) -> Any:
    """Type ``unpack(memory, at, layout)``."""
    read = types.Tuple(
        [
            types.UniTuple(_READ_TYPES[letter], int(count)) if count else _READ_TYPES[letter]
            for count, letter in _FIELD.findall(layout.literal_value)
        ]
    )

    def codegen(context: Any, builder: Any, typed: Any, arguments: Any) -> Any:
        array = context.make_array(memory)(context, builder, arguments[0])
        start = context.cast(builder, arguments[1], at, types.intp)
        places = _places(builder, context, array, start, layout.literal_value)
        numbers = [
            context.cast(builder, builder.load(place, align=1), stored, _READ_TYPES[letter])
            for letter, (stored, place) in zip(_letters(layout.literal_value), places, strict=True)
        ]
        return _nested(context, builder, read, iter(numbers))

    return read(memory, at, layout), codegen


_FIELD = re.compile(r"(\d*)([a-zA-Z])")
"""Number and type of equal fields in a format of the module ``struct``."""
_FIELD_TYPES: dict[str, Any] = {
    "f": types.float32,
    "d": types.float64,
    "b": types.int8,
    "B": types.uint8,
    "h": types.int16,
    "H": types.uint16,
    "i": types.int32,
    "I": types.uint32,
    "q": types.int64,
    "Q": types.uint64,
}


_READ_TYPES: dict[str, Any] = {
    letter: types.float64 if letter in "fd" else types.int64 for letter in _FIELD_TYPES
}


def _nested(context: Any, builder: Any, kind: Any, numbers: Iterator[Any]) -> Any:
    """Return a value of a type from its numbers: one of them, or a tuple."""
    if not isinstance(kind, types.BaseTuple):
        return next(numbers)
    parts = [_nested(context, builder, part, numbers) for part in cast(Iterable[Any], kind)]
    return context.make_tuple(builder, kind, parts)


def _flat_items(builder: Any, kind: Any, value: Any) -> list[tuple[Any, Any]]:
    """Return type and value of the numbers of a record and of its records."""
    if not isinstance(kind, types.BaseTuple):
        return [(kind, value)]
    return [
        item
        for index, part in enumerate(cast(Iterable[Any], kind))
        for item in _flat_items(builder, part, builder.extract_value(value, index))
    ]


pack = intrinsic(prefer_literal=True)(_type_pack)
"""Write a tuple of numbers, and of such tuples, into memory: see ``jit.packer``."""
unpack = intrinsic(prefer_literal=True)(_type_unpack)
"""Read numbers from memory: see ``jit.unpacker``."""


@cache
def _packer(kind: type) -> Callable[[Any], Native]:
    """Return a compiled function that wraps values of type ``kind``; one function per type.

    The cache index of a numba function lists all types that it was compiled for, and reading the
    index imports the modules of all of them. One function per type avoids these imports.
    """

    def pack(value: Any) -> Native:
        return Native(_borrow(value))

    pack.__qualname__ = f"pack.{kind.__module__}.{kind.__qualname__}"
    return compiled(pack, inline=False)
