"""Angles as logs hold them, or what stands in for one: wrapped, of a speed, of Hall states, without
a zero."""
