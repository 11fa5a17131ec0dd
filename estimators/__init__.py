"""What turns voltage commands and measured currents into position and speed, from a belief about
the motor."""

import os
import sys

# A user's plain folder of this name beside their script is found, too, after ours
# (sandbox/engine/shadowing.py).
_plain = (os.path.join(place, __name__) for place in sys.path)
__path__ += [
    f for f in _plain if os.path.isdir(f) and not os.path.exists(os.path.join(f, "__init__.py"))
]
