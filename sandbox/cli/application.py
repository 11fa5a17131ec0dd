"""All commands under one name; their options, help and completion follow from their signatures and
texts."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, Literal

from cyclopts import App, Group, Parameter

from sandbox.cli import commands, recorded, withholding
from sandbox.cli.arguments import Flag
from sandbox.output.files import version
from sandbox.output.tables import print_prose

GROUPS: dict[str, tuple[Callable[..., Any], ...]] = {
    "Simulate": (
        commands.compare,
        commands.simulate,
        commands.sweep,
        commands.protocol,
        commands.bench,
    ),
    "Motor": (
        commands.audit,
        commands.maps,
        commands.motor,
        commands.export_estimator,
        commands.export_drive,
    ),
    "Recordings": (
        recorded.plan,
        recorded.check,
        recorded.identify,
        recorded.diagnose,
        recorded.replay,
        recorded.settings,
    ),
    "Results": (commands.show, commands.view, commands.verify),
}


@cache
def application() -> App:
    """Return the command line."""
    app = App(
        name="sensorless",
        help="Sandbox for sensorless control of saturated PM motors.",
        version=lambda: f"sensorless {version()}",
        version_flags=("--version", "-V"),
        help_format="plaintext",
        default_parameter=Parameter(negative=(), allow_repeating=True),
        verbose=False,
    )
    for title, members in GROUPS.items():
        group = Group.create_ordered(title)
        for place, command in enumerate(members):
            app.command(command, group=group, sort_key=place)
        if title == "Recordings":
            what = "How good the diagnosis is: sealed campaigns, blind diagnoses, scores."
            withheld = App(name="withheld", help=what, group=group, sort_key=len(members))
    rest = Group.create_ordered("Help")
    withheld.command(withholding.make)
    withheld.command(withholding.score)
    app.command(withheld)
    app.command(commands.list_names, name="list", group=rest, sort_key=0)
    app.command(commands.include, group=rest, sort_key=1)
    app.command(completion, group=rest, sort_key=2)
    app["--help"].group = app["--version"].group = rest
    return app


def completion(
    shell: Literal["bash", "zsh", "fish", "powershell"], /, *, install: Flag = False
) -> None:
    """Print what makes a shell complete the words of `sensorless`, such as names of motors.

    Parameters
    ----------
    shell
        whose: in bash `eval "$(sensorless completion bash)"`, in zsh the same after `compinit`
    install
        write it where this shell finds it, and a line into its start-up file, for every new shell
    """
    app = application()
    if install:
        place = app.install_completion(shell=shell, add_to_startup=shell != "zsh")
        if shell == "bash":
            place.write_text(with_commas(place.read_text(encoding="utf-8")), encoding="utf-8")
        if shell == "zsh":
            start_zsh_with(place.parent)
        print_prose(f"completion is written to {place}; open a new shell")
        return
    script = app.generate_completion(shell=shell)
    if shell == "bash":
        script = with_commas(script)
    if shell == "zsh":  # a file of its folder is found by its name, what is evaluated is not
        script += "\n(( $+functions[compdef] )) && compdef _cyclopts_sensorless sensorless\n"
    sys.stdout.write(script)  # as it is, in a terminal, too


def with_commas(script: str) -> str:
    """Return a script for bash that leaves commas as they are: escaped, they are no part of a word
    for the next tab."""
    quoted = "printf -v _q '%q' \"$_x\"; "
    return script.replace(quoted, quoted + "_q=${_q//\\\\,/,}; ")


def start_zsh_with(folder: Path) -> None:
    """Let zsh look for completion in a folder; one whose start-up file leaves completion off turns
    it on, too."""
    file = Path(os.environ.get("ZDOTDIR") or Path.home()) / ".zshrc"
    text = file.read_text(encoding="utf-8") if file.is_file() else ""
    path = f"fpath=({shlex.quote(str(folder))} $fpath)  # completion of sensorless\n"
    if path not in text:
        on = "(( $+functions[compdef] )) || { autoload -Uz compinit && compinit }\n"
        file.write_text(
            path + text + ("" if text.endswith("\n") or not text else "\n") + on, encoding="utf-8"
        )
