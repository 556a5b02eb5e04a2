"""Compilation with numba, with the machine code cached on disk.

Numba learns here to call the functions marked with ``jit.numeric``, the method ``_replace`` of
NamedTuples, and references to records (``jit.native``). Each function that it compiles is also
stored for processes without numba (``mavlink_io.stored_code``).

``fastmath`` is off: mirror symmetry to rounding and byte-identical runs need the order of
operations as written.
"""

from __future__ import annotations

import inspect
import pickle
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from pathlib import Path
from struct import calcsize
from types import FunctionType
from typing import Any, cast

import numba
from numba import types
from numba.core import cgutils
from numba.core.caching import FunctionCache, InTreeCacheLocator, UserWideCacheLocator
from numba.core.imputils import impl_ret_borrowed
from numba.core.registry import cpu_target
from numba.core.runtime.nrt import rtsys
from numba.core.typing.templates import (
    AbstractTemplate,
    AttributeTemplate,
    infer_getattr,
    signature,
)
from numba.experimental import structref
from numba.extending import NativeValue, box, intrinsic, lower_builtin, typeof_impl, unbox
from numba.np.numpy_support import as_dtype

from mavlink_io.jit import NUMERIC
from mavlink_io.jit_stored import Native
from mavlink_io.stored_code import argument_types, store
from mavlink_io.stored_code.store import CompilerEnvironment, ObjectCode, Source


@structref.register
class NativeType(types.StructRef):
    """Numba type of a ``Native``."""

    @property
    def key(self) -> object:
        """Return a key that differs between two types.

        Numba takes the name, which is the same for two records of one name in two modules: one
        record's reference is then taken for the other's.
        """
        return type(self), self._fields


structref.define_constructor(Native, NativeType, ["value"])


@box(NativeType)
def _box_native(kind: Any, value: Any, c: Any) -> Any:
    """Return the machine code that returns a ``Native`` to Python."""
    reference = cgutils.create_struct_proxy(kind)(c.context, c.builder, value=value)
    memory = c.box(_MEMORY, reference.meminfo)
    constructor = c.pyapi.unserialize(c.pyapi.serialize_object(Native))
    boxed = c.pyapi.call_function_objargs(constructor, [memory])
    c.pyapi.decref(constructor)
    c.pyapi.decref(memory)
    return boxed


@unbox(NativeType)
def _unbox_native(kind: Any, boxed: Any, c: Any) -> Any:
    """Return the machine code that takes a ``Native`` from Python."""
    memory = c.pyapi.object_getattr_string(boxed, "_meminfo")
    reference = cgutils.create_struct_proxy(kind)(c.context, c.builder)
    reference.meminfo = c.unbox(_MEMORY, memory).value
    c.pyapi.decref(memory)
    return NativeValue(reference._getvalue())


_MEMORY = types.MemInfoPointer(types.voidptr)


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
    made = context.make_tuple(builder, typed.return_type, items)
    return impl_ret_borrowed(context, builder, typed.return_type, made)


class _SourceStamp:
    """Source stamp of a kernel: its own file and the files that it imports kernels from.

    Numba by itself notices a change of the kernel's own file only.
    """

    _py_file: str

    def get_source_stamp(self) -> str:
        """Return the stamp; machine code with another stamp is not used."""
        return store.content_stamp(Path(self._py_file))


class InTreeLocator(_SourceStamp, InTreeCacheLocator):
    """Cache next to the source file."""


class UserWideLocator(_SourceStamp, UserWideCacheLocator):
    """Cache in the user's folder, for sources in a folder that cannot be written."""


numba.config.CACHE_LOCATOR_CLASSES = ",".join(  # type: ignore[attr-defined]
    f"{__name__}.{locator.__name__}" for locator in (InTreeLocator, UserWideLocator)
)


_STALE = (AttributeError, ImportError, EOFError, pickle.UnpicklingError)
"""Errors of an index that names a class which the present source has under another name, or that is
damaged. Numba reads the index before it compares the stamps."""


