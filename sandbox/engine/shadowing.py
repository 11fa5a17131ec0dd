"""A user's own `model.py`, or package `model/`, beside their script: it and our package of that
name are both there.

Python looks beside the running script first, so such a file would hide our package (`estimators`:
the same).  Where there is one, a single module stands for both: its attributes (`model.anything`)
are those of the user's file, which runs when the first of them, or a submodule of theirs, is asked
for; submodules are looked for in our folder first (`model.energy`), then in theirs (`model.net`).
A submodule that both have is refused with a sentence.  Our own code imports names from submodules
only, never from the package itself (a test holds it), so neither side sees the other. A plain
folder of that name, without `__init__.py`, hides nothing; `model/__init__.py` adds it to where it
looks.

What this cannot do: before `import sandbox` nothing of this has run, so Python finds the user's
alone (`from model.errors import BadInput` fails there; `from sandbox import BadInput` never does);
a file `sandbox.py`, or a package `sandbox/`, is found in place of ours; a file that is imported for
what it does, not for a name, waits until a name is read; a file that comes onto Python's path after
ours were loaded is not found; `import model.energy` gives no `model.energy.currents` where the
user's is there (`from model.energy import currents` does).
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterable, Sequence
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from importlib.abc import Loader

ROOT = Path(__file__).resolve().parents[2]
NAMES = ("model", "estimators")  # the top-level packages that are installed with this one
RAN = "__builtins__"  # what running a file leaves in its module
OF_IMPORT = (
    "__path__",
    "__spec__",
    "__loader__",
    "__package__",
    "__file__",
    "__cached__",
    "__wrapped__",
)
RUNNING = threading.RLock()


class Shared(ModuleType):
    """A module with the submodules of one of our packages, and the attributes and submodules of a
    user's."""

    def __getattr__(self, name: str) -> Any:
        """Run the user's file, once, for an attribute that is not there yet."""
        with RUNNING:
            if RAN not in self.__dict__ and name not in OF_IMPORT:
                self.__loader__.run(self)  # type: ignore[union-attr]
                return getattr(self, name)
        if name in self.__dict__:  # another thread has run it
            return self.__dict__[name]
        raise AttributeError(
            f"module '{self.__name__}' ('{self.__dict__.get('__file__')}') has no "
            f"attribute '{name}'"
        )

    def __setattr__(self, name: str, value: object) -> None:
        """Leave the names of our submodules to the user's file: importing `model.energy` sets no
        attribute `energy`."""
        if not (
            isinstance(value, ModuleType)
            and value.__name__ == f"{self.__name__}.{name}"
            and is_ours(value)
        ):
            super().__setattr__(name, value)

    def __dir__(self) -> list[str]:
        getattr(self, "__all__", None)
        return sorted(self.__dict__)


class Later:
    """Runs a user's file when it is asked to, not when its module is imported."""

    def __init__(self, theirs: Loader) -> None:
        self.theirs = theirs

    def __getattr__(self, name: str) -> Any:
        """Do all else as their loader does, such as reading a package's data."""
        if name == "theirs":
            raise AttributeError(name)
        return getattr(self.theirs, name)

    def create_module(self, spec: ModuleSpec) -> Shared:
        """Return the module that stands for both."""
        return Shared(spec.name)

    def exec_module(self, module: ModuleType) -> None:
        """Wait; only a module that is loaded again runs at once."""
        if RAN in module.__dict__:
            self.run(module)

    def run(self, module: ModuleType) -> None:
        """Run the file; one that fails has not run."""
        try:
            self.theirs.exec_module(module)
        except BaseException:
            module.__dict__.pop(RAN, None)
            raise


class Done:
    """Hands over a submodule that the user's package has imported itself, while it ran."""

    def __init__(self, module: ModuleType) -> None:
        self.module, self.spec = module, module.__spec__

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """Return the module that is there."""
        return self.module

    def exec_module(self, module: ModuleType) -> None:
        """Leave it as it was: it has run."""
        module.__spec__ = self.spec


