"""An estimator in a shared library (C or anything with its calling convention), run in the compiled
loop.

The library's functions are those of `c/sensorless_estimator.h`.  One kernel for each width of float
serves every library: the address of its step lies in the state, beside the library's own memory, so
nothing is
compiled anew. What a library is handed is a Sample and, before, its belief and tuning: never the
truth.
"""

from __future__ import annotations

import ctypes
from functools import partial
from pathlib import Path
from shutil import copyfile
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple, get_type_hints

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from estimators.contract import (
    NONE,
    PULSATING,
    ROTATING,
    STATE,
    STEP,
    Belief,
    Estimate,
    Estimator,
    Tuning,
)
from model.compiled import kernel_as
from model.energy import Energy
from model.errors import BadInput
from model.frames import wrap

ABI = 1
LARGEST_STATE = 1 << 20  # bytes
FUNCTIONS = ("abi", "real_bytes", "state_bytes", "injection", "name", "init", "step")
INJECTIONS = (NONE, PULSATING, ROTATING)  # by number
# Places in the state, in words of 8 bytes: address of the step, angle told last (rad), whether one
# has been told, room for a sample and an estimate, the library's own.
ADDRESS, THETA, TOLD, SAMPLE, ESTIMATE, OWN = 0, 1, 2, 3, 8, 16
# Places in the structures `sensorless_sample` and `sensorless_estimate` of the header.
I_ALPHA, I_BETA, U_ALPHA, U_BETA, CARRIER = range(5)
ANGLE, OMEGA, AXIS, BIAS, TRACKING, RIPPLE_D, RIPPLE_Q, INJECTION = range(8)
GUARD = 0x5EA15EA15EA15EA1  # behind the library's own: still there after init


class Loaded(NamedTuple):
    """A library that has been looked at: its handle, what it says of itself."""

    handle: ctypes.CDLL
    path: Path
    name: str
    real_bytes: int
    state_bytes: int
    injection: str


# by full path: when it was written, what was made of it
_KNOWN: dict[Path, tuple[int, Estimator]] = {}


def load_library(path: str | Path) -> Estimator:
    """Return the estimator of a shared library; the same object again while the file is the same.

    BadInput where it does not exist, cannot be loaded, lacks a function, has another ABI or an
    impossible state.
    Loading a library runs its code: only take one that you trust.
    """
    file = Path(path)
    if not file.is_file():
        raise BadInput(
            f"estimator library '{path}' does not exist; build one as `sensorless_estimator.h` says"
        )
    full = file.resolve()
    written = full.stat().st_mtime_ns
    known = _KNOWN.get(full)
    if known is None or known[0] != written:
        loaded = _looked_at(_opened(full, str(path), again=known is not None), full, str(path))
        _KNOWN[full] = known = written, _estimator(loaded)
    return known[1]


def _opened(full: Path, said: str, again: bool) -> ctypes.CDLL:
    """Return a library's handle; `again`: from a copy, as the system would hand out the one it has
    loaded before."""
    try:
        if not again:
            return ctypes.CDLL(str(full))
        with TemporaryDirectory(prefix="sensorless-library-", ignore_cleanup_errors=True) as folder:
            copyfile(full, Path(folder) / full.name)
            return ctypes.CDLL(str(Path(folder) / full.name))
    except OSError as error:
        raise BadInput(
            f"estimator library '{said}' is no library that this machine can load: {error}"
        ) from error


def _looked_at(handle: ctypes.CDLL, full: Path, said: str) -> Loaded:
    """Return what a library says of itself; BadInput where it does not fit."""
    missing = [
        f"sensorless_{name}" for name in FUNCTIONS if not hasattr(handle, f"sensorless_{name}")
    ]
    if missing:
        raise BadInput(
            f"estimator library '{said}' lacks {', '.join(missing)}; define sensorless_init and "
            "sensorless_step and end the file with SENSORLESS_ESTIMATOR(...)"
        )
    handle.sensorless_name.restype = ctypes.c_char_p
    abi = handle.sensorless_abi()
    if abi != ABI:
        raise BadInput(
            f"estimator library '{said}' has ABI {abi}, this sandbox {ABI}; build it "
            "with our header"
        )
    real, size, kind = (
        getattr(handle, f"sensorless_{name}")()
        for name in ("real_bytes", "state_bytes", "injection")
    )
    if real not in (4, 8):
        raise BadInput(
            f"estimator library '{said}' has numbers of {real} bytes; 4 (float) or 8 "
            "(double) can be run"
        )
    if not 1 <= size <= LARGEST_STATE:
        raise BadInput(
            f"estimator library '{said}' wants a state of {size} bytes; 1 to "
            f"{LARGEST_STATE} are handed out"
        )
    if not 0 <= kind < len(INJECTIONS):
        raise BadInput(
            f"estimator library '{said}' names injection {kind}; the header has 0 to "
            f"{len(INJECTIONS) - 1}"
        )
    name = (handle.sensorless_name() or b"").decode(errors="replace") or full.stem
    return Loaded(handle, full, name, real, size, INJECTIONS[kind])


def _estimator(loaded: Loaded) -> Estimator:
    """Return a library as an estimator."""
    return Estimator(
        loaded.name,
        f"shared library {loaded.path.name}, {8 * loaded.real_bytes} bit",
        partial(_init, loaded),
        step_single if loaded.real_bytes == 4 else step_double,
        injection=loaded.injection,
        source=loaded.path.name,
    )


def _structure(name: str, *fields: tuple[str, Any]) -> type[ctypes.Structure]:
    return type(name, (ctypes.Structure,), {"_fields_": list(fields)})


