"""The page of all commands, from the command line itself."""

from __future__ import annotations

import textwrap

from cyclopts import App
from cyclopts.argument import Argument
from markdown import cell, code, table

from sandbox.cli.application import application
from sandbox.cli.refusals import commands_of

HEAD = """# Commands

A command prints its answer and writes a JSON file into its folder for results (`--out`), most also a figure and a
table; `list`, `show` and `view` write nothing. [JSON files](json.md) says what these files hold. The exit code is 0
where the command has done its work, 1 where `verify` found a difference, 2 for wrong input (also for a campaign that
`check` stops), 3 where the physics has no answer, 130 after Ctrl-C, 143 after SIGTERM. For 2 and 3 the command prints
one sentence that says what to change. A value in parentheses is what a command takes if the argument is left out.

"""


def typed(argument: Argument) -> str:
    """Return an argument as it is typed."""
    value = argument.parameter.metavar or ""
    if argument.get_choices() and not argument.parameter.metavar:
        value = " or ".join(argument.get_choices() or ())
    elif not value and argument.hint is not bool:
        value = argument.name.lstrip("-").upper() if argument.field_info.is_keyword else ""
    name = argument.name if argument.name.startswith("-") else ""
    return " ".join(x for x in (name, value if value else "" if name else argument.name) if x)


def usual(argument: Argument) -> str:
    """Return what is taken where an argument is left out, in parentheses; nothing where that says
    nothing."""
    shown = argument.show_default
    if isinstance(shown, str):
        return f" ({shown})"
    default = argument.field_info.default
    if not shown or default in (None, "", ()) or default is argument.field_info.empty:
        return ""
    return f" ({default})"


def arguments(app: App) -> list[Argument]:
    """Return the arguments of a command that its help names, those by place first."""
    return [
        a
        for a in app.assemble_argument_collection(parse_docstring=True)
        if a.show and a.name != "*"
    ]


def usage(name: str, app: App) -> str:
    """Return how a command is called, folded."""
    words = [f"sensorless {name}"]
    for a in arguments(app):
        words.append(typed(a) if a.required else f"[{typed(a)}]")
    text = " ".join(words)
    return "\n".join(
        textwrap.wrap(
            text, 80, subsequent_indent="    ", break_on_hyphens=False, break_long_words=False
        )
    )


def section(name: str, app: App) -> str:
    """Return a command's part of the page, those below it included."""
    below = commands_of(app)
    if below:
        text = f"## `sensorless {name}`\n\n{cell(app.help)}\n\n"
        return text + "\n".join(
            section(f"{name} {n}", app[n]).replace("\n## ", "\n### ") for n in below
        )
    text = f"\n## `sensorless {name}`\n\n{cell(app.help.splitlines()[0])}\n\n"
    rows = [(code(typed(a)), cell((a.parameter.help or "") + usual(a))) for a in arguments(app)]
    return (
        f"{text}```text\n{usage(name, app)}\n```\n\n"
        + (table(("argument", "does"), rows) if rows else "")
        + "\n"
    )


def page() -> str:
    """Return the whole page."""
    app = application()
    return HEAD + "\n".join(section(name, app[name]) for name in commands_of(app))
