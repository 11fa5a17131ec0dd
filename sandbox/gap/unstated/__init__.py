"""What a campaign does not state and its readings tell: counts of the PWM timer, offsets that
drift."""
