"""What a person reads in the terminal: progress, tables folded to its width."""

from __future__ import annotations

import os
import shutil
import sys
import textwrap
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

PIPE = 10_000  # columns where no terminal is there: what reads a pipe folds nothing
PAUSE = 60.0  # s between two lines of progress where no terminal is there
BEAT = 5.0  # s between two looks at whether a line is due while nothing is reported

COMPILING = " (compiling)"


def compiling() -> bool:
    """Return whether functions are being compiled; asked of a module that may not be loaded yet."""
    watch = getattr(sys.modules.get("model.compiled"), "WATCH", None)
    return watch is not None and watch.active > 0


def _doing(text: str) -> Any:
    """Return a bar's column with a text of its task, and whether that is compiled just now."""
    from rich.progress import Task, TextColumn
    from rich.text import Text

    class Doing(TextColumn):
        """A text that is followed by what holds it up."""

        def render(self, task: Task) -> Text:
            """Return what the column shows."""
            return super().render(task).append(COMPILING if compiling() else "")

    return Doing(text)


class _Lines:
    """Lines of progress on the standard error, with the seconds since it began: one in PAUSE, also
    while nothing is reported, as one step takes long or is compiled."""

    def __init__(self, title: str, text: str) -> None:
        self.title, self.text, self.lock = title, text, threading.Lock()
        self.began = self.last = time.monotonic()

    def say(self, text: str) -> None:
        """Report how far it is."""
        self.text = text
        self.beat()

    def beat(self) -> None:
        """Write what was reported last, where a line is due."""
        with self.lock:
            now = time.monotonic()
            if now - self.last >= PAUSE:
                self.last = now
                doing = f"{self.text}{COMPILING if compiling() else ''}"
                print(
                    f"{self.title}: {doing}, {now - self.began:.0f} s",
                    file=sys.stderr,
                    flush=True,
                )


@contextmanager
def _lines(title: str, text: str) -> Iterator[Callable[[str], None]]:
    """Give a function that reports how far it is, as `_Lines` write it; text: what stands there
    before the first."""
    lines, over = _Lines(title, text), threading.Event()

    def watch() -> None:
        """Write a line in each beat, until it is over."""
        while not over.wait(BEAT):
            lines.beat()

    threading.Thread(target=watch, daemon=True).start()
    try:
        yield lines.say
    finally:
        over.set()


@contextmanager
def _effort_lines(title: str) -> Iterator[tuple[Callable[[str], None], Callable[[float], None]]]:
    """Give the functions of `effort_bar` where there is no terminal."""
    stage, done = ["reading"], [0.0]
    with _lines(title, stage[0]) as say:

        def tell() -> None:
            """Say how far it is."""
            say(f"{stage[0]}, {done[0]:,.0f} simulations")

        def now(what: str) -> None:
            """Say what is done from here on."""
            stage[0] = what
            tell()

        def count(more: float) -> None:
            """Count simulations in."""
            done[0] += more
            tell()

        yield now, count


@contextmanager
def _taken_away(bar: Any) -> Iterator[Any]:
    """Give a bar that its first report starts, so that none is seen where a call is refused before
    any work, and that goes away at the end."""
    try:
        yield bar
    finally:
        bar.stop()


@contextmanager
def progress_bar(title: str, quiet: bool) -> Iterator[Callable[[float], None] | None]:
    """Give a function that shows the fraction done, as lines where there is no terminal; None where
    it is not asked for. It is there from the first call on, which stands where work begins; at 0 it
    moves to and fro."""
    if quiet:
        yield None
        return
    if not sys.stderr.isatty():
        with _lines(title, "0 %") as say:
            yield lambda fraction: say(f"{100.0 * fraction:.0f} %")
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        _doing("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with _taken_away(Progress(*columns, console=Console(stderr=True), transient=True)) as bar:
        task = bar.add_task(title, total=None)

        def show(fraction: float) -> None:
            """Show it, from the first call on."""
            bar.start()
            bar.update(task, completed=fraction, total=1.0 if fraction > 0.0 else None)

        yield show


@contextmanager
def rate_bar(
    title: str, quiet: bool, what: str = "runs"
) -> Iterator[Callable[[int, int], None] | None]:
    """Give a function that shows how many of how many are done, their rate and the time left;
    lines, None as above."""
    if quiet:
        yield None
        return
    if not sys.stderr.isatty():
        with _lines(title, f"0 {what}") as say:
            yield lambda done, total: say(f"{done:,.0f} of {total:,.0f} {what}")
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        _doing(f"{title} {{task.fields[count]}}"),
        BarColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with _taken_away(
        Progress(
            *columns, console=Console(stderr=True), transient=True, speed_estimate_period=300.0
        )
    ) as bar:
        task = bar.add_task(title, total=None, rate="", count="")

        def show(done: int, total: int) -> None:
            """Show it; what was there before the first call is not counted into the rate."""
            bar.start()
            if bar.tasks[0].total is None:
                bar.reset(task, total=total, completed=done, rate="", count="")
            speed = bar.tasks[0].speed
            rate = f"{speed:.3g}/s" if speed else ""
            bar.update(task, completed=done, rate=rate, count=f"{done:,.0f} of {total:,.0f} {what}")

        yield show


@contextmanager
def effort_bar(
    title: str, quiet: bool, usual: float
) -> Iterator[tuple[Callable[[str], None], Callable[[float], None]]]:
    """Give a function that says what is being done, and one that counts simulations in.

    Nobody knows how many there will be: the bar, and the time left, are those to `usual` of them,
    within which nine of ten end; where it takes more, to half as many again.
    """
    if quiet:
        yield (lambda _: None), (lambda _: None)
        return
    if not sys.stderr.isatty():
        with _effort_lines(title) as both:
            yield both
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        _doing("{task.description}"),
        BarColumn(8),
        TextColumn("{task.completed:,.0f} simulations"),
        TimeElapsedColumn(),
        TextColumn("most end in"),
        TimeRemainingColumn(compact=True),
    )
    with _taken_away(
        Progress(
            *columns, console=Console(stderr=True), transient=True, speed_estimate_period=300.0
        )
    ) as bar:
        task = bar.add_task(title, total=usual)

        def stage(what: str) -> None:
            """Say what is being done from here on."""
            bar.start()
            bar.update(task, description=what)

        def count(more: float) -> None:
            """Count simulations in."""
            own = bar.tasks[0]
            reached = own.completed + more
            bar.update(task, advance=more, total=further(own.total or usual, reached))

        yield stage, count


