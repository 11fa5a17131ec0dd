"""What turns voltage commands and measured currents into position and speed, from a belief about the motor."""
