"""The paper's table of rated values, and what follows from them: which agree with each other, which
cannot."""

from __future__ import annotations

import math

from experiments.drawing import save

RATED = {
    "ipm": {
        "pole_pairs": 6,
        "power": 200.0,
        "current": 1.2,
        "speed_rpm": 1800.0,
        "torque": 1.06,
        "resistance": 12.15,
    },
    "spm": {
        "pole_pairs": 2,
        "power": 1200.0,
        "current": 3.4,
        "speed_rpm": 400.0,
        "torque": 29.0,
        "resistance": 6.69,
    },
}


def main() -> None:
    """Write power from torque and speed, magnet flux from torque and current, losses, no-load
    voltage."""
    rows = {}
    for name, r in RATED.items():
        omega = r["speed_rpm"] * math.pi / 30
        derived = {
            "power_from_torque": r["torque"] * omega,
            "frequency": r["pole_pairs"] * r["speed_rpm"] / 60,
        }
        for kind, peak in (("peak", r["current"]), ("rms", math.sqrt(2) * r["current"])):
            flux = r["torque"] / (1.5 * r["pole_pairs"] * peak)
            derived[f"magnet_flux_if_{kind}"] = flux
            derived[f"no_load_voltage_if_{kind}"] = flux * r["pole_pairs"] * omega
            derived[f"copper_loss_if_{kind}"] = 1.5 * r["resistance"] * peak**2
        rows[name] = {**r, **derived}
    save("table_ratings", {"motors": rows})


if __name__ == "__main__":
    main()
