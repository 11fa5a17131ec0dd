"""Recorded campaigns through the model: batches of parameter sets side by side, residuals,
sensitivities."""
