"""gym-electric-motor's PMSM, continuous voltages, stepped without control; run by `peer_table`."""

from __future__ import annotations

import json
import time

import gym_electric_motor

STEPS = 20_000

env = gym_electric_motor.make("Cont-CC-PMSM-v0")
env.reset()
action, period = 0.01 * env.action_space.sample(), env.unwrapped.physical_system.tau
begun = time.process_time()
for _ in range(STEPS):
    _, _, ended, stopped, _ = env.step(action)
    if ended or stopped:
        env.reset()
spent = time.process_time() - begun
print(
    json.dumps({"peer": "gym-electric-motor", "cpu_s_per_s": spent / (STEPS * period)}), flush=True
)
