"""The tests; a package of its own, since some libraries install one of this name, which would be
found in its place."""
