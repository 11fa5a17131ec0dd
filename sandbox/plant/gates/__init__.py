"""What the gates of the legs are told: pulses of a voltage, or nothing (blocked)."""
