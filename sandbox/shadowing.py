"""A user's own `model.py` or `estimators.py` beside their script: it and our package of that name are both there.

Python looks beside the running script first, so such a file would hide our package.  Where there is one, a single
module stands for both: its submodules (`model.energy`) are ours, its attributes (`model.anything`) are those of the
user's file, which runs when the first of them is asked for.  Our own code imports names from submodules only, never
from the package itself (a test holds it), so neither side sees the other.
"""

from __future__ import annotations

import sys
from importlib.machinery import ModuleSpec, SourceFileLoader
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
RAN = "__ran__"


class Shared(ModuleType):
    """A module with the submodules of one of our packages and the attributes of a user's file."""

    def __getattr__(self, name: str) -> Any:
        """Run the user's file, once, for an attribute that is not there yet."""
        if self.__dict__.get(RAN) or (name.startswith("__") and name != "__all__"):
            raise AttributeError(f"module '{self.__name__}' ('{self.__file__}') has no attribute '{name}'")
        self.__dict__[RAN] = True
        assert self.__spec__ is not None
        assert self.__spec__.loader is not None
        try:
            self.__spec__.loader.exec_module(self)
        except BaseException:
            self.__dict__[RAN] = False
            raise
        return getattr(self, name)

    def __setattr__(self, name: str, value: object) -> None:
        """Leave a submodule's name to the user's file: importing `model.energy` sets no attribute `energy`."""
        if not (isinstance(value, ModuleType) and value.__name__ == f"{self.__name__}.{name}"):
            super().__setattr__(name, value)

    def __dir__(self) -> list[str]:
        getattr(self, "__all__", None)
        return sorted(self.__dict__)


def share(name: str) -> None:
    """See to it that our package of a name can be imported beside a user's file of that name.

    ImportError where the user's is no file of Python source but a package (a folder) or a library, which cannot share.
    """
    loaded, own = sys.modules.get(name), ROOT / name
    spec: ModuleSpec | None = getattr(loaded, "__spec__", None) if loaded else find_spec(name)
    found = (spec.origin if spec else None) or getattr(loaded, "__file__", None)
    if not found or Path(found).resolve() == own / "__init__.py" or isinstance(loaded, Shared):
        return
    if spec is None or spec.submodule_search_locations is not None or not isinstance(spec.loader, SourceFileLoader):
        suffix = Path(found).suffix if Path(found).stem == name else ""
        raise ImportError(
            f"'{found}' hides the package '{name}' that sensorless-sandbox is installed with; rename that file or "
            f"folder, for example to my_{name}{suffix}"
        )
    spec.submodule_search_locations = [str(own)]
    if loaded is None:
        loaded = sys.modules[name] = Shared(name)
        vars(loaded).update(__spec__=spec, __loader__=spec.loader, __package__=name, __file__=spec.origin)
    else:  # runs, or has run
        loaded.__class__ = Shared
        vars(loaded)[RAN] = True
    vars(loaded)["__path__"] = spec.submodule_search_locations
