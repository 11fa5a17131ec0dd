"""Sealed campaigns: drawn from one seed, recorded on the switched bench with effects that stay
hidden."""
