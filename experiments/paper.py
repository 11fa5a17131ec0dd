"""Regenerate every figure and table of the paper: `python -m experiments.paper` (results/, about a
minute)."""

from __future__ import annotations

from experiments import (
    figure_1_curves,
    figure_2_ripple,
    figure_5_angle,
    figures_3_4_fits,
    figures_6_7_steps,
    table_identification,
    table_ratings,
)


def main() -> None:
    """Run the scripts in the paper's order."""
    for script in (
        figure_1_curves,
        figure_2_ripple,
        figures_3_4_fits,
        figure_5_angle,
        figures_6_7_steps,
        table_ratings,
        table_identification,
    ):
        script.main()


if __name__ == "__main__":
    main()
