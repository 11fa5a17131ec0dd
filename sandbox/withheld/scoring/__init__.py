"""Diagnoses of sealed campaigns: run blindly, judged against the opened truth, beside simple
methods."""
