"""Option ``--modem``: ground links that are satellite or acoustic modems."""

from collections.abc import Collection, Sequence

from autopilot.comms.stream_rates import MIN_HIGH_LATENCY_S
from mavlink_io.transport import AddressError


def modem_intervals(words: Sequence[str], addresses: Collection[str]) -> dict[str, float]:
    """Return the time between two HIGH_LATENCY2 (s) by address.

    Parameters
    ----------
    words : Sequence[str]
        ADDRESS or ADDRESS=SECONDS of each modem.
    addresses : Collection[str]
        Addresses of the ground links.

    Raises
    ------
    AddressError
        An address is no ground link, or a time is no number of at least 10 s.
    """
    intervals = {}
    for word in words:
        address, equals, text = word.partition("=")
        if address not in addresses:
            raise AddressError(
                f"--modem {word}: expected ADDRESS[=SECONDS], where ADDRESS is one of"
                f" {', '.join(addresses)}"
            )
        try:
            seconds = float(text) if equals else MIN_HIGH_LATENCY_S
        except ValueError:
            seconds = 0.0
        if not MIN_HIGH_LATENCY_S <= seconds <= 86_400.0:
            raise AddressError(
                f"--modem {word}: {text!r} must be a number of seconds from"
                f" {MIN_HIGH_LATENCY_S:g} to 86400"
            )
        intervals[address] = seconds
    return intervals
