"""Motion behind what an encoder read: of driven, free and compliant rotors."""
