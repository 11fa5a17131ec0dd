"""What a motor, an inverter, a sensor and a shaft are: equations and parameters, no time loops, no control."""
