"""What compiling takes: of each kernel the processor's time and the kernels inside it, of each
command the kernels that it asked for.

With it a call's time is known before it is spent: of all that an earlier call of its kind asked
for, what the cache does not hold, and of that again what it is made of.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from model.kernels.cache import Name

COURSES = 4  # of a command that are remembered: logs of other kinds take other kernels
TELLS = 0.5  # s of kernels known before, from which a machine's speed is told


@dataclass
class Memory:
    """What is known of compiling.

    took: each kernel's time (s of the processor), without that of kernels inside it; inside:
    kernels that were asked for while it was compiled; courses: what each command asked for at
    earlier times, the last at the end.
    """

    took: dict[Name, float] = field(default_factory=dict)
    inside: dict[Name, tuple[Name, ...]] = field(default_factory=dict)
    courses: dict[str, list[tuple[Name, ...]]] = field(default_factory=dict)

    @classmethod
    def read(cls, text: str) -> Memory:
        """Return what a text keeps; nothing where it cannot be read."""
        try:
            kept = json.loads(text)
            names = [Name(*map(str, words)) for *words, _, _ in kept["kernels"]]
            out = cls()
            for name, (*_, seconds, inside) in zip(names, kept["kernels"], strict=True):
                out.took[name] = float(seconds)
                out.inside[name] = tuple(names[k] for k in inside)
            for command, courses in kept["courses"].items():
                out.courses[command] = [tuple(names[k] for k in course) for course in courses]
        except (ValueError, TypeError, LookupError, AttributeError, OverflowError, RecursionError):
            return cls()
        return out

    def text(self) -> str:
        """Return what is kept: kernels that no command asks for any more are left out."""
        names = list(
            self.all_of(n for courses in self.courses.values() for c in courses for n in c)
        )
        place = {name: k for k, name in enumerate(names)}
        kernels = [
            [*n, round(self.took.get(n, 0.0), 3), [place[m] for m in self.inside.get(n, ())]]
            for n in names
        ]
        courses = {
            command: [[place[n] for n in c] for c in courses]
            for command, courses in self.courses.items()
        }
        rows = ",\n".join(json.dumps(k, separators=(",", ":")) for k in kernels)
        return f'{{"kernels": [\n{rows}\n],\n"courses": {json.dumps(courses)}}}\n'

    def all_of(
        self, course: Iterable[Name], held: Callable[[Name], bool] = lambda _: False
    ) -> dict[Name, None]:
        """Return the kernels of a course and those inside them; one that is held, and what is
        inside it, takes none."""
        left, found = list(course)[::-1], dict[Name, None]()
        while left:
            name = left.pop()
            if name not in found and not held(name):
                found[name] = None
                left.extend(self.inside.get(name, ())[::-1])
        return found

    def left(self, course: Iterable[Name], took: Mapping[Name, float], known: Memory) -> float:
        """Return the processor's time (s) that a course still takes; took: of what was compiled
        already; known: what this machine knows."""
        held = self.held_here(known)
        names = self.all_of(course, lambda n: n in took or held(n))
        return self.pace(took) * sum(self.took.get(n, 0.0) for n in names)

    def held_here(self, known: Memory) -> Callable[[Name], bool]:
        """Return what tells whether the cache holds a kernel; known: what this machine knows.

        Where it knows a function by other arguments' types alone, these have changed since this was
        written, and the function is held if those are.
        """
        here: dict[tuple[str, ...], list[Name]] = {}
        for n in known.took:
            here.setdefault(n[:3], []).append(n)
        changed = {f: own for f, own in here.items() if not any(n in self.took for n in own)}

        def held(name: Name) -> bool:
            """Tell it of one kernel."""
            own = changed.get(name[:3], [])
            return name.held or (bool(own) and all(n.held for n in own))

        return held

    def course_of(self, command: str, asked: Iterable[Name]) -> tuple[Name, ...]:
        """Return what a command asks for, by the earlier one that has most of what was asked for so
        far, the last of several."""
        so_far = set(asked)
        return max(
            reversed(self.courses.get(command, [])),
            key=lambda c: len(so_far.intersection(c)),
            default=(),
        )

    def keep(
        self,
        command: str,
        asked: Mapping[Name, None],
        made: Mapping[Name, Sequence[Name]],
        took: Mapping[Name, float],
        met: set[Name],
    ) -> None:
        """Keep what a command asked for and compiled; met: kernels that a process had, which are
        not asked for a second time."""
        for name, inside in made.items():
            before = [n for n in self.inside.get(name, ()) if n in met]
            self.inside[name] = tuple(dict.fromkeys([*inside, *before]))
        self.took.update(took)
        course = tuple(asked)
        others = [c for c in self.courses.get(command, []) if c != course]
        self.courses[command] = [*others, course][-COURSES:]

    def pace(self, took: Mapping[Name, float]) -> float:
        """Return how much longer kernels take now than they took when this was kept."""
        then = sum(self.took.get(n, 0.0) for n in took)
        now = sum(s for n, s in took.items() if n in self.took)
        return now / then if then >= TELLS else 1.0
