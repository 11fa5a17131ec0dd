"""How the command line reads its words: numbers as people write them, one sentence for a wrong call."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

from model.errors import brief, sentence
from sandbox.output.files import check_output
from sandbox.output.tables import print_prose

LARGEST_COUNT = 1_000_000  # of anything that is counted on the command line


class Parser(argparse.ArgumentParser):
    """argparse that answers a wrong call with one sentence and exit code 2."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Refuse what a command does not know in its own name, not in that of the program."""
        found, left = super().parse_known_args(args, namespace)
        if left and self._subparsers is None:
            self.error(f"unrecognized arguments: {' '.join(map(brief_text, left))}")
        return found, left

    def error(self, message: str) -> NoReturn:
        """Print the message alone."""
        print(f"{self.prog}: {sentence(message)} (see `{self.prog} --help`)", file=sys.stderr)
        raise SystemExit(2)


def brief_text(text: str) -> str:
    """Return a word of the command line, cut."""
    return text if len(text) <= 40 else f"{text[:37]}..."


def number(text: str) -> float:
    """Parse a number as people write it (not 1_000)."""
    from model.effects.library import number_of

    try:
        return number_of(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text[:40]}' is no number") from None


def positive_int(text: str) -> int:
    """Parse a whole number of at least 1."""
    if not _whole(text) or not 1 <= int(text) <= LARGEST_COUNT:
        raise argparse.ArgumentTypeError(f"{brief(text)} is no whole number of at least 1 and at most {LARGEST_COUNT}")
    return int(text)


def seed_number(text: str) -> int:
    """Parse a whole number of at least 0."""
    if not _whole(text):
        raise argparse.ArgumentTypeError(f"{brief(text)} is no whole number of at least 0 and at most 18 digits")
    return int(text)


def _whole(text: str) -> bool:
    return text.isascii() and text.isdecimal() and len(text) <= 18


def add_own_effects(command: Any) -> None:
    """Let a command take effects of the user's own."""
    text = "a Python file with effects of your own (may be repeated), beside those of the library"
    command.add_argument("--effects-from", action="append", default=[], type=Path, metavar="FILE.py", help=text)


def folder_of(options: argparse.Namespace) -> Path:
    """Return the folder for results."""
    return getattr(options, "out", None) or Path("sensorless-out") / options.command


def checked_folder(options: argparse.Namespace) -> Path:
    """Return the folder for results; BadInput, before anything runs, where they could not be written."""
    folder = folder_of(options)
    check_output(folder, {"diagnose": "diagnosis"}.get(options.command, options.command))
    return folder


def finish(options: argparse.Namespace, found: Any, folder: Path, show: Callable[[], None]) -> None:
    """Save a result; unless --quiet, show it and say where its files are."""
    found.save(folder, csv=options.csv)
    if not options.quiet:
        show()
        print_prose(f"results in {folder}")
