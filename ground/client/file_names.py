"""Safe file names for files whose names come from a vehicle or from a log."""

MAX_BYTES = 200
"""Maximum length of a safe name in UTF-8: file systems allow 255 bytes, and ".part" or "-2"
follows."""
UNNAMED = "unnamed"
"""Safe name for a name without any usable character."""

_RESERVED = frozenset('<>:"|?*')
"""Printable characters that some file systems forbid or treat specially."""


def safe_file_name(name: str) -> str:
    """Reduce a name from outside to a base name that can be joined to a folder.

    Parameters
    ----------
    name : str
        Any text: it may hold separators, "..", control characters or nothing at all.

    Returns
    -------
    str
        The last component of `name`: never empty, at most `MAX_BYTES` long in UTF-8, without
        separators, ".." and unprintable characters, and without a dot, dash or space at its start.
        A safe name is returned unchanged.
    """
    base = name.replace("\\", "/").rsplit("/", 1)[-1]
    base = "".join(c if c.isprintable() and c not in _RESERVED else "_" for c in base)
    while ".." in base:
        base = base.replace("..", ".")
    base = base.lstrip(".- ").rstrip(". ")
    return _shorten(base).rstrip(". ") or UNNAMED


def _shorten(base: str) -> str:
    """Cut the stem so that the name keeps a suffix of ordinary length and fits in `MAX_BYTES`."""
    if len(base.encode()) <= MAX_BYTES:
        return base
    stem, dot, suffix = base.rpartition(".")
    if not dot or len(suffix) > 10:
        stem, dot, suffix = base, "", ""
    room = MAX_BYTES - len((dot + suffix).encode())
    return stem.encode()[:room].decode("utf-8", "ignore") + dot + suffix
