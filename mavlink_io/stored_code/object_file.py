"""Object files of compiled kernels in memory.

Numba stores a kernel as an ELF object file for x86-64 in the large code model: every reference is
a 64-bit address (relocation type R_X86_64_64). Sources of the format: System V ABI, chapter 4
"Object files", and AMD64 supplement, section 4.4 "Relocation".
"""

import ctypes
import mmap
import struct
from collections.abc import Callable
from typing import NamedTuple

_HEADER = struct.Struct("<16sHHIQQQIHHHHHH")
_SECTION = struct.Struct("<IIQQQQIIQQ")
_SYMBOL = struct.Struct("<IBBHQQ")
_RELOCATION = struct.Struct("<QQq")
_SYMBOL_TABLE, _RELOCATIONS, _NO_BITS = 2, 4, 8
"""Section types."""
_WRITABLE, _ALLOCATED = 1, 2
"""Section flags."""
_UNDEFINED, _COMMON, _ABSOLUTE = 0, 0xFFF2, 0xFFF1
"""Section indices of symbols that belong to no section."""
_ABSOLUTE_64 = 1
"""Relocation: address of the symbol plus addend, 64 bits."""
_NOT_LOADED = b".eh_frame"
"""Section for debuggers, which would need another relocation type."""
_POINTER_BYTES = 8
_C = ctypes.CDLL(None, use_errno=True)
_C.mmap.restype = ctypes.c_void_p
_C.mmap.argtypes = (
    ctypes.c_void_p,
    ctypes.c_size_t,
    ctypes.c_int,
    ctypes.c_int,
    ctypes.c_int,
    ctypes.c_long,
)
_C.mprotect.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int)


class _Section(NamedTuple):
    name: int
    kind: int
    flags: int
    address: int
    offset: int
    size: int
    link: int
    info: int
    alignment: int
    entry_size: int


class _Symbol(NamedTuple):
    name: int
    info: int
    other: int
    section: int
    value: int
    size: int


def place(content: bytes, address_of: Callable[[bytes], int]) -> dict[bytes, int]:
    """Place an object file in memory, where it stays until the process ends.

    Parameters
    ----------
    content : bytes
        Object file.
    address_of : callable
        Address of a symbol that the file does not define, by its name.

    Returns
    -------
    dict
        Address of each symbol that the file defines.

    Raises
    ------
    ValueError
        The file has a relocation of another type.
    OSError
        The system refuses the memory.
    """
    sections = _sections(content)
    symbols = _symbols(content, sections)
    code, data = _Memory(), _Memory()
    starts = {}
    for index, section in enumerate(sections):
        is_loaded = section.flags & _ALLOCATED and section.size
        if is_loaded and not _is_skipped(content, sections, index):
            home = data if section.flags & _WRITABLE else code
            starts[index] = home, home.reserve(section.size, section.alignment)
    commons = {
        index: data.reserve(symbol.size, symbol.value)
        for index, (_, symbol) in enumerate(symbols)
        if symbol.section == _COMMON
    }
    code.allocate()
    data.allocate()
    addresses = []
    for index, (name, symbol) in enumerate(symbols):
        if symbol.section == _COMMON:
            addresses.append(data.address + commons[index])
        elif symbol.section in starts:
            home, start = starts[symbol.section]
            addresses.append(home.address + start + symbol.value)
        elif symbol.section == _UNDEFINED and name:
            addresses.append(address_of(name))
        else:
            addresses.append(symbol.value)
    for index, (home, start) in starts.items():
        section = sections[index]
        if section.kind != _NO_BITS:
            end = section.offset + section.size
            home.content[start : start + section.size] = content[section.offset : end]
    for section in sections:
        if section.kind == _RELOCATIONS and section.info in starts:
            home, start = starts[section.info]
            _relocate(content, section, home.content, start, addresses)
    code.make_executable()
    return {
        name: address
        for (name, symbol), address in zip(symbols, addresses, strict=True)
        if name and symbol.section not in (_UNDEFINED, _ABSOLUTE)
    }


def symbol_sizes(content: bytes) -> dict[bytes, int]:
    """Return the size in bytes of each symbol of an object file.

    Parameters
    ----------
    content : bytes
        Object file.

    Returns
    -------
    dict
        Size by name; 0 where the file does not give one.
    """
    return {name: symbol.size for name, symbol in _symbols(content, _sections(content))}


class _Memory:
    """Pages of memory that are reserved piece by piece and then allocated, for ever.

    They are never returned: code in them may run until the process ends.
    """

    address: int
    content: memoryview

    def __init__(self) -> None:
        self.size = 1

    def reserve(self, size: int, alignment: int) -> int:
        """Reserve aligned memory; return its distance from the start."""
        alignment = max(alignment, 1)
        start = -(-self.size // alignment) * alignment
        self.size = start + size
        return start

    def allocate(self) -> None:
        """Allocate what was reserved."""
        kind = mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS
        address = _C.mmap(None, self.size, mmap.PROT_READ | mmap.PROT_WRITE, kind, -1, 0)
        if address == ctypes.c_void_p(-1).value:
            raise OSError("no memory")
        self.address = address
        self.content = memoryview((ctypes.c_char * self.size).from_address(address)).cast("B")

    def make_executable(self) -> None:
        """Let the memory be executed and no longer be written."""
        if _C.mprotect(self.address, self.size, mmap.PROT_READ | mmap.PROT_EXEC):
            raise OSError("the system does not let memory be executed")


def _sections(content: bytes) -> list[_Section]:
    """Return the table of sections."""
    if content[:5] != b"\x7fELF\x02":
        raise ValueError("not an ELF file of 64 bits")
    header = _HEADER.unpack_from(content)
    offset, count = header[6], header[12]
    table = content[offset : offset + count * _SECTION.size]
    return [_Section(*fields) for fields in _SECTION.iter_unpack(table)]


def _is_skipped(content: bytes, sections: list[_Section], index: int) -> bool:
    """Return whether a section is not loaded."""
    names = sections[_HEADER.unpack_from(content)[13]]
    return _text(content, names.offset + sections[index].name) == _NOT_LOADED


def _symbols(content: bytes, sections: list[_Section]) -> list[tuple[bytes, _Symbol]]:
    """Return names and entries of the symbol table."""
    for section in sections:
        if section.kind == _SYMBOL_TABLE:
            names = sections[section.link].offset
            table = content[section.offset : section.offset + section.size]
            entries = [_Symbol(*fields) for fields in _SYMBOL.iter_unpack(table)]
            return [(_text(content, names + entry.name), entry) for entry in entries]
    return []


def _text(content: bytes, offset: int) -> bytes:
    """Return the text at an offset, up to its zero."""
    return content[offset : content.index(b"\0", offset)]


def _relocate(
    content: bytes, section: _Section, memory: memoryview, start: int, addresses: list[int]
) -> None:
    """Write the addresses of a section's references."""
    table = content[section.offset : section.offset + section.size]
    for offset, info, addend in _RELOCATION.iter_unpack(table):
        if info & 0xFFFFFFFF != _ABSOLUTE_64:
            raise ValueError(f"relocation type {info & 0xFFFFFFFF}, only 1 is supported")
        value = (addresses[info >> 32] + addend) & 0xFFFFFFFFFFFFFFFF
        place = start + offset
        memory[place : place + _POINTER_BYTES] = value.to_bytes(_POINTER_BYTES, "little")
