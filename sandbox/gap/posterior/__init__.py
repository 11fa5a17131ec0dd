"""One statistical model of a campaign: which sets of effects explain it, and how large they are."""
