"""The bench in software: scenario, closed loop, recording, score, trace, plots, command line."""
