"""Many runs: grids and random designs, their engine (processes or a dask cluster), and the folder
they are kept in."""
