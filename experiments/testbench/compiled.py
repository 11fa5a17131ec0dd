"""How the bench's functions are compiled: by `njit` where Python calls them, as a `piece` where
others of them alone do.

A piece has no way in from Python, which spares a fifth to a third of the time that all take to
compile.
"""

from numba import njit

piece = njit(cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)
