"""Mark of text that is safe to print as it is."""


class Rendered(str):
    """Text that is escaped already, with no control sequences except colours."""

    __slots__ = ()