class SharedNameFinder:
    """Finds a user's file or package of one of our names, and our package with it."""

    @staticmethod
    def find_spec(
        name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return what stands for both; None where Python's own way is right; ImportError where they
        cannot share."""
        package, _, part = name.partition(".")
        if package not in NAMES:
            return None
        if part:
            return submodule(sys.modules.get(package), name, path or ())
        spec = PathFinder.find_spec(name)
        if spec is None or not spec.origin:  # nothing, or a plain folder alone
            return PathFinder.find_spec(name, [str(ROOT)])
        if is_our_file(spec.origin, name):
            return None
        if spec.loader is None or not spec.origin.endswith(".py"):
            raise ImportError(hidden(name, spec.origin))
        both = ModuleSpec(name, Later(spec.loader), origin=spec.origin, is_package=True)  # type: ignore[arg-type]
        both.submodule_search_locations = folders(name, spec.submodule_search_locations or ())
        both.has_location = True
        return both


def submodule(package: ModuleType | None, name: str, path: Sequence[str]) -> ModuleSpec | None:
    """Run a user's package before the first submodule of theirs; return that submodule where it is
    there then."""
    if not isinstance(package, Shared) or RAN in vars(package) or name.count(".") > 1:
        return None
    ours, theirs = [p for p in path if is_our_folder(p)], [p for p in path if not is_our_folder(p)]
    if not theirs or PathFinder.find_spec(name, ours) or not PathFinder.find_spec(name, theirs):
        return None
    with RUNNING:
        if RAN not in vars(package):
            package.__loader__.run(package)  # type: ignore[union-attr]
    found = sys.modules.get(name)
    if found is not None:  # Python would load it again, by its own spec
        found.__spec__ = ModuleSpec(name, Done(found))  # type: ignore[arg-type]
    return getattr(found, "__spec__", None)


def folders(name: str, theirs: Iterable[str]) -> list[str]:
    """Return where submodules are looked for, ours first; ImportError for a submodule that both
    have."""
    others = [Path(folder) for folder in theirs if not is_our_folder(folder)]
    parts = (
        [path.stem for path in sorted((ROOT / name).iterdir()) if not path.stem.startswith("__")]
        if others
        else []
    )
    for folder in others:
        for path in (
            place
            for part in parts
            for place in (folder / f"{part}.py", folder / part / "__init__.py")
        ):
            if path.is_file():
                part = path.relative_to(folder).with_suffix("").parts[0]
                raise ImportError(
                    f"'{path}' and a part of sensorless-sandbox are both called '{name}.{part}'; "
                    f"rename yours, or its folder, for example to my_{name}"
                )
    return [str(ROOT / name), *map(str, others)]


def is_our_file(file: str | None, name: str) -> bool:
    """Tell whether a file is that of our package of a name."""
    return Path(file or "").resolve() == ROOT / name / "__init__.py"


def is_our_folder(folder: str) -> bool:
    """Tell whether a folder is one of our packages."""
    return Path(folder).resolve() in (ROOT / name for name in NAMES)


def is_ours(module: ModuleType) -> bool:
    """Tell whether a module was loaded from our folders."""
    file = Path(getattr(module, "__file__", None) or ROOT).resolve()
    return any(ROOT / name in file.parents for name in NAMES)


def hidden(name: str, found: str) -> str:
    """Return the sentence for what hides one of our packages and cannot share its name, such as a
    compiled library."""
    suffix = Path(found).suffix if Path(found).stem == name else ""
    return (
        f"'{found}' hides the package '{name}' that sensorless-sandbox is installed with; rename "
        f"that file or folder, for example to my_{name}{suffix}"
    )


def share_names() -> None:
    """See to it that our packages can be imported beside a user's files of their names; ImportError
    where not."""
    for name in NAMES:
        loaded = sys.modules.get(name)
        if loaded is None:
            SharedNameFinder.find_spec(name)
        elif not isinstance(loaded, Shared) and not is_our_file(
            getattr(loaded, "__file__", None), name
        ):
            share(loaded, name)
    if SharedNameFinder not in sys.meta_path:
        sys.meta_path.insert(0, SharedNameFinder)


def share(loaded: ModuleType, name: str) -> None:
    """Let a user's module, which runs or has run, stand for ours, too."""
    path = folders(name, getattr(loaded, "__path__", ()))
    loaded.__class__ = Shared
    vars(loaded)["__path__"] = path
    vars(loaded).setdefault(RAN, None)  # a plain folder has nothing to run
    if loaded.__spec__ is not None:
        loaded.__spec__.submodule_search_locations = path
