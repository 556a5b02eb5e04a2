"""Kernels from stored machine code, without the compiler; what is not stored numba compiles.

Compiled code calls functions of Python's C interface, of the C library, and of three extension
modules of numba: memory management, conversion of arguments, and function objects. The extension
modules are loaded alone, without the package ``numba`` and its LLVM.
"""

from __future__ import annotations

import builtins
import ctypes
import pickle
import sys
from collections.abc import Callable
from functools import cache, cached_property, update_wrapper
from importlib import import_module
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader, ModuleSpec
from importlib.util import find_spec, module_from_spec
from inspect import Parameter, signature
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

from mavlink_io.stored_code import argument_types, object_file, store
from mavlink_io.stored_code.argument_types import type_name
from mavlink_io.stored_code.store import ObjectCode, Source

Function = TypeVar("Function", bound=Callable[..., Any])


def _numba() -> Any:
    """Return the module that compiles; importing it takes half a second and 70 MB."""
    return import_module("mavlink_io.jit_numba")


class _CompilerObject:
    """Object that has a meaning for the compiler only."""

    def __init__(self, name: str, *arguments: str) -> None:
        self._name, self._arguments = name, arguments

    @property
    def _numba_type_(self) -> Any:
        """Type of the object of numba that this one stands for."""
        return _numba().type_of_global(self._name, *self._arguments)

    def __call__(self, *_: Any) -> Any:
        raise NotImplementedError(f"{self._name}: only compiled code can call it")


pack: Any = _CompilerObject("pack")
"""Write a tuple of numbers, and of such tuples, into memory: see ``jit.packer``."""
unpack: Any = _CompilerObject("unpack")
"""Read numbers from memory: see ``jit.unpacker``."""


def c_function(name: str, letters: str) -> Callable[..., int]:
    """Return a function of the C library for compiled code: see ``jit.c_function``."""
    return _CompilerObject("c_function", name, letters)


class Native:
    """Reference to a record in memory of compiled code."""

    value: Any
    """Readable in compiled code only."""
    source: Any
    """The record in Python, which owns the arrays."""

    def __init__(self, memory: Any) -> None:
        self._meminfo = memory

    @cached_property
    def type_name(self) -> str:
        """Name of the type."""
        return argument_types.native_name(type_name(self.source))

    @cached_property
    def _numba_type_(self) -> Any:
        """Type of numba."""
        return _numba().native_type(self.source)


class StoredFunction:
    """Function whose machine code is loaded at its first call, or else compiled and stored."""

    def __init__(
        self, function: Callable[..., Any], source: Source, compiler: Callable[[], Any]
    ) -> None:
        update_wrapper(self, function)
        self.__name__ = function.__name__
        self.source, self._compiler = source, compiler
        self._parameters = tuple(signature(function).parameters.values())
        self._code: dict[tuple[str, ...], Callable[..., Any]] = {}

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """Call the machine code for arguments of these types."""
        if named or len(arguments) != len(self._parameters):
            arguments = self._all_arguments(arguments, named)
        return self.code_for(arguments)(*arguments)

    def code_for(self, arguments: tuple[Any, ...]) -> Callable[..., Any]:
        """Return the machine code for arguments of these types."""
        try:
            types = tuple(map(_name_of, arguments))
        except TypeError:  # a type without a name
            return self._compile(arguments)
        code = self._code.get(types)
        if code is None:
            code = self._code[types] = self._load(types) or self._compile(arguments)
        return code

    @property
    def signatures(self) -> list[tuple[str, ...]]:
        """Types of arguments for which this process has machine code."""
        return list(self._code)

    @property
    def is_stored(self) -> bool:
        """Whether the machine code for some types is on disk."""
        return bool(store.stored_types(self.source))

    @cached_property
    def dispatcher(self) -> Any:
        """The function of numba."""
        return self._compiler()

    @property
    def _numba_type_(self) -> Any:
        """Type of the function of numba, for kernels that call this one."""
        return _numba().type_of_function(self.dispatcher)

    def _all_arguments(self, given: tuple[Any, ...], named: dict[str, Any]) -> tuple[Any, ...]:
        """Return an argument for each parameter; ``_OMITTED`` where it has its default value."""
        parameters = self._parameters[len(given) :]
        rest = tuple(
            named.pop(p.name, _OMITTED if p.default is not Parameter.empty else Parameter.empty)
            for p in parameters
        )
        is_missing = any(argument is Parameter.empty for argument in rest)
        if named or is_missing or len(given) > len(self._parameters):
            raise TypeError(f"{self.__name__}: wrong arguments")
        return *given, *rest

    def _load(self, types: tuple[str, ...]) -> Callable[..., Any] | None:
        """Return the stored machine code for arguments of these types; None if there is none."""
        code = store.find(self.source, argument_types.tuple_name("", types))
        if code is None:
            return None
        try:
            return _callable(self, code)
        except (OSError, ValueError):  # the system or numba is another than expected
            return None

    def _compile(self, arguments: tuple[Any, ...]) -> Callable[..., Any]:
        """Return machine code for arguments of these types, from numba."""
        given = [
            parameter.default if argument is _OMITTED else argument
            for argument, parameter in zip(arguments, self._parameters, strict=True)
        ]
        omitted = [argument is _OMITTED for argument in arguments]
        return cast(Callable[..., Any], _numba().machine_code(self.dispatcher, given, omitted))


