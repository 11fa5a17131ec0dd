"""Damaged files and calls at every door of the project: which are refused in one sentence, which
escape.

`python -m experiments.fuzz --inputs 100000` goes on where it stopped (`--state FILE`); an escape is
made smaller and kept under `tests/fuzz/findings`, where the suite tries it ever after.  An input is
good if it is let in, or refused in one line of at most 700 characters, within 10 s, within 2 GB,
leaving nothing behind.  Inputs are read in a child process: one that crashes, or hangs where no
alarm is heard, is an escape, too, and the next child
goes on behind it.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import multiprocessing
import os
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from tests.fuzz.commands import call, call_number, left_behind, make_home
from tests.fuzz.doors import WAITED, Outcome, damaged, limit_memory, listing, tried
from tests.fuzz.mutations import CALLS
from tests.fuzz.whole import COSTLY, DOORS

FINDINGS = Path(__file__).resolve().parents[1] / "tests" / "fuzz" / "findings"
SMALLER = 15.0  # s spent on making an escape smaller
LARGEST = 4000  # bytes of a finding that is kept
EVERY = 100  # inputs after which the state is written
SILENT = WAITED + 60.0 + SMALLER  # s without a word from a child after which it is killed


def smaller(escapes: Any, content: bytes) -> bytes:
    """Return a shorter input that escapes in the same way: pieces are cut out while it still
    does."""
    begun, size = time.monotonic(), max(len(content) // 2, 1)
    while size and time.monotonic() - begun < SMALLER:
        k = 0
        while k < len(content) and time.monotonic() - begun < SMALLER:
            shorter = content[:k] + content[k + size :]
            if escapes(shorter):
                content = shorter
            else:
                k += size
        size //= 2
    return content


def keep(door: str, name: str, content: bytes) -> str:
    """Keep a finding as a file of its own; return its name."""
    path = FINDINGS / f"{door}-{hashlib.sha256(content).hexdigest()[:10]}{Path(name).suffix}"
    if len(content) <= LARGEST:
        FINDINGS.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return path.name


def place(why: str) -> str:
    """Return an escape's kind: its exception and where, without the value."""
    return ":".join(why.split(":")[:2])


class Count:
    """Counts of one door, kept between calls."""

    def __init__(self, kept: dict[str, Any]) -> None:
        self.next: int = kept.get("next", 0)
        self.kinds: dict[str, int] = kept.get("kinds", {"accepted": 0, "refused": 0, "escaped": 0})
        self.slowest: float = kept.get("slowest", 0.0)
        self.escapes: dict[str, Any] = kept.get("escapes", {})

    def state(self) -> dict[str, Any]:
        """Return what is kept."""
        return {
            "next": self.next,
            "kinds": self.kinds,
            "slowest": self.slowest,
            "escapes": self.escapes,
        }

    def tell(self) -> None:
        """Say that an input is done: in a child, to its parent."""

    def add(self, outcome: Outcome) -> bool:
        """Count an outcome; return whether it is the first escape of its kind."""
        self.next += 1
        self.kinds[outcome.kind] += 1
        self.slowest = max(self.slowest, outcome.seconds)
        self.tell()
        if outcome.kind != "escaped":
            return False
        seen = self.escapes.setdefault(place(outcome.why), {"n": 0, "why": outcome.why})
        seen["n"] += 1
        return bool(seen["n"] == 1)