def _of(name: str, template: Any, real: Any, **special: Any) -> type[ctypes.Structure]:
    """Return the structure of a NamedTuple's fields: whole numbers as int32, the rest as `real`."""
    kinds = get_type_hints(template)
    fields = [
        (f, special.get(f, ctypes.c_int32 if kinds[f] is int else real)) for f in template._fields
    ]
    return _structure(name, *fields)


def setup_of(real: Any, belief: Belief, tuning: Tuning, angle: float | None) -> ctypes.Structure:
    """Return a `sensorless_setup` of c_float or c_double; BadInput where the belief is not the
    quartic."""
    if not isinstance(belief.energy, Energy):
        raise BadInput(
            "an estimator library takes the quartic energy, and this motor's saturated belief is "
            "a flux map; run it with a linear belief or on a motor with alphas"
        )
    energies = _of("Energy", Energy, real)
    beliefs, tunings = _of("Belief", Belief, real, energy=energies), _of("Tuning", Tuning, real)
    whole = _structure(
        "Setup",
        ("belief", beliefs),
        ("tuning", tunings),
        ("angle_known", ctypes.c_int32),
        ("angle", real),
    )
    believed = beliefs(energies(*belief.energy), *belief[1:])
    return whole(believed, tunings(*tuning), angle is not None, angle or 0.0)


def _init(loaded: Loaded, belief: Belief, tuning: Tuning, angle: float | None = None) -> np.ndarray:
    """Return the state: ours, and the library's own, initialised by it; BadInput where it
    refuses."""
    setup = setup_of(
        ctypes.c_float if loaded.real_bytes == 4 else ctypes.c_double, belief, tuning, angle
    )
    words = -(-loaded.state_bytes // 8)
    state = np.zeros(OWN + words + 1)
    raw = state.view(np.uint64)
    raw[ADDRESS] = ctypes.cast(loaded.handle.sensorless_step, ctypes.c_void_p).value or 0
    raw[-1] = GUARD
    code = loaded.handle.sensorless_init(
        ctypes.c_void_p(state.ctypes.data + 8 * OWN), ctypes.byref(setup)
    )
    if raw[-1] != GUARD:
        raise BadInput(
            f"estimator '{loaded.name}' ({loaded.path.name}) writes beyond the "
            f"{loaded.state_bytes} bytes of its state;"
            " give SENSORLESS_ESTIMATOR the type that init fills"
        )
    if code:
        said = f"estimator '{loaded.name}' ({loaded.path.name}) refuses this motor"
        returned = f"sensorless_init returned {code}; its source says why"
        if angle is not None:
            raise BadInput(f"{said}: {returned}")
        raise BadInput(
            f"{said}, or to find its first angle itself: {returned}; a scenario with "
            "start_up = false tells the angle"
        )
    return state


@intrinsic
def _call(typing_context: Any, address: Any, state: Any) -> Any:
    """Call the function at an address with pointers to the state's own part, its sample and its
    estimate."""

    def generate(context, builder, signature, arguments):
        """Write the call."""
        data = context.make_array(STATE)(context, builder, arguments[1]).data
        bytes_at = cgutils.voidptr_t
        places = [
            builder.bitcast(cgutils.gep(builder, data, k), bytes_at)
            for k in (OWN, SAMPLE, ESTIMATE)
        ]
        function = ir.FunctionType(ir.VoidType(), [bytes_at] * 3).as_pointer()
        builder.call(builder.inttoptr(arguments[0], function), places)
        return context.get_dummy_value()

    return types.void(types.int64, STATE), generate


@numba.njit(inline="always", error_model="numpy")
def _followed(state, theta):
    """Return the angle (rad) told, whole turns added so that it goes on from the one before."""
    if state[TOLD] != 0.0:
        theta = state[THETA] + wrap(theta - state[THETA])
    state[TOLD], state[THETA] = 1.0, theta
    return theta


@numba.njit(inline="always", error_model="numpy")
def _write_sample(x, e, sample):
    """Write a sample, and an estimate that the library has not filled in yet."""
    x[I_ALPHA], x[I_BETA] = sample.i_alpha, sample.i_beta
    x[U_ALPHA], x[U_BETA] = sample.u_alpha, sample.u_beta
    x[CARRIER] = sample.carrier
    e[: INJECTION + 1] = 0.0
    e[INJECTION] = 1.0


@numba.njit(inline="always", error_model="numpy")
def _found(state, e):
    """Return the estimate that the library has written, its angle going on from the last one."""
    return Estimate(
        _followed(state, np.float64(e[ANGLE])),
        np.float64(e[OMEGA]),
        np.float64(e[AXIS]),
        np.float64(e[BIAS]),
        np.float64(e[TRACKING]),
        np.float64(e[RIPPLE_D]),
        np.float64(e[RIPPLE_Q]),
        np.float64(e[INJECTION]),
    )


@kernel_as(STEP)
def step_double(state, sample, belief, tuning):
    """Take one sample: a library of doubles."""
    _write_sample(state[SAMPLE:ESTIMATE], state[ESTIMATE:OWN], sample)
    _call(state.view(np.int64)[ADDRESS], state)  # type: ignore[call-arg]  # numba hands the context over
    return _found(state, state[ESTIMATE:OWN])


@kernel_as(STEP)
def step_single(state, sample, belief, tuning):
    """Take one sample: a library of floats."""
    e = state[ESTIMATE:OWN].view(np.float32)
    _write_sample(state[SAMPLE:ESTIMATE].view(np.float32), e, sample)
    _call(state.view(np.int64)[ADDRESS], state)  # type: ignore[call-arg]  # numba hands the context over
    return _found(state, e)