class _Omitted:
    """Argument that was left out."""

    type_name = argument_types.OMITTED


_OMITTED = _Omitted()
_MAX_KNOWN_RECORDS = 8
"""Maximum number of records that are kept for it; they may hold large arrays."""
_known_records: dict[int, tuple[Any, str]] = {}
"""Type name of records seen last, by identity: to look at each field takes long for a model."""


def _name_of(value: Any) -> str:
    """Return the name of the type of a value."""
    if not isinstance(value, tuple):
        return type_name(value)
    known = _known_records.get(id(value))
    if known is None or known[0] is not value:
        if len(_known_records) >= _MAX_KNOWN_RECORDS:
            _known_records.clear()
        known = _known_records[id(value)] = value, type_name(value)
    return known[1]


def compiled(function: Function, *, inline: bool) -> Function:
    """Return the function in machine code: see ``jit.kernel`` and ``jit.entry_point``."""
    source = Source.of(function)
    stored = StoredFunction(function, source, lambda: _numba().compiled(function, inline=inline))
    return cast(Function, stored)


def is_stored(function: Callable[..., Any]) -> bool:
    """Return whether the machine code of a function is on disk: see ``jit.is_stored``."""
    stored = cast(StoredFunction, function)
    return stored.is_stored or (not store.is_supported() and _numba().is_cached(stored.dispatcher))


def machine_code(function: Function, arguments: tuple[Any, ...]) -> Function:
    """Return the machine code for arguments of given types: see ``jit.machine_code``."""
    return cast(Function, cast(StoredFunction, function).code_for(arguments))


def native(value: tuple[Any, ...]) -> Native:
    """Return a reference to a record in memory of compiled code: see ``jit.native``."""
    packed = cast(Native, _packer(type(value))(value))
    packed.source = value
    return packed


@cache
def _packer(kind: type) -> StoredFunction:
    """Return the compiled function that wraps values of a type; one function per type.

    One file for all types would import the modules of all of them.
    """

    def pack(value: Any) -> Native:
        raise NotImplementedError

    qualname = f"pack.{kind.__module__}.{kind.__qualname__}"
    source = Source(Path(__file__).with_name("jit_numba.py"), qualname)
    return StoredFunction(pack, source, lambda: _numba().packer(qualname))


def numbers(count: int) -> Any:
    """Return an array of zeros, of float64."""
    return np.zeros(count)


def octets(count: int) -> Any:
    """Return memory of zeros, an array of uint8."""
    return np.zeros(count, np.uint8)


def view(octets: Any, code: str) -> Any:
    """Return the memory of an array as numbers of another type, as in the module ``struct``."""
    return octets.view(np.dtype(code))


