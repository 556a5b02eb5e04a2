"""Names of the types for which kernels are compiled, from values.

``mavlink_io.jit_numba`` gives the types of numba the same names. A value whose name is not known
here is left to numba.
"""

from array import array
from collections.abc import Iterable
from typing import Any

import numpy as np

FLOAT, INTEGER, BOOLEAN, COMPLEX, NONE = "f8", "i8", "b1", "c16", "none"
"""Names of float, int, bool, complex and None."""
GENERATOR, OMITTED = "generator", "omitted"
"""Names of a random generator of numpy, and of an argument that was left out."""
_SCALARS: dict[type, str] = {
    float: FLOAT,
    int: INTEGER,
    bool: BOOLEAN,
    type(None): NONE,
    np.float64: FLOAT,
    np.int64: INTEGER,
    np.bool_: BOOLEAN,
    np.random.Generator: GENERATOR,
    complex: COMPLEX,
    np.complex128: COMPLEX,
}
_ARRAY_LAYOUTS: dict[tuple[bool, bool], str] = {
    (True, True): "C",
    (True, False): "C",
    (False, True): "F",
    (False, False): "A",
}


def array_name(dtype: str, dimensions: int, layout: str, *, writable: bool) -> str:
    """Return the name of an array type; ``dtype`` as in numpy, layout C, F or A."""
    return f"{dtype}[{dimensions}{layout}{'' if writable else 'r'}]"


def buffer_name(dtype: str) -> str:
    """Return the name of an array of the standard library."""
    return f"{dtype}[array]"


def record_name(kind: type, fields: tuple[str, ...]) -> str:
    """Return the name of a NamedTuple class; "" for a tuple."""
    return "" if kind is tuple else f"{kind.__module__}.{kind.__qualname__}:{','.join(fields)}"


def tuple_name(record: str, items: Iterable[str]) -> str:
    """Return the name of a tuple type with items of these types."""
    return f"{record}({';'.join(items)})"


def native_name(record: str) -> str:
    """Return the name of a reference to a record of a type."""
    return f"@{record}"


def type_name(value: Any) -> str:
    """Return the name of the type of a value.

    Raises
    ------
    TypeError
        The type has no name.
    """
    kind = type(value)
    name = _SCALARS.get(kind)
    if name is not None:
        return name
    if kind is np.ndarray:
        key = value.dtype, value.ndim, value.flags.num
        return _array_names.get(key) or _name_of_array(value, key)
    if isinstance(value, tuple):
        names = tuple(map(type_name, value))
        return _tuple_names.get((kind, names)) or _name_of_tuple(value, names)
    if kind is array:
        return buffer_name(np.dtype(value.typecode).str)
    name = getattr(value, "type_name", None)
    if isinstance(name, str):
        return name
    raise TypeError(f"{kind.__name__} has no name here")


def _name_of_array(value: Any, key: tuple[Any, int, int]) -> str:
    """Return the name of the type of an array of numpy."""
    flags = value.flags
    layout = _ARRAY_LAYOUTS[flags.c_contiguous, flags.f_contiguous]
    name = array_name(value.dtype.str, value.ndim, layout, writable=flags.writeable)
    _array_names[key] = name
    return name


def _name_of_tuple(value: tuple[Any, ...], names: tuple[str, ...]) -> str:
    """Return the name of the type of a tuple whose items have types of these names."""
    kind = type(value)
    record = "" if kind is tuple else record_name(kind, value._fields)  # type: ignore[attr-defined]
    name = _tuple_names[kind, names] = tuple_name(record, names)
    return name


_array_names: dict[tuple[Any, int, int], str] = {}
"""Name of an array by type of its items, number of dimensions, and flags of numpy."""
_tuple_names: dict[tuple[type, tuple[str, ...]], str] = {}
"""Name of a tuple by its class and the names of its items."""
