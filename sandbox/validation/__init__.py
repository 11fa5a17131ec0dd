"""What checks the sandbox from outside: the switched bench, and the check on withheld effects."""