def _callable(function: StoredFunction, code: ObjectCode) -> Callable[..., Any]:
    """Return the function of C that converts arguments and calls the machine code."""
    addresses = object_file.place(code.content, _address_of)
    _unpickle_objects(code.content, addresses)
    dynfunc = _extension("_dynfunc")
    special = {entry.symbol: entry.constants for entry in code.environments}
    environments = []
    for symbol, address in addresses.items():
        if symbol.startswith(_ENVIRONMENT):
            environment = dynfunc.Environment({})
            environment.consts.extend(special.get(symbol, ()))
            environments.append(environment)
            ctypes.c_size_t.from_address(address).value = id(environment)
    return cast(
        Callable[..., Any],
        dynfunc.make_function(
            sys.modules.get(function.__module__),
            function.__name__,
            function.__doc__ or "",
            addresses[code.symbol],
            environments[0],
            (environments,),
        ),
    )


def _unpickle_objects(content: bytes, addresses: dict[bytes, int]) -> None:
    """Unpickle the objects of Python in machine code, so that its calls of `_unpickle` find them.

    Ctrl-C during an unpickling that compiled code has called gives it NULL in place of an object.
    """
    sizes = object_file.symbol_sizes(content) if _PICKLED in content else {}
    for name, size in sizes.items():
        if name.startswith(_PICKLED) and b".sha1" not in name:
            _unpickle(addresses[name], size)


_PICKLED = b".const.pickledata."
"""Start of the names of pickled objects; their hashes have ``.sha1`` in the name."""
_ENVIRONMENT = b"_ZN08NumbaEnv"
"""Start of the names of variables that hold the address of an environment."""


@cache
def _extension(name: str) -> Any:
    """Return an extension module of numba, loaded without the package."""
    spec = find_spec("numba")
    folders = (spec and spec.submodule_search_locations) or ["."]
    path = Path(folders[0], *name.split(".")).with_suffix(EXTENSION_SUFFIXES[0])
    full_name = f"numba.{name}"
    loader = ExtensionFileLoader(full_name, str(path))
    module = module_from_spec(ModuleSpec(full_name, loader, origin=str(path)))
    loader.exec_module(module)
    return module


@cache
def _helpers() -> dict[str, int]:
    """Return the addresses of numba's own functions and of objects of Python, by symbol."""
    runtime = _extension("core.runtime._nrt_python").c_helpers
    helpers = {**_extension("_helperlib").c_helpers, **_extension("_dynfunc").c_helpers}
    exceptions = {
        f"PyExc_{name}": id(value)
        for name, value in vars(builtins).items()
        if isinstance(value, type) and issubclass(value, BaseException)
    }
    return {
        "_Py_NoneStruct": id(None),
        **exceptions,
        **{f"numba_{name}": address for name, address in helpers.items()},
        "numba_unpickle": ctypes.cast(_UNPICKLE, ctypes.c_void_p).value or 0,
        **{name if name[0] == "_" else f"NRT_{name}": value for name, value in runtime.items()},
    }


@cache
def _unpickle(address: int, size: int) -> Any:
    """Return an object of Python in compiled code; numba's own function would import numba.

    An object at an address does not change. The cache is a function of C, which no signal
    interrupts: compiled code does not expect an exception here. `_unpickle_objects` fills it.
    """
    return pickle.loads(ctypes.string_at(address, size))


_UNPICKLE = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p, ctypes.c_int)(_unpickle)
"""Function of C. Callers pass a hash as third argument, which the calling convention ignores."""


@cache
def _libraries() -> tuple[ctypes.CDLL, ...]:
    """Return the process, with Python and the C library, and the library of mathematics."""
    return ctypes.CDLL(None), ctypes.CDLL("libm.so.6")


def _address_of(symbol: bytes) -> int:
    """Return the address of a symbol that compiled code refers to."""
    name = symbol.decode()
    address = _helpers().get(name)
    if address is not None:
        return address
    for library in _libraries():
        if hasattr(library, name):
            return ctypes.cast(library[name], ctypes.c_void_p).value or 0
    raise ValueError(f"no function {name}")
