"""The page of all commands, from the parser of the command line itself."""

from __future__ import annotations

import argparse
import textwrap

from markdown import cell, code, table

from sandbox.cli import build_parser

HEAD = """# Commands

A command prints its answer and writes a JSON file into its folder for results (`--out`), most also a figure and a
table; `list`, `show` and `view` write nothing. [JSON files](json.md) says what these files hold. The exit code is 0
where the command has done its work, 1 where `verify` found a difference, 2 for wrong input (also for a campaign that
`check` stops), 3 where the physics has no answer, 130 after Ctrl-C, 143 after SIGTERM. For 2 and 3 the command prints
one sentence that says what to change. A value in parentheses is what a command takes if the argument is left out.

"""


def subcommands(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """Return the parsers below one, by name."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            return dict(action.choices)
    return {}


def usage(parser: argparse.ArgumentParser) -> str:
    """Return how a command is called, folded."""
    words = " ".join(parser.format_usage().removeprefix("usage: ").split())
    return "\n".join(textwrap.wrap(words, 80, subsequent_indent="    ", break_on_hyphens=False, break_long_words=False))


def option(parser: argparse.ArgumentParser, action: argparse.Action) -> tuple[str, str]:
    """Return an argument as it is typed, and what it does; a usual value stands in parentheses."""
    value = action.metavar or (action.dest.upper() if action.nargs != 0 else "")
    if action.choices is not None:
        value = " or ".join(map(str, action.choices))
    typed = " ".join(x for x in (action.option_strings[-1] if action.option_strings else "", str(value)) if x)
    text = parser._get_formatter()._expand_help(action) if action.help else ""
    return code(typed), cell(text)


def section(name: str, parser: argparse.ArgumentParser) -> str:
    """Return a command's part of the page, those below it included."""
    below = subcommands(parser)
    if below:
        text = f"## `sensorless {name}`\n\n{cell(parser.description or '')}\n\n"
        return text + "\n".join(section(f"{name} {n}", p).replace("\n## ", "\n### ") for n, p in below.items())
    actions = [a for a in parser._actions if a.help != argparse.SUPPRESS and a.dest != "help"]
    text = f"\n## `sensorless {name}`\n\n"
    if parser.description:
        text += f"{capital(cell(parser.description))}.\n\n"
    rows = [option(parser, a) for a in actions]
    return f"{text}```text\n{usage(parser)}\n```\n\n" + (table(("argument", "does"), rows) if rows else "") + "\n"


def capital(text: str) -> str:
    """Return a text whose first letter is a capital."""
    return text[:1].upper() + text[1:]


def page() -> str:
    """Return the whole page."""
    return HEAD + "\n".join(section(name, p) for name, p in subcommands(build_parser()).items())
