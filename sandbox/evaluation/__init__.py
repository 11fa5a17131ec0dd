"""Runs judged: position errors, comparison of beliefs, the protocol for estimators, what they
cost."""
