"""What is wrong with a call that the command line does not take, in one sentence."""

from __future__ import annotations

import difflib
import inspect

from cyclopts import App, CycloptsError
from cyclopts.exceptions import (
    MissingArgumentError,
    UnknownCommandError,
    UnknownOptionError,
    UnusedCliTokensError,
)

NEAR = 0.6  # of difflib's ratio: a name that was meant


def sentence_of(error: CycloptsError) -> str:
    """Return what is wrong with a call, in a sentence."""
    if isinstance(error, UnknownCommandError) and error.unused_tokens and error.app:
        return unknown_word("command", error.unused_tokens[0], commands_of(error.app))
    if isinstance(error, UnknownOptionError):
        known = [name for a in error.argument_collection if a.show for name in a.names]
        word = (error.token.keyword or error.token.value or "").partition("=")[0]
        if word in known:  # behind `--`
            return f"unrecognized argument '{brief_text(word)}'; leave it away"
        return unknown_word(
            "option", word, known, f"`sensorless {' '.join(error.command_chain or ())} --help`"
        )
    if isinstance(error, UnusedCliTokensError) and error.unused_tokens:
        word = brief_text(error.unused_tokens[0])
        asked = inspect.signature(error.target).parameters if error.target else {}
        motor = f"if it is a motor write --motor {word}, else " if "motor" in asked else ""
        return f"unrecognized argument '{word}'; {motor}leave it away"
    if isinstance(error, MissingArgumentError) and error.argument:
        name = error.keyword or error.argument.name
        return f"{name} needs a value" if error.keyword else f"{name} is missing; give it"
    text = " ".join(str(error).split()).rstrip(".").replace('"', "'")
    text = text.replace(". Choose from: ", "; choose from ").replace(
        ". Did you mean ", "; did you mean "
    )
    return text[:1].lower() + text[1:]


def unknown_word(kind: str, word: str, known: list[str], where: str = "`sensorless --help`") -> str:
    """Return the sentence for a command or option that is none; it ends in the nearest one, where
    one is near."""
    plain, bare = {name.lstrip("-"): name for name in known}, word.lstrip("-")
    near = [name for name in plain if bare and name.startswith(bare)]
    near = near or difflib.get_close_matches(bare, list(plain), n=1, cutoff=NEAR)
    said = f"unknown {kind} '{brief_text(word)}'"
    return f"{said}; did you mean {plain[near[0]]}?" if near else f"{said}; see {where}"


def commands_of(app: App) -> list[str]:
    """Return the names of the commands below one."""
    return [name for name in app if not name.startswith("-")]


def brief_text(text: str) -> str:
    """Return a word of the command line, cut."""
    return text if len(text) <= 40 else f"{text[:37]}..."
