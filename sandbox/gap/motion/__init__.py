"""Motion only: the shaft's equation on recordings without voltages."""
