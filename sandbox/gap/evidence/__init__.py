"""What a campaign says at one point: normal equations, priors, evidence, the gap and what remains
of it."""