def further(total: float, reached: float) -> float:
    """Return how many to expect once so many are reached: as before, or half as many again, as
    often as it takes."""
    while reached >= total:
        total *= 1.5
    return total


def print_table(
    title: str, heads: list[str], rows: list[list[str]], fixed: int = 1, together: int = 1
) -> None:
    """Print a table; the first column to the left, numbers to the right, no number cut.

    One that is wider than the terminal is folded: its columns follow in several tables that all
    begin with the first `fixed` ones, so many `together` where they fit. In a pipe it stays whole,
    unless COLUMNS says how wide it may be.
    """
    from rich.console import Console

    stated = os.environ.get("COLUMNS", "")
    piped = int(stated) if stated.isdigit() and int(stated) else PIPE
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else piped
    Console(markup=False, highlight=False).print(_fitted(title), style="bold", soft_wrap=True)
    for chosen in folded(heads, rows, fixed, width, together):
        picked = [[row[k] for k in chosen] for row in [heads, *rows]]
        needed = 1 + sum(_width(picked, k) for k in range(len(chosen)))
        console = Console(width=max(width, needed), markup=False, highlight=False)
        console.print(_grid(picked), soft_wrap=needed > width)


def many(count: int, one: str) -> str:
    """Return a count with its noun, in the plural unless it is one; for nouns that take an s."""
    return f"{count} {one}{'' if count == 1 else 's'}"


def print_list(lines: Mapping[str, str]) -> None:
    """Print name and text of each entry, as `print_prose` does."""
    for name, text in lines.items():
        print_prose(text, f"{name:<20} ")


def print_prose(text: str, head: str = "") -> None:
    """Print a text behind a head: in a terminal folded to its width, elsewhere one line, which
    `grep` finds whole.

    Later lines begin below the text's first word. A word that is longer than a line, such as a
    path, is kept whole.
    """
    print(_fitted(text, head), flush=True)


def _fitted(text: str, head: str = "") -> str:
    """Return a text as `print_prose` prints it; its own line breaks are kept."""
    if not sys.stdout.isatty():
        return head + text
    width, inner = max(shutil.get_terminal_size().columns, 40), " " * len(head)
    parts = [
        textwrap.wrap(
            part,
            width,
            initial_indent=inner,
            subsequent_indent=inner,
            break_long_words=False,
            break_on_hyphens=False,
        )
        or [""]
        for part in text.split("\n")
    ]
    return head + "\n".join(line for lines in parts for line in lines).removeprefix(inner)


LEAST = 24  # columns that a first column keeps where it has to be broken, its frame included


def _width(rows: list[list[str]], k: int) -> int:
    """Return the columns of a terminal that a table's column takes with its frame; a first one may
    be broken."""
    whole = 3 + max(len(line) for row in rows for line in row[k].split("\n"))
    return whole if k else min(whole, LEAST)


def folded(
    heads: list[str], rows: list[list[str]], fixed: int, width: int, together: int = 1
) -> list[list[int]]:
    """Return the columns of each part of a table, every part within a width where that can be done.

    together: how many columns after the fixed ones belong to each other; they are parted only where
    they do not fit.
    """
    every = [heads, *rows]
    first, parts = list(range(fixed)), [list(range(fixed))]
    room = width - 1 - sum(_width(every, k) for k in first)
    left = room
    for k in range(fixed, len(heads)):
        wide, whole = _width(every, k), 0
        if (k - fixed) % together == 0:  # the first of those that belong to each other
            whole = sum(_width(every, j) for j in range(k, min(k + together, len(heads))))
        if max(wide, whole) > left and len(parts[-1]) > fixed:
            parts.append(list(first))
            left = room
        parts[-1].append(k)
        left -= wide
    return parts


def _grid(rows: list[list[str]]) -> Any:
    """Return a table for rich, its first row the heads."""
    from rich.table import Table

    table = Table()
    for k, head in enumerate(rows[0]):
        table.add_column(
            head, justify="left" if k == 0 else "right", no_wrap=k > 0, overflow="fold"
        )
    for row in rows[1:]:
        table.add_row(*row)
    return table
