"""Tables and logs of other programs, a file each; `sandbox.recordings.foreign` chooses among them
by suffix."""
