"""The bench in software; its public functions and classes are those of `sandbox.public.page`.

from sandbox import simulate, compare, load_motor
run = simulate("ipm_exchanged", "staircase", "inversion", belief="linear")
run.plot(); run.to_dataframe(); run.save("results")
"""

from typing import TYPE_CHECKING

from sandbox.engine.shadowing import share_names

share_names()

from sandbox.public.page import __all__, __dir__, __getattr__  # noqa: E402, F401 (shared names first)

if TYPE_CHECKING:  # for editors and type checkers
    from sandbox.public.page import *  # noqa: F403

    __version__: str
