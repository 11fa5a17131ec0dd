"""Simple methods and two stronger ones, on the same campaigns as the diagnosis."""
