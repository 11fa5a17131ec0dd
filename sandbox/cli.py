"""The command line: a thin layer over functions that a notebook can call as well."""

from __future__ import annotations

import argparse
import io
import os
import sys
import threading
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from model.errors import BadInput, PhysicsError, sentence
from sandbox import report
from sandbox.arguments import Parser, number, positive_int, seed_number
from sandbox.gap.commands import add_diagnose
from sandbox.gap.withheld.commands import add_withheld

OFFLINE = "SENSORLESS_OFFLINE"  # as model.datasets reads it


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; return its exit code (0 done, 2 bad input, 3 the physics failed).

    The work is done in a thread, so that Ctrl-C is answered at once while a kernel runs (exit code 130).
    """
    options = build_parser().parse_args(arguments)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without our letters still gets the rest
    codes: list[int] = []
    worker = threading.Thread(target=lambda: codes.append(attempt(options)), daemon=True)
    worker.start()
    try:
        while worker.is_alive():
            worker.join(0.2)
    except KeyboardInterrupt:
        print(f"sensorless {options.command}: interrupted; nothing half-written", file=sys.stderr, flush=True)
        report.discard(_folder(options))
        os._exit(130)  # the kernel would run on to its end
    return codes[0] if codes else 1


def attempt(options: argparse.Namespace) -> int:
    """Run a command; turn what a user can cause into one sentence and an exit code."""
    before = os.environ.get(OFFLINE)
    try:
        if getattr(options, "offline", False):
            os.environ[OFFLINE] = "1"  # also of the processes that a command starts
        options.run(options)
        sys.stdout.flush()
    except (BadInput, PhysicsError) as error:
        return _refuse(options, str(error), error.exit_code)
    except BrokenPipeError:  # the reader has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as error:
        return _refuse(options, f"{error.filename or 'output'}: {error.strerror or error}")
    except MemoryError:
        return _refuse(options, "not enough memory for this run; shorten the scenario or compare fewer estimators")
    finally:
        if before is None:
            os.environ.pop(OFFLINE, None)
        else:
            os.environ[OFFLINE] = before
    return 0


def _refuse(options: argparse.Namespace, text: str, code: int = 2) -> int:
    print(f"sensorless {options.command}: {sentence(text)}", file=sys.stderr)
    return code


def build_parser() -> Parser:
    """Return the parser of all commands."""
    parser = Parser(prog="sensorless", description="Sandbox for sensorless control of saturated PM motors.")
    parser.add_argument("--version", action="version", version=f"sensorless {report.version()}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=Parser)

    def add(name: str, run: Callable[[argparse.Namespace], None], text: str, writes: bool = True) -> Parser:
        """Return the parser of a new command, with the arguments of all that write."""
        command: Parser = commands.add_parser(name, help=text, description=text)
        command.set_defaults(run=run)
        if writes:
            command.add_argument("--out", type=Path, help=f"folder for results (./sensorless-out/{name})")
            command.add_argument("--jobs", type=positive_int, help="threads, where a command can use them (all cores)")
            command.add_argument("--seed", type=seed_number, default=0, help="of the sensors' noise")
            command.add_argument("--quiet", action="store_true", help="print nothing but errors")
        _offline(command)
        return command

    c = add("compare", run_compare, "position error of a saturated against a linear belief (the main job)")
    _which(c)
    c.add_argument("--estimators", default="qnull,inversion,ekf", help="names, separated by commas")
    c.add_argument("--no-trace", action="store_true", help="write no .rrd")
    text = "what the plant has and the model lacks: effect.parameter=value,... (see `sensorless list effects`)"
    c.add_argument("--effects", default="", metavar="NAME.PARAM=VALUE,...", help=text)
    c = add("simulate", run_simulate, "one run of one estimator")
    _which(c)
    c.add_argument("--estimator", default="qnull", help="(qnull)")
    c.add_argument("--belief", default="saturated", choices=("saturated", "linear"), help="(saturated)")
    c.add_argument("--open", action="store_true", help="the encoder controls, the estimator only watches")
    c.add_argument("--duration", type=number, help="s of the scenario to run (all of it)")
    c.add_argument("--no-trace", action="store_true", help="write no .rrd")
    c.add_argument("--effects", default="", metavar="NAME.PARAM=VALUE,...", help=text)
    c.add_argument("--plant", choices=("averaged", "switched"), help="(averaged, or what the estimator needs)")
    c.add_argument("--record", type=Path, metavar="DIR", help="write the run as a campaign (a new folder)")
    c = add("audit", run_audit, "where a motor's model is valid: convexity, saliency, cross-saturation angle")
    c.add_argument("motor", metavar="MOTOR", help="name or TOML file")
    c.add_argument("--radius", type=number, help="A, of the audited disc of currents (180 %% of rated)")
    c = add(
        "identify", run_identify, "the motor from a campaign's locked recordings: paper's least squares and exact fit"
    )
    c.add_argument("campaign", type=Path, metavar="CAMPAIGN", help="folder with campaign.toml and its tables")
    text = "names and units of recordings from elsewhere (see sandbox/IMPORTING.md)"
    c.add_argument("--columns", type=Path, metavar="FILE.toml", help=text)
    add_diagnose(add)
    c = add("maps", run_maps, "inductances, cross-saturation angle and gain over the current plane")
    c.add_argument("motor", metavar="MOTOR", help="name or TOML file")
    c.add_argument("--radius", type=number, help="A, half width of the plane (180 %% of rated)")
    add_withheld(commands, Parser, positive_int, seed_number)
    c = add("protocol", run_protocol, "the standard evaluation of every estimator and belief on several motors")
    c.add_argument("--estimators", metavar="A,B", help="names, separated by commas (every compiled one)")
    c.add_argument(
        "--motors",
        metavar="A,B",
        help="names or files, separated by commas (three, and `baldor_pmsyrm` where its map is at hand)",
    )
    c.add_argument("--tests", metavar="A,B", help="names, separated by commas (all)")
    _peers(c)
    c = add("bench", run_bench, "cost per plant step and per closed-loop simulated second")
    _peers(c)
    c = add("list", run_list, "what there is", writes=False)
    c.add_argument("kind", choices=("motors", "effects", "estimators", "scenarios", "datasets"))
    c.add_argument("name", nargs="?", help="an effect or estimator, to print its card")
    c = add("view", run_view, "open the rerun viewer on a trace", writes=False)
    c.add_argument("file", type=Path, metavar="FILE.rrd")
    return parser


def _offline(command: Parser) -> None:
    text = "download nothing: say which file is missing and where to put it (or SENSORLESS_OFFLINE=1)"
    command.add_argument("--offline", action="store_true", help=text)


def _which(command: Parser) -> None:
    command.add_argument("--motor", default="ipm_exchanged", metavar="NAME or FILE.toml", help="(ipm_exchanged)")
    command.add_argument("--scenario", default="staircase", metavar="NAME or FILE.toml", help="(staircase)")


def _names(text: str | None, usual: Iterable[str] = ()) -> list[str]:
    return list(usual) if text is None else [name.strip() for name in text.split(",") if name.strip()]


def _peers(command: Parser) -> None:
    command.add_argument("--peer", action="store_true", help="measure the reference programs in the same run, too")
    where, text = Path("../shared/anchors"), "folder of the reference programs"
    command.add_argument("--anchors", type=Path, default=where, help=text)
    command.add_argument("--peer-python", default=sys.executable, help="Python >= 3.12 that has motulator 0.18")


def _folder(options: argparse.Namespace) -> Path:
    return getattr(options, "out", None) or Path("sensorless-out") / options.command


def run_compare(options: argparse.Namespace) -> None:
    """Compare beliefs; write compare.json, compare.png and compare.rrd."""
    from model.effects.library import parse
    from model.parameters import load_drive
    from sandbox.compare import compare, known_estimators
    from sandbox.scenario import load_scenario

    scenario, effects = load_scenario(options.scenario), parse(options.effects)
    estimators = known_estimators(_names(options.estimators))
    report.check_output(_folder(options))
    drive = load_drive(options.motor)  # last: its flux map may have to be downloaded
    with report.progress_bar("comparing", options.quiet) as progress:
        result = compare(
            drive, scenario, estimators,
            seed=options.seed, jobs=options.jobs, progress=progress, effects=effects,
        )  # fmt: skip
    content = result.as_json() | {"figure": "compare.png", "trace": None if options.no_trace else "compare.rrd"}
    if not options.quiet:
        report.print_comparison(result)
    from sandbox.plots import comparison_figure
    from sandbox.trace import write_trace

    with report.results(_folder(options), "compare") as out:
        comparison_figure(result, out / "compare.png")
        if not options.no_trace:
            write_trace(out / "compare.rrd", result)
        report.write_json(out, "compare", content)
    simulated = sum(r.recording.t[-1] for r in result.runs)
    if not options.quiet:
        print(f"{simulated:.0f} s simulated in {content['cpu_seconds']:.1f} s of CPU; results in {_folder(options)}")


def run_simulate(options: argparse.Namespace) -> None:
    """Run one estimator; write simulate.json and simulate.rrd."""
    from estimators.registry import load_estimator
    from model.effects.library import parse
    from model.parameters import load_drive
    from sandbox.compare import single
    from sandbox.scenario import load_scenario
    from sandbox.score import error_of, settled_part

    scenario = load_scenario(options.scenario)
    if options.duration is not None:
        scenario = scenario.cut(options.duration)
    estimator = load_estimator(options.estimator)
    effects = parse(options.effects)
    report.check_output(_folder(options))
    if options.record is not None:
        check_new_folder(options.record, _folder(options))
    drive = load_drive(options.motor)  # last: its flux map may have to be downloaded
    if options.record is not None:
        from sandbox.record import bench_of, campaign_of

        drive = bench_of(drive, estimator)
    result, gains = single(
        drive, scenario, options.estimator, options.belief, not options.open, options.seed, effects, options.plant
    )
    run = result.runs[0]
    lost = any(r.lost_lock for r in run.rows)
    content: dict[str, Any] = {
        "motor": drive.name, "scenario": scenario.name, "estimator": run.estimator, "belief": run.belief,
        "closed_loop": run.closed_loop, "seed": options.seed, "plant": result.properties["plant"], "effects": effects,
        "simulated_seconds": float(run.recording.t[-1]), "cpu_seconds": run.cpu_seconds, "lost_lock": lost,
        "error_deg": asdict(error_of(settled_part(run.recording, run.rows), lost)),
        "rows": [asdict(r) for r in run.rows], "loops": {k: asdict(v) for k, v in gains.loops.items()},
        "trace": None if options.no_trace else "simulate.rrd",
    }  # fmt: skip
    from sandbox.trace import write_trace

    with report.results(_folder(options), "simulate") as out:
        if not options.no_trace:
            write_trace(out / "simulate.rrd", result)
        report.write_json(out, "simulate", content)
    if options.record is not None:
        from model.names import fitting
        from sandbox.campaign import write_campaign

        name = fitting(options.record.name, "campaign")
        write_campaign(options.record, campaign_of(drive, scenario, run.recording, name))
    if not options.quiet:
        report.print_run(result, gains)
        print(
            f"{content['simulated_seconds']:.2f} s simulated in {run.cpu_seconds:.3f} s of CPU; "
            f"results in {_folder(options)}"
        )


def check_new_folder(folder: Path, out: Path) -> None:
    """Raise BadInput, before the run, where a campaign could not be written afterwards."""
    if not folder.name or folder.exists() or folder.resolve() == out.resolve():
        raise BadInput(
            f"--record '{folder}' is no new folder of its own; give one that does not exist, apart from --out"
        )
    parent = next(p for p in folder.resolve().parents if p.exists())
    if not parent.is_dir() or not os.access(parent, os.W_OK):
        raise BadInput(f"--record '{folder}' cannot be made below '{parent}'; give another place")


def run_audit(options: argparse.Namespace) -> None:
    """Audit a motor; write audit.json and audit.png."""
    from model.parameters import load_drive
    from model.saliency import audit

    drive = load_drive(options.motor)
    if options.radius is not None and not 0.0 < options.radius <= 20.0 * drive.motor.rated_current:
        raise BadInput(
            f"radius {options.radius} A must lie in (0, {20.0 * drive.motor.rated_current:g}] A (20 x rated current)"
        )
    result = audit(drive.motor, options.radius)
    from sandbox.plots import audit_figure

    with report.results(_folder(options), "audit") as out:
        audit_figure(drive, result, out / "audit.png")
        report.write_json(out, "audit", {**report.audit_content(drive, result), "figure": "audit.png"})
    if not options.quiet:
        report.print_audit(drive, result)
        print(f"results in {_folder(options)}")


def run_identify(options: argparse.Namespace) -> None:
    """Identify a motor from a campaign; write identify.json and identify.png."""
    from sandbox.identify import identify
    from sandbox.plots import identification_figure

    result = identify(options.campaign, options.columns)
    with report.results(_folder(options), "identify") as out:
        identification_figure(result, out / "identify.png")
        report.write_json(out, "identify", {**result.as_json(), "figure": "identify.png"})
    if not options.quiet:
        report.print_identification(result)
        print(f"results in {_folder(options)}")


def run_maps(options: argparse.Namespace) -> None:
    """Write a motor's maps over the current plane: maps.npz, maps.png, maps.json."""
    import numpy as np

    from model.parameters import load_drive
    from sandbox.maps import maps
    from sandbox.plots import maps_figure

    result = maps(load_drive(options.motor).motor, options.radius)
    summary = result.summary()
    with report.results(_folder(options), "maps") as out:
        arrays: dict[str, Any] = dict(result.arrays())
        np.savez_compressed(out / "maps.npz", **arrays)
        maps_figure(result, out / "maps.png")
        report.write_json(out, "maps", {"motor": result.motor, "arrays": "maps.npz", "figure": "maps.png", **summary})
    if not options.quiet:
        rows = [[name, "–" if value is None else f"{value:.4g}"] for name, value in summary.items()]
        report.print_table(f"{result.motor}: exact against first order (H, rad)", ["figure", "value"], rows)
        print(f"results in {_folder(options)}")


