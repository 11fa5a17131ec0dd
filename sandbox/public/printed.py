"""What the commands print: tables a person reads, and how to read them."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from model.errors import PhysicsError
from model.ratings import assumed, cautions
from sandbox.evaluation.choice import ANY, standings, which
from sandbox.evaluation.lost import reasons
from sandbox.evaluation.pages.compare_figure import NO_THEORY
from sandbox.evaluation.pages.compare_tables import (
    THEORY,
    comparison_tables,
    number_text,
    rpm_text,
    theory_of,
)
from sandbox.evaluation.pages.cost_figure import cost_table
from sandbox.evaluation.protocol_names import BELIEFS
from sandbox.output.tables import print_prose, print_table

KALMAN = ("ekf", "ekf_current", "ukf", "ekf_filterpy", "ukf_filterpy")
TYPE_3 = ("pll3", "pwm_ripple", "mechanical")
TRIPLE = "margins of a type 2 loop; this estimator has a triple pole with the same crossover"

if TYPE_CHECKING:
    from model.parameters import Drive
    from model.saliency import Audit
    from sandbox.drive.design import Design
    from sandbox.evaluation.compare import Comparison, Run
    from sandbox.evaluation.maps import Maps
    from sandbox.evaluation.score import ErrorDeg
    from sandbox.recordings.identify import Identification
    from sandbox.replay.identification.identified import OrdinaryIdentification


def print_comparison(c: Comparison) -> None:
    """Print both tables and how to read them."""
    for title, heads, rows in comparison_tables(c):
        print_table(title, heads, rows, fixed=3 if heads[2] == THEORY else 2, together=len(BELIEFS))
    theory = "theory: the cross-saturation angle that a linear belief cannot see, for small ripple."
    known = {
        row.estimator: row.predicted_mean_deg is not None
        for row in c.rows
        if row.belief == "linear"
    }
    if without := [name for name, held in known.items() if not held]:
        theory += f" It is not made for {', '.join(without)}, {NO_THEORY}."
    if all(row.predicted_mean_deg is None for row in c.rows):
        theory = (
            "theory: none, as it knows the motor alone, not the effects of this plant or "
            "these estimators."
        )
    for text in reasons(c.rows):
        print_prose(text)
    found = standings(c.rows)
    if any(s.loss_w is not None for s in found):
        print_table(
            "what the injection costs (largest of all segments, the estimate in control)",
            *cost_table(found),
        )
    if c.limits != ANY:
        print_prose(f"Within the limits: {which(found, c.limits)}")
    print_cautions(c.drive)
    print_prose(
        f"Position error in electrical degrees, mean (95th percentile of its size); {theory}"
    )


def print_run(c: Comparison, gains: Design) -> None:
    """Print the rows of a single run and the loops it was controlled by."""
    run = c.runs[0]
    theory = theory_of([run])
    speeds = ["asked\nrpm", "true\nrpm"] if c.scenario.rotor == "free" else ["rpm"]
    heads = ["load %", *speeds, *[THEORY][: len(theory)], "mean °", "rms °", "p95 °", "max °"]
    lines = []
    for k, row in enumerate(run.rows):
        e = row.error_deg
        values = (
            ["lost lock", "", "", ""]
            if row.lost_lock
            else [number_text(e.mean), *(f"{v:.2f}" for v in _sizes(e))]
        )
        values[0] += "" if row.reference_held else " (speed missed)"
        rpm = [f"{row.speed_rpm:+.4g}", rpm_text(row.true_speed_rpm)][: len(speeds)]
        lines.append([f"{100 * row.load:+.0f}", *rpm, *theory[k : k + 1], *values])
    print_table(f"{c.drive.name}, {c.scenario.name}, {run.name}: position error", heads, lines)
    for text in reasons(run.rows):
        print_prose(text)
    print_cautions(c.drive)
    heads = ["loop", "bandwidth\nrad/s", "phase margin\n°", "gain\nmargin", "disk\nmargin"]
    loops = [
        [
            name,
            f"{v.bandwidth:.1f}",
            f"{v.phase_margin_deg:.1f}",
            f"{v.gain_margin:.2f}",
            f"{v.disk_margin:.2f}",
        ]
        for name, v in gains.loops.items()
    ]
    own = run.estimator
    if own in KALMAN:
        loops = [row for row in loops if row[0] != "tracking"]
    said = (
        ""
        if own in KALMAN
        else f"; tracking loop: at zero load{', ' + TRIPLE if own in TYPE_3 else ''}"
    )
    print_table(f"designed loops{said}", heads, loops)
    law, track = c.drive.injection.tracking, gains.loops.get("tracking")
    if gains.published and track:
        print_prose(
            f"The tracking loop has the gains that '{law}' publishes, with an integral time of "
            f"kp/ki = {track.kp / track.ki:.3g} s; its bandwidth here is its crossover. The speed "
            "loop is designed around it."
        )
    elif law != "designed":
        print_prose(
            f"tracking = '{law}' is for type 2 loops around the ripple: `{own}` keeps "
            "its designed gains."
        )
    if own in KALMAN:
        print_prose(
            f"`{own}` has no tracking loop: its gain follows at each sample from the noise that it "
            "assumes, so it has no fixed bandwidth and no margins."
        )


def print_simulated(runs: Sequence[Run]) -> None:
    """Print how long was simulated, and what it cost."""
    seconds, cpu = sum(run.recording.t[-1] for run in runs), sum(run.cpu_seconds for run in runs)
    print_prose(f"{seconds:.3g} s simulated in {cpu:.3g} s of CPU")


def print_cautions(drive: Drive, unused: Collection[str] = ()) -> None:
    """Print what about a drive's ratings cannot be meant, and what it does not state; unused: keys
    of [drive] that the result does not depend on."""
    for text in cautions(drive):
        print_prose(f"caution: {text}")
    for text in assumed(drive, unused):
        print_prose(f"note: {text}")


def _sizes(e: ErrorDeg) -> tuple[float, float, float]:
    return (e.rms or 0.0, e.p95 or 0.0, e.max or 0.0)


def audit_content(drive: Drive, a: Audit) -> dict[str, Any]:
    """Return what `audit.json` holds beyond its header; radii in A, up to the audited one."""
    from sandbox.recordings.injection import carrier

    primitive = carrier(drive.injection, drive.converter).primitive
    ripple = drive.injection.amplitude * float(np.max(np.abs(primitive)))  # Wb
    # A/rad
    saliency = a.slope * abs(drive.motor.energy.gamma_d - drive.motor.energy.gamma_q) * ripple
    return {
        "motor": a.motor,
        "passed": a.passed,
        "radius": a.radius,
        "valid_radius": a.valid_radius,
        "min_eigenvalue": a.min_eigenvalue,
        "worst_current": a.worst_current,
        "violations": a.violations,
        "saliency_radius": a.saliency_radius,
        "torque_at_rated_current": _torque(drive),
        "rated_torque": drive.motor.rated_torque,
        "load": a.load,
        "angle_local_deg": np.degrees(a.angle_local),
        "angle_closed_deg": np.degrees(a.angle_closed),
        "relative_slope": a.slope,
        "error_per_10mA_deg": np.degrees(0.01 / saliency),
        "cautions": list(cautions(drive)),
        "provenance": drive.provenance,
    }


def _torque(drive: Drive) -> float:
    """Return the torque (N m) at rated current on q, NaN outside the valid domain."""
    from sandbox.drive.simulate import torque_at_load

    try:
        return torque_at_load(drive, 1.0)
    except PhysicsError:
        return math.nan


def print_audit(drive: Drive, a: Audit) -> None:
    """Print an audit: validity in sentences, then the cross-saturation angle against load."""
    if a.passed:
        print_prose(
            f"{a.motor}: valid up to {a.radius:.4g} A ({a.radius / a.rated_current:.0%} of rated "
            f"current); smallest eigenvalue of the Hessian {a.min_eigenvalue:.4g} 1/H at i = "
            f"({a.worst_current[0]:.3f}, {a.worst_current[1]:.3f}) A"
        )
    else:
        from model.energy import Energy

        v = a.violations[0]
        end = (
            "the energy stops being convex"
            if isinstance(drive.motor.energy, Energy)
            else "the flux map ends"
        )
        print_prose(
            f"{a.motor}: NOT valid over the audited {a.radius:.4g} A: {end} at i_d = "
            f"{v['i_d']:.4g} A, i_q = {v['i_q']:.3f} A, so it may be used up to "
            f"{a.valid_radius:.4g} A ({a.valid_radius / a.rated_current:.0%} of rated current)"
        )
    reach = min(a.saliency_radius, a.valid_radius)
    kept = "in the whole disc" if a.passed and reach >= a.radius else f"up to {reach:.4g} A"
    kept += (
        ", as far as the model is valid"
        if not a.passed and a.saliency_radius >= a.valid_radius
        else ""
    )
    print_prose(
        f"saliency L_qq - L_dd keeps its sign, so that q-null injection is feasible: {kept}"
    )
    rated = drive.motor.rated_torque
    print_prose(
        f"torque at rated current on q: {_torque(drive):.4g} N m (rated torque "
        f"{rated:.4g} N m; currents are peak)"
    )
    print_cautions(drive, ["current_noise"])
    content = audit_content(drive, a)
    heads = [
        "load %",
        "angle °,\nencoder controls",
        "angle °,\nestimate controls",
        "slope of\nthe null",
        "° per\n10 mA",
    ]
    keys = ("angle_local_deg", "angle_closed_deg", "relative_slope", "error_per_10mA_deg")
    lines = [
        [
            f"{100 * a.load[k]:+.0f}",
            *("–" if math.isnan(v) else number_text(v) for v in (content[key][k] for key in keys)),
        ]
        for k in range(0, a.load.size, 3)
    ]
    print_table("cross-saturation angle, i_d = 0", heads, lines)
    print_prose(
        "angle: error of a q-null estimator with a linear belief; slope of the null: how fast the "
        "ripple across the axis changes with the angle (1: as at zero current; near 0 the "
        "estimator loses the rotor); ° per 10 mA: error that 10 mA of unwanted ripple across the "
        "axis make"
    )


def print_identification(result: Identification) -> None:
    """Print both fits beside the nominal values, and what there is to remark."""
    nominal = result.campaign.drive.motor
    names = list(result.fits["exact"].values)
    lines = []
    for name in names:
        cells = [name, f"{getattr(nominal, name):.5g}"]
        for fit in result.fits.values():
            low, high = fit.ci95(name) if name in fit.values else (math.nan, math.nan)
            cells.append(
                f"{fit.values[name]:.5g}\n[{low:.4g}, {high:.4g}]" if name in fit.values else "–"
            )
        lines.append(cells)
    heads = ["parameter", "nominal", *(f"{method}\n[95 % interval]" for method in result.fits)]
    print_table(f"{result.campaign.name}: identified motor (SI)", heads, lines, fixed=2)
    for name, fit in result.fits.items():
        share = "" if math.isnan(fit.misfit) else f", {fit.misfit:.3g} x what noise explains"
        print_prose(f"{name}: residual {1e3 * fit.residual_rms:.3g} mA rms{share}")
    for remark in result.remarks:
        print_prose(remark)


def print_ordinary(result: OrdinaryIdentification) -> None:
    """Print what ordinary recordings tell beside the nominal values, and what they cannot tell."""
    nominal, fit = result.campaign.drive.motor, result.fit
    lines = []
    for name, value in fit.values.items():
        low, high = fit.ci95(name)
        lines.append(
            [name, f"{getattr(nominal, name):.5g}", f"{value:.5g}\n[{low:.4g}, {high:.4g}]"]
        )
    heads = ["parameter", "nominal", "replay\n[95 % interval]"]
    print_table(f"{result.campaign.name}: identified motor (SI)", heads, lines, fixed=2)
    for name, why in fit.untold.items():
        print_prose(f"cannot tell {name}: {why}")
    print_prose(
        f"replay: residual {1e3 * fit.residual_rms:.3g} mA rms, {fit.misfit:.3g} x what "
        "noise explains"
    )
    apart = ", ".join(f"{name} = {fit.nuisance[name]:.3g}" for name in fit.apart)
    print_prose(
        f"fitted beside: {len(fit.nuisance)} values of what every drive has (identify.json); apart "
        f"from usual: {apart or 'none'}"
    )
    for remark in result.remarks:
        print_prose(remark)


def print_maps(m: Maps) -> None:
    """Print what the maps show: values at zero and rated current, their range, and where first
    order errs."""
    content = m.summary()
    rows = []
    errs = content["first_order_error_l_dd"] is not None  # of a flux map there is no first order
    for name, unit, factor, values in m.shown():
        middle, rated = m.at(values, 0.0), m.at(values, m.rated_current)
        least, most = float(np.nanmin(values)), float(np.nanmax(values))
        error = content.get(f"first_order_error_{name}")
        cells = [middle, rated, least, most, *[math.nan if error is None else error] * errs]
        nothing = ROUNDING * max(abs(least), abs(most))
        label = f"{LABELS.get(name, name)}{f' ({unit})' if unit else ''}"
        rows.append([label, *(_cell(factor * v, factor * nothing) for v in cells)])
    valid = 100.0 * (content["valid_share"] or 0.0)
    title = f"{m.motor}: over i_d and i_q up to ±{m.i_d[-1]:.4g} A, {valid:.3g} % of it valid"
    heads = [
        "what injection sees",
        "at zero\ncurrent",
        "at rated\ni_q",
        "least",
        "most",
        *["first order\nerrs by ≤"] * errs,
    ]
    print_table(title, heads, rows)
    turned = ""
    if float(np.nanmax(np.abs(m.angle))) > 0.25 * math.pi:
        turned = "; beyond 45° L_qq - L_dd has the other sign, and it loses the rotor"
    print_prose(
        "angle: error of a q-null estimator with a linear belief"
        f"{turned}; gain: slope of its null relative to zero current"
    )


def _cell(value: float, nothing: float) -> str:
    """Return a value as a table has it; what is no more than rounding leaves of nothing is 0."""
    return "–" if math.isnan(value) else f"{0.0 if abs(value) <= nothing else value:.4g}"


LABELS = {"l_dd": "L_dd", "l_dq": "L_dq", "l_qq": "L_qq"}
# of a map's largest value: Newton's iterations leave 1e-12 of the flux, two symmetric halves of a
# map cancel to that; the table shows four digits
ROUNDING = 1e-9
