"""Where a gap lies: in which subsystem, at which currents, speeds, angles and frequencies."""
