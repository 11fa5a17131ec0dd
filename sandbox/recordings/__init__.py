"""Campaigns of a bench: reading them from anywhere, checking them, what can be read off them
directly."""
