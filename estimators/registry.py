"""Every estimator by name; a module is imported only when asked for."""

from __future__ import annotations

import ast
import os
import sys
import zlib
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from model.errors import BadInput, raised, unknown
from model.names import check_name
from model.plugins import brought, line_of, load

if TYPE_CHECKING:
    from estimators.contract import Estimator

# a name, a Python file or a shared library, or the object
AnyEstimator: TypeAlias = "str | Path | Estimator"
LIBRARIES = (".so", ".dylib", ".dll")
MODULES = {
    "qnull": "estimators.qnull",
    "inversion": "estimators.inversion",
    "rotating": "estimators.rotating",
    "hfi45": "estimators.hfi45",
    "vesc_hfi": "estimators.vesc_hfi",
    "random_frequency": "estimators.random_frequency",
    "table": "estimators.table",
    "arbitrary": "estimators.arbitrary",
    "pwm_ripple": "estimators.pwm_ripple",
    "fluxdemod": "estimators.fluxdemod",
    "pll3": "estimators.pll3",
    "mechanical": "estimators.mechanical",
    "monitor": "estimators.monitor",
    "active_flux": "estimators.active_flux",
    "hybrid": "estimators.hybrid",
    "ekf": "estimators.kalman",
    "ekf_current": "estimators.kalman_current",
    "ukf": "estimators.unscented",
    "ekf_filterpy": "estimators.kalman_filterpy",
    "ukf_filterpy": "estimators.unscented_filterpy",
}


def estimator_names() -> list[str]:
    """Return the known names, the usual one first, those of other packages last."""
    return list(dict.fromkeys([*MODULES, *brought("estimators")]))


def check_known(which: AnyEstimator) -> None:
    """Raise BadInput, before anything is compiled, for an unknown name or a file that does not
    exist."""
    if isinstance(which, (str, Path)):
        if Path(which).suffix in LIBRARIES:
            _check_library(Path(which))
        elif _is_file_name(which):
            _check_there(Path(which))
        elif which not in estimator_names():
            raise unknown("estimator", which, estimator_names())


def _is_file_name(which: str | Path) -> bool:
    return Path(which).suffix == ".py" or len(Path(which).parts) > 1


def _check_there(path: Path) -> None:
    if not path.is_file():
        raise BadInput(
            f"estimator file '{path}' does not exist; give a Python file that defines ESTIMATOR"
        )


def _check_library(path: Path) -> None:
    if not path.is_file():
        raise BadInput(
            f"estimator library '{path}' does not exist; build one as `sensorless_estimator.h` says"
        )


def load_estimator(which: AnyEstimator) -> Estimator:
    """Return an estimator by name, from a Python file that defines ESTIMATOR, from a shared
    library, or as it is given.

    BadInput for an unknown name (with the nearest one), a file without an estimator, and an
    estimator of one's own that bears the name of a built-in one.
    """
    check_known(which)
    from estimators.contract import Estimator

    if isinstance(which, Estimator):
        return _apart(which)
    if Path(which).suffix in LIBRARIES:
        return load_estimator_library(which)
    if _is_file_name(which):
        return _apart(_from_file(Path(which)))
    if str(which) not in MODULES:
        return _brought(str(which))
    found: Estimator = import_module(MODULES[str(which)]).ESTIMATOR
    return found


def _brought(name: str) -> Estimator:
    """Return the estimator of another package."""
    from estimators.contract import Estimator

    point = brought("estimators")[name]
    found = load(point)
    if not isinstance(found, Estimator) or found.name != name:
        raise BadInput(
            f"'{point.value}' of another package is no Estimator of the name '{name}'; "
            "mend it there"
        )
    return found


def load_estimator_library(path: str | Path) -> Estimator:
    """Return the estimator of a shared library (`c/sensorless_estimator.h`); BadInput where it does
    not fit."""
    _check_library(Path(path))
    from estimators.shared_library import load_library  # compiles

    return _apart(load_library(path))


def summaries() -> dict[str, str]:
    """Return what each estimator does in one line, read from its source: importing it would compile
    it.

    Those of other packages: what their package says of itself.
    """
    own = {
        n: _summary(Path(__file__).with_name(f"{m.rpartition('.')[2]}.py"))
        for n, m in MODULES.items()
    }
    return own | {
        name: line_of(point) for name, point in brought("estimators").items() if name not in own
    }


def _summary(path: Path) -> str:
    """Return the second argument of ESTIMATOR = Estimator(name, summary, ...)."""
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "ESTIMATOR":
            assert isinstance(node.value, ast.Call)
            return str(ast.literal_eval(node.value.args[1]))
    raise AssertionError(f"{path.name} defines no ESTIMATOR")


def _from_file(path: Path) -> Estimator:
    """Return the ESTIMATOR of a user's file; the file's folder is where its own imports are found,
    too."""
    from estimators.contract import Estimator

    full = path.resolve()
    # importable again: compiled code is cached by module name
    name = f"{path.stem}_{zlib.crc32(os.fsencode(full)):x}"
    if (
        name not in sys.modules
        or getattr(sys.modules[name], "READ_AT", None) != full.stat().st_mtime_ns
    ):
        spec = spec_from_file_location(name, full)
        if spec is None or spec.loader is None:
            raise BadInput(f"estimator file '{path}' is no Python file; give one that ends in .py")
        module = module_from_spec(spec)
        sys.modules[name] = module
        sys.path.append(str(full.parent))
        try:
            spec.loader.exec_module(module)
        except (Exception, SystemExit) as error:
            # whatever a user's file raises is the user's to mend
            del sys.modules[name]
            raise BadInput(
                f"estimator file '{path}' cannot be run: {raised(error)}; mend it there"
            ) from error
        finally:
            sys.path.remove(str(full.parent))
        module.READ_AT = full.stat().st_mtime_ns  # type: ignore[attr-defined]
    found = getattr(sys.modules[name], "ESTIMATOR", None)
    if not isinstance(found, Estimator):
        raise BadInput(
            f"estimator file '{path}' defines no ESTIMATOR; write ESTIMATOR = "
            "Estimator(name, summary, init, step)"
        )
    return found


def _apart(own: Estimator) -> Estimator:
    """Return an estimator; BadInput where its name cannot be shown, or is that of a built-in one
    that it is not."""
    check_name(own.name, "estimator's name")
    if own.name in MODULES and own is not load_estimator(own.name):
        raise BadInput(f"'{own.name}' is the name of a built-in estimator; give yours another one")
    return own