def run_protocol(options: argparse.Namespace) -> None:
    """Run the protocol; write protocol.json, protocol.png and protocol.parquet."""
    from sandbox import protocol as p

    folder = _folder(options)
    report.check_output(folder)
    with report.progress_bar("protocol", options.quiet) as progress:
        result = p.protocol(
            _names(options.estimators, p.ESTIMATORS),
            _names(options.motors, () if options.motors else p.usual_motors()), _names(options.tests, p.TESTS),
            seed=options.seed, jobs=options.jobs or os.cpu_count() or 1, keep=folder, progress=progress,
        )  # fmt: skip
    if options.peer:
        result = p.with_motulator(result, options.anchors, options.peer_python)
    p.publish(result, folder)
    if not options.quiet:
        p.show(result)
        print(f"results in {folder}")


def run_bench(options: argparse.Namespace) -> None:
    """Measure; write bench.json."""
    from sandbox.bench import bench

    result = bench(options.anchors if options.peer else None, options.peer_python)
    with report.results(_folder(options), "bench") as out:
        report.write_json(out, "bench", result)
    if not options.quiet:
        rows = [[name, f"{value:.4g}"] for part in ("measured", "ratios") for name, value in result[part].items()]
        report.print_table("cost", ["figure", "value"], rows)


def run_list(options: argparse.Namespace) -> None:
    """Print what there is, one line each, or the card of one effect or estimator."""
    if options.name is not None:
        if options.kind == "estimators":
            print(report.estimator_card(options.name))
            return
        if options.kind != "effects":
            raise BadInput(f"'{options.kind}' have no cards; `list effects NAME` and `list estimators NAME` print one")
        from model.effects.library import card_text, load_effect

        print(card_text(load_effect(options.name)))
        return
    for name, text in report.catalogue(options.kind):
        print(f"{name:<20} {text}")


def run_view(options: argparse.Namespace) -> None:
    """Open a trace in the viewer."""
    from sandbox.trace import view

    view(options.file)


if __name__ == "__main__":
    raise SystemExit(main())
