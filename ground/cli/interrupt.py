"""What happens to a vehicle under way when the user interrupts the program that flies it."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path

from ground.cli.connection import connected
from ground.cli.options import remark
from ground.errors import Interrupted
from mavlink_io.errors import CaribouError


class OnInterrupt(StrEnum):
    """What a vehicle under way does after an interruption."""

    ASK = "ask"
    """The user chooses; as `LEAVE` without a terminal."""
    LEAVE = "leave"
    """It continues its mission."""
    HOLD = "hold"
    """It keeps depth, heading and thrust."""
    SURFACE = "surface"
    """It rises and disarms."""


ANSWERS = (OnInterrupt.LEAVE, OnInterrupt.HOLD, OnInterrupt.SURFACE)


@contextmanager
def interruptible(
    choice: OnInterrupt, connect: str, sign: Path | None, vehicle_id: int | None
) -> Iterator[None]:
    """Apply the choice to a vehicle that an interruption of the work leaves under way.

    The note of the exception names the new state, or why the mode could not be set.

    Parameters
    ----------
    choice : OnInterrupt
        What the vehicle does.
    connect, sign, vehicle_id
        Link, key file and system id, as of the work; the link must be closed at its end.
    """
    try:
        yield
    except Interrupted as interruption:
        if interruption.under_way:
            selected = _ask(interruption) if choice is OnInterrupt.ASK else choice
            if selected is not OnInterrupt.LEAVE:
                _enter(selected, interruption, connect, sign, vehicle_id)
        raise


def _ask(interruption: Interrupted) -> OnInterrupt:
    """Return the choice of the user; `LEAVE` without a terminal or after a second Ctrl-C."""
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        return OnInterrupt.LEAVE
    remark("; ".join(interruption.__notes__))
    while True:
        print(f"{', '.join(ANSWERS)}? [{OnInterrupt.LEAVE}] ", end="", file=sys.stderr, flush=True)
        try:
            answer = input().strip().lower()
        except (EOFError, Interrupted):
            return OnInterrupt.LEAVE
        matches = [each for each in ANSWERS if each.startswith(answer)]
        if matches:
            return matches[0]


def _enter(
    selected: OnInterrupt,
    interruption: Interrupted,
    connect: str,
    sign: Path | None,
    vehicle_id: int | None,
) -> None:
    """Set the mode over a new link, and replace the notes; add the reason if it fails."""
    from ground.client import stopping

    modes = {OnInterrupt.HOLD: stopping.HOLD, OnInterrupt.SURFACE: stopping.SURFACE}
    try:
        with connected(connect, sign, vehicle_id) as vehicle:
            state = stopping.enter(vehicle, modes[selected])
    except Interrupted:
        return
    except (CaribouError, OSError) as error:
        interruption.add_note(f"{selected} failed: {error}")
        return
    interruption.__notes__ = [state.format_text()]