def run_door(door: Any, count: Count, until: int, deadline: float) -> None:
    """Try a door's inputs up to a number, or until the time is over."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        door.make(folder)
        whole = {name: (folder / name).read_bytes() for name in door.files}
        while count.next < until and time.monotonic() < deadline:
            number = count.next
            name, content = damaged(door, whole, number)
            outcome = tried(door, whole, folder, name, content)
            if count.add(outcome):
                kind = place(outcome.why)
                fast = outcome.seconds < 1.0
                same = lambda c, n=name, k=kind: place(tried(door, whole, folder, n, c).why) == k  # noqa: E731
                least = smaller(same, content) if fast else content
                count.escapes[kind] |= {"number": number, "file": keep(door.name, name, least)}
                print(f"{door.name} {number}: {outcome.why}", flush=True)


def run_calls(count: Count, until: int, deadline: float) -> None:
    """Try calls of the command line up to a number, or until the time is over."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        make_home(folder)
        os.chdir(folder)
        try:
            for words in CALLS:  # whatever is imported or compiled at first use
                call([*words, "--offline"])
            here = listing(folder)
            while count.next < until and time.monotonic() < deadline:
                number = count.next
                words = call_number(number)
                outcome = call(words)
                if outcome.why.startswith("took "):
                    # what is compiled at first use is compiled once
                    outcome = call(words)
                if left := left_behind(folder, here, words):
                    outcome = Outcome("escaped", f"left {sorted(left)[:3]} behind", outcome.seconds)
                here = listing(folder)
                if count.add(outcome):
                    name = keep("cli", "x.json", json.dumps(words).encode())
                    count.escapes[place(outcome.why)] |= {"number": number, "file": name}
                    print(f"cli {number} {' '.join(words)[:100]!r}: {outcome.why}", flush=True)
        finally:
            os.chdir(before)


def in_child(work: Callable[[Count], None], count: Count, silent: float = SILENT) -> Count:
    """Let a child process work on a copy of a count; return it, with an escape where the child
    crashed or hung."""
    fork = multiprocessing.get_context("fork")
    receiver, sender = fork.Pipe(duplex=False)

    def child() -> None:
        """Work within limits, and say how far it is after every input."""
        limit_memory()
        own = Count(count.state())
        own.tell = lambda: sender.send(own.state())  # type: ignore[method-assign]
        work(own)
        sender.send(own.state())
        sender.send(None)

    process = fork.Process(target=child)
    process.start()
    sender.close()
    why = ""
    while not why:
        try:
            if not receiver.poll(silent):
                why = f"did not end in {silent:g} s and heard no alarm"
            elif (state := receiver.recv()) is None:
                break
            else:
                count = Count(state)
        except EOFError:
            process.join()
            why = f"the process died with exit code {process.exitcode}"
    process.kill()
    process.join()
    receiver.close()
    if why:
        number = count.next
        if count.add(Outcome("escaped", f"{why}:", silent)):
            count.escapes[place(f"{why}:")] |= {"number": number}
            print(f"input {number}: {why}", flush=True)
    return count


def main() -> None:
    """Run; print a line a door."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--inputs", type=int, default=10_000, help="in all, earlier ones of the same state included"
    )
    parser.add_argument(
        "--state", type=Path, default=Path("sensorless-out/fuzz.json"), help="counts so far"
    )
    parser.add_argument("--door", help="this one only")
    parser.add_argument(
        "--seconds", type=float, default=1e9, help="stop after so long; call again to go on"
    )
    options = parser.parse_args()
    kept = json.loads(options.state.read_text()) if options.state.is_file() else {}
    deadline = time.monotonic() + options.seconds
    shares = {d.name: COSTLY.get(d.name, 1.0) for d in DOORS} | {"cli": 2.0}
    total = sum(shares.values())
    chosen = [n for n in shares if options.door in (None, n)]
    counts = {n: Count(kept.get(n, {})) for n in shares}
    by_name = {d.name: d for d in DOORS}
    options.state.parent.mkdir(parents=True, exist_ok=True)
    for name in chosen:
        until, count = round(options.inputs * shares[name] / total), counts[name]
        while count.next < until and time.monotonic() < deadline:
            part = min(until, count.next + EVERY)
            if name == "cli":
                count = in_child(partial(run_calls, until=part, deadline=deadline), count)
            else:
                count = in_child(
                    partial(run_door, by_name[name], until=part, deadline=deadline), count
                )
            counts[name] = count
            aside = options.state.with_suffix(".part")
            aside.write_text(json.dumps({n: c.state() for n, c in counts.items()}, indent=1))
            aside.replace(options.state)
        k = count.kinds
        print(
            f"{name:<10} {count.next:>7} inputs: {k['accepted']} let in, {k['refused']} refused, "
            f"{k['escaped']} escaped; slowest {count.slowest:.1f} s",
            flush=True,
        )


if __name__ == "__main__":
    main()
