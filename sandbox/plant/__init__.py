"""The plant: inverter, machine, sensors and shaft, exact between the events of each PWM period."""
