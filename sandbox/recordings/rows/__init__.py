"""Rows of logs that are no samples of the drive: several PWM periods apart."""
