"""
7. Write your own estimator
===========================

An estimator is two functions. This page writes one in Python, compiles the same one with numba, and shows where the C version goes.
"""

# %%
# The two functions
# -----------------
# ``init(belief, tuning, angle)`` returns a state; ``angle`` is the rotor's first angle, or ``None`` where the estimator has to find it.
# ``step(state, sample, belief, tuning)`` is called once in every sampling period. It is given the measured currents and the commanded voltages (never the
# true angle), and returns an ``Estimate``. :doc:`/reference/made/fields` lists all fields with units.
#
# This estimator integrates the voltage to get the flux, takes off what the current causes, and looks in which direction the magnet's flux points. It has to be
# told the first angle.

import math
import tempfile
from pathlib import Path

from sandbox import Estimate, Estimator, Scenario, Segment, load_estimator, simulate


def init(belief, tuning, angle=None):
    """Return the state at the first sample, from an angle (rad) if one is told."""
    first = angle or 0.0
    flux = (belief.magnet_flux * math.cos(first), belief.magnet_flux * math.sin(first))
    return {"theta": first, "omega": 0.0, "flux": flux, "current": (0.0, 0.0)}


def step(state, sample, belief, tuning):
    """Return the state after a sample and the estimate."""
    h, l_q = tuning.sampling_period, 1.0 / belief.energy.gamma_q
    current = (sample.i_alpha, sample.i_beta)
    mean = [0.5 * (new + old) for new, old in zip(current, state["current"])]
    drop = [belief.resistance * i for i in mean]
    voltage = (sample.u_alpha - drop[0], sample.u_beta - drop[1])
    flux = [psi + h * u for psi, u in zip(state["flux"], voltage)]
    seen = math.atan2(flux[1] - l_q * current[1], flux[0] - l_q * current[0])

    theta = state["theta"] + h * state["omega"]  # predict, then correct
    error = math.remainder(seen - theta, math.tau)
    omega = state["omega"] + h * tuning.ki * error
    theta += h * tuning.kp * error
    state.update(theta=theta, omega=omega, flux=flux, current=current)
    return Estimate(theta, omega, theta, 0.0, 1.0, 0.0, 0.0, injection=0.0)


what = "flux of the voltage less that of the current"
mine = Estimator("mine", what, init, step, compiled=False, injection="none")

# %%
# Run it
# ------
# The scenario turns the rotor and gives the first angle (``start_up=False``).

idle = Segment(0.5, speed=0.2, ramp=0.2, settle=0.3)
loaded = Segment(0.5, load=0.8, speed=0.2, ramp=0.1, settle=0.3)
turning = Scenario("turning", (idle, loaded), rotor="driven", start_up=False)
run = simulate("ipm_exchanged", turning, mine, belief="linear")
for row in run.rows:
    print(f"load {row.load:.0%}: mean error {row.error_deg.mean:+.2f}°")
run.plot()

# %%
# Without load it is right; with load it errs by a degree, because it believes in one constant inductance. At standstill it
# would drift away, because the voltage then shows nothing about the position. An estimator of the same kind that comes with the package believes the saturated
# flux:

ours = simulate("ipm_exchanged", turning, "active_flux", belief="saturated")
print(ours)

# %%
# In a file, for the command line
# -------------------------------
# Keep both functions in a file that defines ``ESTIMATOR``. Then every command takes it: ``sensorless compare --estimator my_estimator.py``, ``sensorless
# protocol --estimators my_estimator.py``. Below is the compiled form. The state is an array of numbers, and ``@compiled_step`` compiles the step for the
# loop. It then runs about as fast as those of the package.

source = """
import math

import numpy as np

from sandbox import Estimate, Estimator, compiled_step

THETA, OMEGA, FLUX_A, FLUX_B, I_A, I_B = range(6)


def init(belief, tuning, angle=None):
    state = np.zeros(6)
    state[THETA] = angle or 0.0
    state[FLUX_A] = belief.magnet_flux * math.cos(state[THETA])
    state[FLUX_B] = belief.magnet_flux * math.sin(state[THETA])
    return state


@compiled_step
def step(state, sample, belief, tuning):
    h, r, l_q = tuning.sampling_period, belief.resistance, 1.0 / belief.energy.gamma_q
    state[FLUX_A] += h * (sample.u_alpha - 0.5 * r * (sample.i_alpha + state[I_A]))
    state[FLUX_B] += h * (sample.u_beta - 0.5 * r * (sample.i_beta + state[I_B]))
    state[I_A], state[I_B] = sample.i_alpha, sample.i_beta
    seen = math.atan2(state[FLUX_B] - l_q * sample.i_beta, state[FLUX_A] - l_q * sample.i_alpha)
    state[THETA] += h * state[OMEGA]
    error = seen - state[THETA]
    error -= 2.0 * math.pi * math.floor(error / (2.0 * math.pi) + 0.5)
    state[OMEGA] += h * tuning.ki * error
    state[THETA] += h * tuning.kp * error
    return Estimate(state[THETA], state[OMEGA], state[THETA], 0.0, 1.0, 0.0, 0.0, 0.0)


ESTIMATOR = Estimator("mine_compiled", "flux of the voltage less that of the current", init, step, injection="none")
"""
path = Path(tempfile.mkdtemp()) / "my_estimator.py"
path.write_text(source)
compiled = simulate("ipm_exchanged", turning, load_estimator(path), belief="linear")
for slow, fast in zip(run.rows, compiled.rows, strict=True):
    print(f"Python {slow.error_deg.mean:+.2f}°, compiled {fast.error_deg.mean:+.2f}°")

# %%
# (The last digit may differ: the current sensors count in steps, and a rounding can move a count.)
#
# In C
# ----
# The same two functions in C, with one header. The caller owns the memory; nothing is allocated. This is the whole file:
#
# .. literalinclude:: ../../estimators/c/examples/smallest.c
#    :language: c
#
# A compiler makes a shared library of it, and the library runs in the compiled loop by function pointer. The numbers are of type ``float``, as in a
# firmware. In a shell, ``sensorless include`` prints the folder of the header::
#
#     cc -std=c99 -O2 -fPIC -shared -I "$(sensorless include)" -o mine.so mine.c -lm

import shutil
import subprocess

from sandbox import get_include, load_estimator_library

source = Path(get_include()) / "examples" / "smallest.c"
library, compiler = path.with_name("mine.so"), shutil.which("cc")
if compiler:
    how = [
        compiler,
        "-std=c99",
        "-O2",
        "-fPIC",
        "-shared",
        "-I",
        get_include(),
        "-o",
        library,
    ]
    subprocess.run([*how, source, "-lm"], check=True)
    in_c = load_estimator_library(library)
    for row in simulate("ipm_exchanged", turning, in_c, belief="linear").rows:
        print(f"load {row.load:.0%}: mean error {row.error_deg.mean:+.2f}°")
else:
    print("no C compiler on this machine")

# %%
# On the command line: ``sensorless compare --estimators ekf --estimator-library mine.so``. What is refused, and how ``sensorless export-estimator``
# writes our estimators in C for a firmware: :doc:`/reference/made/estimators_in_c`.
