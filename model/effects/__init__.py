"""Everything that can be missing between a model and a bench: one file per effect, its card and its
equation."""
