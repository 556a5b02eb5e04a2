"""Names and texts that a flipped bit has changed, in logs without a checksum."""

from collections.abc import Collection

SHORT_NAME = 1
"""Length up to which names of one kind often differ in one bit."""


def damaged_names(names: Collection[str], wanted: Collection[str]) -> int:
    """Return the number of names that one flipped bit makes of a wanted one which is missing.

    Parameters
    ----------
    names : collection of str
        Names in a file.
    wanted : collection of str
        Names that are read. Those of one letter are too near to others.
    """
    missing = [name for name in wanted if name not in names and len(name) > SHORT_NAME]
    return sum(
        name not in wanted and any(differ_in_one_bit(name, other) for other in missing)
        for name in names
    )


def differ_in_one_bit(first: str, second: str) -> bool:
    """Return whether two texts of the same length differ in exactly one bit.

    Parameters
    ----------
    first, second : str
        Texts.
    """
    if len(first) != len(second):
        return False
    bits = (ord(a) ^ ord(b) for a, b in zip(first, second, strict=True) if a != b)
    return [n.bit_count() for n in bits] == [1]
