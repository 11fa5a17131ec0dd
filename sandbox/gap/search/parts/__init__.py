"""Further parts of effects that can have several: added one by one or several at once, taken out when idle."""
