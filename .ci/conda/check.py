"""Whether the conda recipe says what pyproject.toml says: version, licence, command, Python,
dependencies, bounds.

`check.py --render` has it read by rattler-build as well (`pip install py-rattler-build`).
"""

import re
import sys
import tomllib
from pathlib import Path

HERE = Path(__file__).parent
OTHER_NAMES = {"matplotlib-base": "matplotlib"}  # as conda-forge calls it


def problems() -> list[str]:
    """Return what differs, a line each."""
    recipe = (HERE / "recipe.yaml").read_text(encoding="utf-8")
    project = tomllib.loads((HERE.parents[1] / "pyproject.toml").read_text(encoding="utf-8"))[
        "project"
    ]
    run = re.search(r"^  run:\n((?:    - .*\n)+)", recipe, re.M)
    listed = dict(line.strip(" -").split(" ", 1) for line in (run[1] if run else "").splitlines())
    python = listed.pop("python", "")
    needed = dict(
        re.fullmatch(r"([a-z0-9-]+)(.*)", line).groups() for line in project["dependencies"]
    )
    found = {OTHER_NAMES.get(name, name): bound for name, bound in listed.items()}
    command, target = next(iter(project["scripts"].items()))
    told = {
        "version": (re.search(r'^  version: "(.*)"', recipe, re.M)[1], project["version"]),
        "python": (python, project["requires-python"]),
        "license": (re.search(r"license: (.*)", recipe)[1], project["license"]),
        "command": (re.search(r"entry_points:\n +- (.*)", recipe)[1], f"{command} = {target}"),
        "summary": (re.search(r"summary: (.*)", recipe)[1], project["description"]),
        **{
            f"run {name}": (found.get(name), needed.get(name)) for name in sorted({*found, *needed})
        },
    }
    return [f"{what}: recipe {a}, pyproject.toml {b}" for what, (a, b) in told.items() if a != b]


def rendered() -> str:
    """Return name, version and build of what rattler-build makes of the recipe; it raises where
    there is a mistake."""
    from rattler_build import RenderConfig, Stage0Recipe, VariantConfig

    (only,) = Stage0Recipe.from_file(HERE / "recipe.yaml").render(VariantConfig(), RenderConfig())
    return f"{only.recipe.package.name} {only.recipe.package.version} {only.recipe.build.string}"


if __name__ == "__main__":
    if found := problems():
        sys.exit("\n".join(found))
    if "--render" in sys.argv:
        print(rendered())
