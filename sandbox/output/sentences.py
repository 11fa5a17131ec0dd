"""How sentences begin and end, and the verdict of a diagnosis as a person reads it: one word on the
page, in the terminal and in JSON."""

from __future__ import annotations

VERDICTS = {
    "explained": "Explained",
    "ambiguous": "Ambiguous",
    "unknown": "Unknown",
    "no_gap": "No gap",
}


def capital(text: str) -> str:
    """Return a text that begins a sentence."""
    return text[:1].upper() + text[1:]


def stopped(text: str) -> str:
    """Return a sentence with its full stop."""
    return text if text.endswith((".", "!", "?")) else f"{text}."
