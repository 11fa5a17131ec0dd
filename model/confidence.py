"""Intervals that hold the truth in 95 % of cases."""

Z95 = 1.959964  # standard deviations of a normal number to either side
