"""The check on withheld effects: sealed campaigns from the switched bench, blind diagnoses, scores with limits."""
