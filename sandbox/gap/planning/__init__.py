"""The recording that would tell hypotheses apart: a menu of experiments, and what each would
bring."""
