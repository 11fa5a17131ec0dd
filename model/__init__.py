"""What a motor, an inverter, a sensor and a shaft are: equations and parameters, no time loops, no
control."""

import os
import sys

# A user's plain folder of this name beside their script is found, too, after ours
# (sandbox/engine/shadowing.py).
_plain = (os.path.join(place, __name__) for place in sys.path)
__path__ += [
    f for f in _plain if os.path.isdir(f) and not os.path.exists(os.path.join(f, "__init__.py"))
]