class _MachineCodeCache(FunctionCache):
    """Machine code of a function on disk, for numba and for processes without it.

    Before it looks for machine code, numba imports the implementation of every function that it can
    compile: 0.3 s and 60 MB. The code itself needs only numba's memory management. A function that
    is not found is compiled, for which numba imports them then.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._source = Source.of(function)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled function for a signature; None if it is not on disk."""
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            key = self._index_key(sig, target_context.codegen())
            data = self._load(key)
            if data is None:
                return None
            result = self._impl.rebuild(target_context, data)
            (_, _, (content, _)), *_ = data
            self._store(result, result.referenced_envs, content)
            return result

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save the compiled function for a signature."""
        super().save_overload(sig, data)
        if not data.library.has_dynamic_globals:
            content = data.library._get_compiled_object()
            self._store(data, data._find_referenced_environments(), content)

    def is_empty(self) -> bool:
        """Return whether the disk has no machine code of the present source."""
        try:
            return not self._cache_file._load_index()
        except _STALE:
            return True

    def _load(self, key: Any) -> Any:
        """Return the data of a key; None if there is none, or the index is of another version."""
        try:
            return self._cache_file.load(key)
        except _STALE:
            self._cache_file.flush()
            return None

    def _store(self, result: Any, environments: Iterable[Any], content: bytes) -> None:
        """Store the object code for processes without numba."""
        if not store.is_supported():
            return
        try:
            names = [_type_name(kind) for kind in result.signature.args]
        except TypeError:
            return
        types_name = argument_types.tuple_name("", names)
        if store.find(self._source, types_name) is not None:
            return
        constants = {
            result.environment.env_name: tuple(result.environment.consts),
            **{environment.env_name: tuple(environment.consts) for environment in environments},
        }
        code = ObjectCode(
            content=content,
            symbol=result.fndesc.llvm_cpython_wrapper_name.encode(),
            environments=tuple(
                CompilerEnvironment(name.encode(), values)
                for name, values in constants.items()
                if values
            ),
        )
        store.save(self._source, types_name, code)


def _type_name(kind: Any) -> str:
    """Return the name of a type of numba, as ``argument_types`` names the type of a value."""
    if isinstance(kind, types.Literal):
        raise TypeError(f"{kind} has no name here")
    if isinstance(kind, types.Omitted):
        return argument_types.OMITTED
    if isinstance(kind, NativeType):
        return argument_types.native_name(_type_name(kind._fields[0][1]))
    if isinstance(kind, types.BaseTuple):
        items = [_type_name(part) for part in cast(Iterable[Any], kind)]
        record = getattr(kind, "instance_class", tuple)
        fields = getattr(kind, "fields", ())
        return argument_types.tuple_name(argument_types.record_name(record, tuple(fields)), items)
    if isinstance(kind, types.PyArray):
        return argument_types.buffer_name(as_dtype(kind.dtype).str)
    if isinstance(kind, types.Array):
        name, writable = as_dtype(kind.dtype).str, kind.mutable
        return argument_types.array_name(name, kind.ndim, kind.layout, writable=writable)
    if kind not in _TYPE_NAMES:
        raise TypeError(f"{kind} has no name here")
    return _TYPE_NAMES[kind]


_TYPE_NAMES: dict[Any, str] = {
    types.float64: argument_types.FLOAT,
    types.int64: argument_types.INTEGER,
    types.boolean: argument_types.BOOLEAN,
    types.complex128: argument_types.COMPLEX,
    types.none: argument_types.NONE,
    types.NumPyRandomGeneratorType("NumPyRandomGeneratorType"): argument_types.GENERATOR,
}


def compiled(function: Callable[..., Any], *, inline: bool) -> Any:
    """Return ``function`` compiled at its first call, with its machine code cached on disk.

    Parameters
    ----------
    function : callable
        Function of numbers, arrays and NamedTuples.
    inline : bool
        Whether it is inlined into the kernels that call it.

    Returns
    -------
    Dispatcher
        The function of numba.
    """
    dispatcher: Any = numba.njit(error_model="numpy", forceinline=inline)(function)
    dispatcher._cache = _MachineCodeCache(function)
    return dispatcher


def is_cached(dispatcher: Any) -> bool:
    """Return whether numba has the machine code of a function on disk.

    Parameters
    ----------
    dispatcher : Dispatcher
        Result of ``compiled``.

    Returns
    -------
    bool
        Whether its first call only loads it.
    """
    return not dispatcher._cache.is_empty()


def machine_code(dispatcher: Any, arguments: Sequence[Any], omitted: Sequence[bool]) -> Any:
    """Return the machine code of a compiled function for arguments of given types.

    Parameters
    ----------
    dispatcher : Dispatcher
        Result of ``compiled``.
    arguments : sequence
        Arguments with the types of all later calls.
    omitted : sequence of bool
        Which of them are default values that the calls leave out.

    Returns
    -------
    callable
        Function of C that converts the arguments and calls the code.
    """
    given = tuple(
        types.Omitted(argument) if is_omitted else dispatcher.typeof_pyval(argument)
        for argument, is_omitted in zip(arguments, omitted, strict=True)
    )
    dispatcher.compile(given)
    return dispatcher.overloads[given].entry_point


def type_of_function(dispatcher: Any) -> Any:
    """Return the type of a compiled function for kernels that call it."""
    return types.Dispatcher(dispatcher)


def type_of_global(name: str, *arguments: str) -> Any:
    """Return the type of an object that only compiled code can use.

    Parameters
    ----------
    name : str
        ``pack``, ``unpack`` or ``c_function``.
    *arguments : str
        Name and types of the function of the C library.

    Returns
    -------
    Type
        Type of numba.
    """
    if name == "c_function":
        return _c_function(*arguments)
    return cpu_target.typing_context.resolve_value_type(pack if name == "pack" else unpack)


def native_type(source: tuple[Any, ...]) -> NativeType:
    """Return the type of a reference to a record.

    Parameters
    ----------
    source : NamedTuple
        The record.

    Returns
    -------
    NativeType
        Type of numba.
    """
    return NativeType([("value", numba.typeof(source))])


_C_TYPES: dict[str, Any] = {"i": types.intc, "I": types.uintc, "l": types.int_, "P": types.uintp}
"""Type of numba by its letter in the module ``struct``."""


def _c_function(name: str, letters: str) -> Any:
    """Return a function of the C library; its types as in ``jit.c_function``."""
    result, *arguments = (_C_TYPES[letter] for letter in letters)
    return types.ExternalFunction(name, result(*arguments))


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


def packer(qualname: str) -> Any:
    """Return a compiled function that wraps a record in memory of compiled code.

    Parameters
    ----------
    qualname : str
        Name of the function, which names the type of the record: one function per type.

    Returns
    -------
    Dispatcher
        The function of numba.
    """

    def pack(value: Any) -> Native:
        return Native(_borrow(value))

    pack.__qualname__ = qualname
    return compiled(pack, inline=False)
