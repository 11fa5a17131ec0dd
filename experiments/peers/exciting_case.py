"""exciting-environments' PMSM (JAX, double, one thread), alone and a thousand at once; run by
`peer_table`."""

from __future__ import annotations

import json
import os
import statistics
import time

os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"

import jax
import jax.numpy as jnp
from exciting_environments.pmsm.pmsm_env import PMSM

jax.config.update("jax_enable_x64", True)
PERIOD = 1e-4  # s

for batch, steps in ((1, 20_000), (1000, 500)):
    env = PMSM(batch_size=batch, tau=PERIOD)
    _, first = env.vmap_reset()
    action = jnp.zeros((batch, 2))

    @jax.jit
    def run(state, env=env, action=action, steps=steps):
        """Return the last state."""
        return jax.lax.scan(lambda s, _: (env.vmap_step(s, action)[1], None), state, None, steps)[0]

    jax.block_until_ready(run(first))
    times = []
    for _ in range(3):
        begun = time.process_time()
        jax.block_until_ready(run(first))
        times.append(time.process_time() - begun)
    cost = statistics.median(times) / (steps * PERIOD * batch)
    name = "exciting-environments" + ("" if batch == 1 else f", {batch} at once")
    print(json.dumps({"peer": name, "cpu_s_per_s": cost}), flush=True)
