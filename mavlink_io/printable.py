"""Escaping of text from the network, a file or a process, so that it is safe to print."""


def printable(text: object) -> str:
    r"""Escape every character that a terminal could act on, line feeds included.

    Parameters
    ----------
    text : object
        Any object with a string form: a text of a vehicle, a name, a path, an exception.

    Returns
    -------
    str
        The text; each character that is not printable (`str.isprintable`) is written as in a Python
        string, such as ``\x1b``: control characters (C0, DEL, C1), format characters such as bidi
        overrides, line separators and lone surrogates. Printable text, including backslashes, is
        unchanged, so that escaping twice changes nothing.
    """
    string = str(text)
    if string.isprintable():
        return string
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in string)


def printable_lines(text: object) -> str:
    """Escape every character that a terminal could act on, except line feeds.

    Parameters
    ----------
    text : object
        Any object with a string form.

    Returns
    -------
    str
        The text, escaped as by `printable` line by line.
    """
    return "\n".join(map(printable, str(text).split("\n")))
