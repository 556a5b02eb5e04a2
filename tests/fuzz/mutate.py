"""Mutations of a valid file: damaged bits, moved blocks, edge numbers, nesting, long digits."""

import re
from collections.abc import Callable
from random import Random

MAX_BYTES = 2_000_000
"""Maximum size of a mutated file."""
TOKENS = (
    b"\0",
    b"\xff" * 8,
    b"nan",
    b"inf",
    b"-inf",
    b"1e999",
    b"-1",
    b"0",
    b"1e-320",
    b"true",
    b"null",
    b"9" * 400,
    b"9" * 5000,
    b"[" * 3000,
    b"{" * 3000,
    b"[[a]]\n" * 50,
    b'{"a":' * 2000,
    b'"',
    b"'''",
    b"\x1b[2J",
    b"[/b]",
    b"\xe2\x80\xae",
    b"\r\n",
    b"#",
    b",",
    b"=",
    b"..",
    b"/../../etc/passwd",
    b"\x7f\xff\xff\xff",
    b"\xff\xff\xff\x7f",
    b"\0\0\0\x80",
    b"\x89MCAP0\r\n",
    b"ULog",
    b"\xa3\x95\x80",
)
"""Texts and numbers that readers often mistake."""

DIGIT = re.compile(rb"[0-9\xb2\xb3\xb9]")
"""A digit, or a superscript of Latin-1, which ``str.isdigit`` accepts, too."""

Mutation = Callable[[Random, bytearray], None]


def mutated(random: Random, data: bytes) -> bytes:
    """Return a copy of a file with one to eight random mutations."""
    changed = bytearray(data)
    for _ in range(random.choice((1, 1, 1, 2, 3, 8))):
        random.choice(MUTATIONS)(random, changed)
    return bytes(changed[:MAX_BYTES])


def _flip_bit(random: Random, data: bytearray) -> None:
    """Invert one bit."""
    if data:
        data[random.randrange(len(data))] ^= 1 << random.randrange(8)


def _set_byte(random: Random, data: bytearray) -> None:
    """Set one byte to an edge value."""
    if data:
        data[random.randrange(len(data))] = random.choice((0, 1, 0x7F, 0x80, 0xFE, 0xFF))


def _set_number(random: Random, data: bytearray) -> None:
    """Write an edge value over 2, 4 or 8 bytes: a length, a count or a time."""
    size = random.choice((2, 4, 8))
    if len(data) > size:
        place = random.randrange(len(data) - size)
        value = random.choice(
            (0, 1, 2 ** (8 * size) - 1, 2 ** (8 * size - 1), random.getrandbits(8 * size))
        )
        data[place : place + size] = value.to_bytes(size, "little")


def _insert_token(random: Random, data: bytearray) -> None:
    """Insert a text that readers often mistake."""
    place = random.randrange(len(data) + 1)
    data[place:place] = random.choice(TOKENS)


def _replace_number(random: Random, data: bytearray) -> None:
    """Replace the digits at a place of a text."""
    places = [match.start() for match in DIGIT.finditer(data[:-1])]
    if places:
        start = stop = random.choice(places)
        while DIGIT.match(data, stop):
            stop += 1
        data[start:stop] = random.choice(TOKENS[1:14])


def _delete(random: Random, data: bytearray) -> None:
    """Delete a block."""
    start = random.randrange(len(data) + 1)
    del data[start : start + random.randrange(1, 200)]


def _duplicate(random: Random, data: bytearray) -> None:
    """Repeat a block at another place, once or many times."""
    start = random.randrange(len(data) + 1)
    block = data[start : start + random.randrange(1, 300)]
    place = random.randrange(len(data) + 1)
    data[place:place] = block * random.choice((1, 1, 2, 50))


def _swap(random: Random, data: bytearray) -> None:
    """Move a block to another place."""
    start, size = random.randrange(len(data) + 1), random.randrange(1, 300)
    block = data[start : start + size]
    del data[start : start + size]
    place = random.randrange(len(data) + 1)
    data[place:place] = block


def _cut(random: Random, data: bytearray) -> None:
    """Cut the file."""
    del data[random.randrange(len(data) + 1) :]


def _noise(random: Random, data: bytearray) -> None:
    """Write random bytes over a block."""
    if data:
        start = random.randrange(len(data))
        stop = min(len(data), start + random.randrange(1, 40))
        data[start:stop] = random.randbytes(stop - start)


MUTATIONS: tuple[Mutation, ...] = (
    _flip_bit,
    _set_byte,
    _set_number,
    _insert_token,
    _replace_number,
    _delete,
    _duplicate,
    _swap,
    _cut,
    _noise,
)
