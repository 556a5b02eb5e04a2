"""Signs and sentences of verdicts, for the reports of dives and of campaigns."""

import re
from html import escape

from ground.client.assessment import Outcome

SIGNS = {
    Outcome.GOOD: "✓",
    Outcome.ATTENTION: "!",
    Outcome.FAILED: "✕",
    Outcome.UNKNOWN: "?",
}
"""Sign of each outcome, so that its colour is not needed."""


def as_sentence(text: str) -> str:
    """Return a text as HTML with a capital, a full stop, and commands in code type."""
    html = escape(f"{text[:1].upper()}{text[1:]}{'' if text.endswith('.') else '.'}")
    return re.sub("`([^`]+)`", r"<code>\1</code>", html)
