"""The drive that leaves the house: plant and effects as plain C99 and as an FMU, from the kernels
themselves."""
