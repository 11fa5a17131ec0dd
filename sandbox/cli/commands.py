"""What each command does: read its arguments, call the page `sandbox`, save the result, print it."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import sandbox
from estimators.registry import LIBRARIES
from sandbox.cli.arguments import checked_folder, finish
from sandbox.cli.sweeping import check_tolerances, run_tolerances
from sandbox.output.tables import print_list, print_prose, print_table, progress_bar


def names_of(text: str | None, usual: Iterable[str] = ()) -> list[str]:
    """Return names separated by commas, the usual ones where there is no text."""
    return list(usual) if text is None else [name.strip() for name in text.split(",") if name.strip()]


def own_estimators(options: argparse.Namespace) -> list[Any]:
    """Return estimators of the user's own: Python files by name, libraries as objects."""
    return [*options.estimator, *map(library, options.estimator_library)]


def library(path: Path) -> Any:
    """Return a shared library as it is named, which a result can tell; as an object where its suffix is another."""
    return str(path) if path.suffix in LIBRARIES else sandbox.load_estimator_library(path)


def run_compare(options: argparse.Namespace) -> None:
    """Compare beliefs; write compare.json, .html, .png, .parquet and .rrd."""
    from sandbox.public.printed import print_comparison

    folder = checked_folder(options)
    check_tolerances(options)
    with progress_bar("comparing", options.quiet) as progress:
        result = sandbox.compare(
            options.motor, options.scenario, names_of(options.estimators) + own_estimators(options),
            effects=options.effects, seed=options.seed, jobs=options.jobs, progress=progress,
        )  # fmt: skip
    result.save(folder, csv=options.csv, trace=not options.no_trace)
    if not options.quiet:
        print_comparison(result.comparison)
        simulated = sum(run.recording.t[-1] for run in result.runs)
        cpu = sum(run.cpu_seconds for run in result.runs)
        print_prose(f"{simulated:.0f} s simulated in {cpu:.1f} s of CPU; results in {folder}")
    if options.tolerances is not None:
        found = run_tolerances(options, folder, names_of(options.estimators) + options.estimator)
        replace(result, tolerances=found).save(folder, csv=options.csv, trace=not options.no_trace)


def run_simulate(options: argparse.Namespace) -> None:
    """Run one estimator; write simulate.json, .html, .png, .parquet and .rrd."""
    from sandbox.public.printed import print_run
    from sandbox.public.runs import check_new_folder

    folder = checked_folder(options)
    if options.record is not None:
        check_new_folder(options.record, folder)
    own = options.estimator_library
    result = sandbox.simulate(
        options.motor, options.scenario, library(own) if own else options.estimator,
        belief=options.belief, closed_loop=not options.open,
        duration=options.duration, effects=options.effects, plant=options.plant, seed=options.seed,
        record=options.record,
    )  # fmt: skip
    more = not options.json_only
    result.save(folder, csv=options.csv, trace=more and not options.no_trace, figure=more, table=more)
    if not options.quiet:
        print_run(result.comparison, result.design)
        print_prose(
            f"{result.recording.t[-1]:.2f} s simulated in {result.run.cpu_seconds:.3f} s of CPU; results in {folder}"
        )


def run_audit(options: argparse.Namespace) -> None:
    """Audit a motor; write audit.json, .png and .parquet."""
    from sandbox.public.printed import print_audit
    from sandbox.public.result import keep_other

    folder = checked_folder(options)
    result = sandbox.audit(options.motor, options.radius)
    kept = keep_other(folder, "audit", result.audit.motor)
    result.save(folder, csv=options.csv)
    if not options.quiet:
        print_audit(result.drive, result.audit)
        for sentence in result.flux_map.sentences() if result.flux_map else ():
            print_prose(sentence)
        print_prose(f"results in {folder}{f'; {kept}' if kept else ''}")


def run_maps(options: argparse.Namespace) -> None:
    """Write a motor's maps over the current plane: maps.npz, maps.png, maps.json."""
    from sandbox.public.printed import print_maps
    from sandbox.public.result import keep_other

    folder = checked_folder(options)
    result = sandbox.maps(options.motor, options.radius)
    kept = keep_other(folder, "maps", result.maps.motor)
    result.save(folder, csv=options.csv)
    if not options.quiet:
        print_maps(result.maps)
        print_prose(f"results in {folder}{f'; {kept}' if kept else ''}")


