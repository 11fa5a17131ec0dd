"""Which sets of effects explain a campaign: starts, fits, rivals, probabilities, estimates."""
