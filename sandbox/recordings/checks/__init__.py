"""Checks of recordings against the voltage equation, and the table of mistakes that explain what
they contradict."""
