"""Text from the network, a file or a process, made safe to print."""


def printable(text: object) -> str:
    """Escape every character that a terminal could act on, line feeds included.

    Parameters
    ----------
    text : object
        Anything with a string form: a text of a vehicle, a name, a path, an exception.

    Returns
    -------
    str
        The same text, in which each character that `str.isprintable` refuses is written as in a
        Python string, such as ``\\x1b``: control characters (C0, DEL, C1), format characters (bidi
        overrides among them), line separators and lone surrogates. Printable text, backslashes
        included, is unchanged, so that escaping twice changes nothing.
    """
    string = str(text)
    if string.isprintable():
        return string
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in string)


def printable_lines(text: object) -> str:
    """Escape as `printable` does, and keep the line feeds between lines."""
    return "\n".join(map(printable, str(text).split("\n")))
