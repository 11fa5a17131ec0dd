"""A drive in closed loop: scenario, control, gains, the loop around a plant, what a run leaves
behind."""
