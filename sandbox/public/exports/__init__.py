"""What leaves the house: estimators and drives as C and FMU."""
