"""How the switched bench makes pulses of a voltage, and what it does while no gate switches."""
