"""The option of scripts that hand their work to a dask cluster."""

from __future__ import annotations

import argparse


def on_dask(parser: argparse.ArgumentParser) -> None:
    """Add it to a script's arguments."""
    text = "address of a dask scheduler, tcp://...: its workers do the work (extra `dask`)"
    parser.add_argument("--dask", metavar="ADDRESS", help=text)
