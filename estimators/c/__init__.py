"""Estimators in C99: the header of foreign ones, and our own, translated from their Python
sources."""
