"""A user's own `model.py` or `estimators.py` beside their script: it and our package of that name are both there.

Python looks beside the running script first, so such a file would hide our package.  Where there is one, a single
module stands for both: its submodules (`model.energy`) are ours, its attributes (`model.anything`) are those of the
user's file, which runs when the first of them is asked for.  Our own code imports names from submodules only, never
from the package itself (a test holds it), so neither side sees the other.

What this cannot do: a file that is imported for what it does, not for a name, waits until a name is read; a file that
comes onto Python's path after ours were loaded is not found; `import model.energy` gives no `model.energy.currents`
where the user's file is there (`from model.energy import currents` does).
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Sequence
from importlib.abc import Loader
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
NAMES = ("model", "estimators")  # the top-level packages that are installed with this one
RAN = "__builtins__"  # what running a file leaves in its module
OF_IMPORT = ("__path__", "__spec__", "__loader__", "__package__", "__file__", "__cached__", "__wrapped__")
RUNNING = threading.RLock()


class Shared(ModuleType):
    """A module with the submodules of one of our packages and the attributes of a user's file."""

    def __getattr__(self, name: str) -> Any:
        """Run the user's file, once, for an attribute that is not there yet."""
        with RUNNING:
            if RAN not in self.__dict__ and name not in OF_IMPORT:
                self.__loader__.run(self)  # type: ignore[union-attr]
                return getattr(self, name)
        if name in self.__dict__:  # another thread has run it
            return self.__dict__[name]
        raise AttributeError(f"module '{self.__name__}' ('{self.__dict__.get('__file__')}') has no attribute '{name}'")

    def __setattr__(self, name: str, value: object) -> None:
        """Leave a submodule's name to the user's file: importing `model.energy` sets no attribute `energy`."""
        if not (isinstance(value, ModuleType) and value.__name__ == f"{self.__name__}.{name}"):
            super().__setattr__(name, value)

    def __dir__(self) -> list[str]:
        getattr(self, "__all__", None)
        return sorted(self.__dict__)


class Later(Loader):
    """Runs a user's file when it is asked to, not when its module is imported."""

    def __init__(self, theirs: Loader) -> None:
        self.theirs = theirs

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


class Beside:
    """Finds a user's file of one of our names, and our package with it."""

    @staticmethod
    def find_spec(name: str, path: Sequence[str] | None = None, target: ModuleType | None = None) -> ModuleSpec | None:
        """Return what stands for both; None where ours is found; ImportError where the user's cannot share."""
        spec = PathFinder.find_spec(name) if name in NAMES and path is None else None
        if spec is None or not spec.origin or Path(spec.origin).resolve() == ROOT / name / "__init__.py":
            return None
        if spec.loader is None or spec.submodule_search_locations is not None or not spec.origin.endswith(".py"):
            raise ImportError(hidden(name, spec.origin))
        both = ModuleSpec(name, Later(spec.loader), origin=spec.origin, is_package=True)
        both.submodule_search_locations = [str(ROOT / name)]
        both.has_location = True
        return both


def hidden(name: str, found: str) -> str:
    """Return the sentence for a folder, or a compiled library, that hides one of our packages."""
    suffix = Path(found).suffix if Path(found).stem == name else ""
    return (
        f"'{found}' hides the package '{name}' that sensorless-sandbox is installed with; rename that file or folder, "
        f"for example to my_{name}{suffix}"
    )


def share_names() -> None:
    """See to it that our packages can be imported beside a user's files of their names; ImportError where not."""
    for name in NAMES:
        loaded = sys.modules.get(name)
        file = getattr(loaded, "__file__", None)
        if loaded is None:
            Beside.find_spec(name)
        elif file and Path(file).resolve() != ROOT / name / "__init__.py" and not isinstance(loaded, Shared):
            if hasattr(loaded, "__path__"):
                raise ImportError(hidden(name, file))
            loaded.__class__ = Shared  # runs, or has run
            vars(loaded)["__path__"] = [str(ROOT / name)]
            if loaded.__spec__ is not None:
                loaded.__spec__.submodule_search_locations = vars(loaded)["__path__"]
    if Beside not in sys.meta_path:
        sys.meta_path.insert(0, Beside)
