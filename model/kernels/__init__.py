"""How compiled functions are made and kept: what numba lacks for them (README.md); the door is
`model.compiled`."""
