"""Pages that lie elsewhere in the repository, beside what they describe: taken over, their links
turned."""

from __future__ import annotations

import os
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES = {  # page of the documentation (below docs/): file of the repository
    "reference/made/what_to_record": "sandbox/recordings/RECORDING.md",
    "reference/made/recordings": "sandbox/recordings/IMPORTING.md",
    "reference/made/recordings_checked": "sandbox/recordings/CHECKING.md",
    "reference/made/sweeps": "sandbox/evaluation/sweep/README.md",
    "reference/made/estimators_in_c": "estimators/c/README.md",
    "reference/made/drive_in_c": "sandbox/drive/export/README.md",
    "reference/made/nomenclature": "model/NOMENCLATURE.md",
    "results/made/estimators": "estimators/README.md",
    "results/made/estimator_limits": "estimators/LIMITS.md",
    "results/made/estimator_constants": "estimators/CONSTANTS.md",
    "results/made/estimator_protocol": "experiments/results/estimator_protocol.md",
    "results/made/c_estimators": "experiments/results/c_estimators.md",
    "results/made/modulated_drives": "experiments/results/modulated_drives.md",
    "results/made/peer_table": "experiments/results/peer_table.md",
    "results/made/injection_costs": "experiments/results/injection_costs.md",
    "results/made/main_job_ipm": "experiments/results/main_job_ipm.md",
    "results/made/main_job_ipm_exchanged": "experiments/results/main_job_ipm_exchanged.md",
    "results/made/main_job_spm_exchanged": "experiments/results/main_job_spm_exchanged.md",
    "results/made/effects_on_position": "experiments/results/effects_on_position.md",
    "results/made/tolerances": "experiments/results/tolerances/README.md",
    "results/made/gain_left": "experiments/results/gain_left.md",
    "results/made/yield": "experiments/results/yield/README.md",
    "results/made/own_effects": "experiments/results/own_effects.md",
    "results/made/several_orders": "experiments/results/several_orders.md",
    "results/made/odrive_cogging": "experiments/results/odrive_cogging.md",
    "results/made/other_simulator": "experiments/results/other_simulator.md",
    "results/made/peak_error": "experiments/results/peak_error.md",
    "results/made/real_cases": "experiments/results/real_cases.md",
    "results/made/identify_practice": "experiments/results/identify_practice.md",
    "results/made/against_bench": "experiments/results/plant/against_bench.md",
    "results/made/order": "experiments/results/plant/order.md",
    "results/made/energy": "experiments/results/plant/energy.md",
    "results/made/withheld": "experiments/results/withheld/README.md",
    "results/made/practice": "experiments/results/diagnosis/practice.md",
    "results/made/experiments": "experiments/README.md",
    "explanation/made/walks": "sandbox/WALKS.md",
    "explanation/made/diagnosis_in_detail": "sandbox/gap/README.md",
    "explanation/made/withheld_check": "sandbox/withheld/README.md",
}
TITLES = {  # of files that begin without one
    "results/made/main_job_ipm": "Position error: ipm",
    "results/made/main_job_ipm_exchanged": "Position error: ipm_exchanged",
    "results/made/main_job_spm_exchanged": "Position error: spm_exchanged",
    "results/made/effects_on_position": "Effects on position",
    "results/made/withheld": "Check on withheld effects",
    "results/made/practice": "Diagnoses of practice recordings",
    "results/made/odrive_cogging": "An ODrive's log without voltages",
    "results/made/real_cases": "Real drives, diagnosed",
    "results/made/own_effects": "Effects of one's own, diagnosed",
    "results/made/identify_practice": "Motors identified from practice recordings",
}
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\((?!https?:)([^)\s]*)\)")


def turned(match: re.Match[str], source: Path, page: str) -> str:
    """Return a link or picture as it has to be on a page; what is no page becomes the name of its
    file."""
    picture, said, target = match[1], match[2], match[3]
    if target.startswith("#") and not picture:
        return said
    file = Path(os.path.normpath(source.parent / target.partition("#")[0]))
    here = ROOT / "docs" / Path(page).parent
    if picture:
        return f"![{said}]({os.path.relpath(file, here)})"
    relative = file.relative_to(ROOT).as_posix() if file.is_relative_to(ROOT) else target
    if relative.startswith("docs/") and file.suffix == ".md":
        return f"[{said}]({os.path.relpath(file, here)})"
    if relative.startswith("docs/tutorials/plot_"):
        return f"[{said}]({os.path.relpath(ROOT / 'docs' / 'gallery' / file.name, here).removesuffix('.py')}.rst)"
    for name, own in PAGES.items():
        if own in (relative, f"{relative}/README.md"):
            return f"[{said}]({os.path.relpath(ROOT / 'docs' / name, here)}.md)"
    plain = said.replace("`", "")
    return f"`{relative}`" if plain in relative else f"{said} (`{relative}`)"


def page(name: str) -> str:
    """Return a page's text."""
    source = ROOT / PAGES[name]
    text = re.sub(r"<!--.*?-->\n?", "", source.read_text(encoding="utf-8"), flags=re.S)
    parts = re.split(r"(^```.*?^```$)", text, flags=re.S | re.M)  # links in code stay
    text = "".join(
        p if p.startswith("```") else LINK.sub(lambda m: turned(m, source, name), p) for p in parts
    )
    if not re.match(r"\s*# ", text):
        said = TITLES.get(name, Path(PAGES[name]).stem.replace("_", " ").capitalize())
        text = f"# {said}\n\n{text.lstrip()}"
    return text