def run_motor(options: argparse.Namespace) -> None:
    """Convert what other tools and data sheets state; write motor.toml and motor.json."""
    folder = checked_folder(options)
    found = sandbox.convert_motor(options.stated, options.name)
    found.save(folder)
    if not options.quiet:
        found.show()
        print_prose(f"motor.toml in {folder}")


def run_identify(options: argparse.Namespace) -> None:
    """Identify a motor from a campaign; write identify.json, .png and .parquet."""
    from sandbox.public.printed import print_identification

    folder = checked_folder(options)
    result = sandbox.identify(options.campaign, options.columns, options.preset)
    finish(options, result, folder, lambda: print_identification(result.identification))


def run_protocol(options: argparse.Namespace) -> None:
    """Run the protocol; write protocol.json, .html, .png and .parquet."""
    from sandbox.evaluation.protocol_names import ESTIMATORS, LINES, usual_motors
    from sandbox.public.protocols import ProtocolResult

    folder = checked_folder(options)
    with progress_bar("protocol", options.quiet) as progress:
        result = sandbox.protocol(
            names_of(options.estimators, ESTIMATORS) + own_estimators(options),
            names_of(options.motors, () if options.motors else usual_motors()), names_of(options.tests, LINES),
            seed=options.seed, jobs=options.jobs, keep=folder, cluster=options.dask, progress=progress,
        )  # fmt: skip
    from sandbox.evaluation.pages.protocol_cells import show  # compiles
    from sandbox.evaluation.protocol import with_motulator

    if options.peer:
        result = ProtocolResult(with_motulator(result.protocol, options.anchors, options.peer_python), call=result.call)
    finish(options, result, folder, lambda: show(result.protocol))


def run_export(options: argparse.Namespace) -> None:
    """Write an estimator in C with a motor's constants, golden vectors to check it by, and export-estimator.json."""
    folder = checked_folder(options)
    result = sandbox.export_estimator(options.name, options.motor, options.belief)
    result.save(folder)
    if not options.quiet:
        print_prose(
            f"{result.name} for {result.motor}: {result.operations.said()}; {result.state_bytes} bytes of state"
        )
        print_prose(f"{', '.join(result.files)} in {folder}")
        print_prose("check them: cc -std=c99 -O2 *.c -lm && ./a.out")


def run_bench(options: argparse.Namespace) -> None:
    """Measure; write bench.json."""
    from sandbox.evaluation.bench import told

    folder = checked_folder(options)
    result = sandbox.bench(options.anchors if options.peer else None, options.peer_python)
    rows = [list(told(*figure)) for part in (result.measured, result.ratios) for figure in part.items()]
    finish(options, result, folder, lambda: print_table("what it costs on this machine", ["what", "value"], rows))


def run_verify(options: argparse.Namespace) -> int:
    """Make a result once more and compare; write verify.json; return 1 where it differs."""
    folder = checked_folder(options)
    found = sandbox.verify(options.result, options.tolerance)
    found.save(folder)
    if not options.quiet:
        print_prose(found.sentence())
        for change in found.changed:
            print_prose(f"not as then: {change}")
    return 0 if found.same else 1


def run_list(options: argparse.Namespace) -> None:
    """Print what there is, one line each, or the card of one effect or estimator."""
    from sandbox.public.catalogue import card_of

    if options.name is not None:
        print_prose(card_of(options.kind, options.name))
        return
    lists = {
        "motors": sandbox.list_motors, "effects": sandbox.list_effects, "estimators": sandbox.list_estimators,
        "scenarios": sandbox.list_scenarios, "datasets": sandbox.list_datasets,
        "presets": sandbox.list_presets, "tests": sandbox.list_tests,
    }  # fmt: skip
    print_list(lists[options.kind]())


def run_view(options: argparse.Namespace) -> None:
    """Open a trace in the viewer."""
    sandbox.view(options.file, web=options.web)


def run_show(options: argparse.Namespace) -> None:
    """Open what a result holds."""
    print_prose(sandbox.show(options.result))
