"""A second simulator of other structure: every leg switched, stationary frame; shares no plant code
with the kernel."""
