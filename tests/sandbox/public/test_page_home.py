"""At home among Python's tools: type checkers, shells, notebooks, xarray, a C compiler."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

import sandbox
from sandbox.cli import main
from sandbox.cli.application import application
from tests.sandbox.public.naming import ROOT, of

TYPED = """
from pathlib import Path
from typing import assert_type

import sandbox
from sandbox import Estimate, Estimator, Scenario, Segment, compare, simulate

scene = Scenario("mine", (Segment(0.3), Segment(0.5, load=1.2)))
run = simulate("ipm_exchanged", scene, "ekf", belief="linear")
assert_type(run.error_deg.mean, float | None)
assert_type(sandbox.load_motor("ipm").motor.rated_current, float)
assert_type(sandbox.__version__, str)
assert_type(compare("ipm").save("folder"), Path)
simulate("ipm", duration="long")
simulate("ipm", estimater="ekf")
"""


def test_a_type_checker_reads_a_script(tmp_path):
    """A script beside an installed package: its types are found by `py.typed`, two mistakes are
    told.  Without the libraries that ours uses, whose types no call of the page has."""
    (tmp_path / "mine.py").write_text(TYPED)
    for name in ("sandbox", "model", "estimators"):  # as pip would install them
        (tmp_path / "site").mkdir(exist_ok=True)
        (tmp_path / "site" / name).symlink_to(ROOT / name)
    around = {**os.environ, "MYPYPATH": "", "PYTHONPATH": str(tmp_path / "site")}
    call = [sys.executable, "-m", "mypy", "--config-file=", "--cache-dir", str(tmp_path / "cache")]
    call += ["--python-executable", str(python_with(tmp_path)), "mine.py"]
    said = subprocess.run(call, cwd=tmp_path, env=around, capture_output=True, text=True).stdout
    told = [line for line in said.splitlines() if ": error: " in line]
    assert len(told) == 2, said
    assert 'Argument "duration" to "simulate" has incompatible type "str"' in told[0]
    assert 'Unexpected keyword argument "estimater"' in told[1]
    assert "py.typed" not in said


def python_with(folder: Path) -> Path:
    """Return a Python of its own whose packages are those of a folder."""
    subprocess.run(
        [sys.executable, "-m", "venv", "--without-pip", str(folder / "venv")], check=True
    )
    (place,) = (folder / "venv" / "lib").glob("python*/site-packages")
    (place / "more.pth").write_text(str(folder / "site"))
    return folder / "venv" / "bin" / "python"


def test_the_version_is_that_of_the_installation(capsys):
    assert sandbox.__version__ == version("sensorless-sandbox")
    for call in (["-V"], ["--version"]):
        assert main(call) == 0
        assert capsys.readouterr().out == f"sensorless {sandbox.__version__}\n"
    for module in ("sandbox", "sandbox.cli"):
        done = subprocess.run(
            [sys.executable, "-m", module, "-V"], cwd=ROOT, capture_output=True, text=True
        )
        assert done.stdout == f"sensorless {sandbox.__version__}\n"


CASES = {
    "several": (["sensorless", "compare", "--estimators", "qnull,inv"], {"qnull,inversion"}),
    "commands": (["sensorless", "com"], {"compare", "completion"}),
    "options": (["sensorless", "simulate", "--sce"], {"--scenario"}),
    "choices": (["sensorless", "simulate", "--belief", "l"], {"linear"}),
    "motors": (["sensorless", "simulate", "--motor", "spm_"], {"spm_exchanged"}),
    "estimators": (["sensorless", "compare", "--estimator", "qn"], {"qnull"}),
    "cards": (["sensorless", "list", "effects", "dead"], {"dead_time"}),
}
# what makes a shell complete: evaluated, or installed for every new shell, also where a file leaves
# it off
START = {
    "bash": {"evaluated": 'eval "$(sensorless completion bash)"\n', "installed": ""},
    "zsh": {
        "evaluated": 'autoload -Uz compinit && compinit -u\neval "$(sensorless completion zsh)"\n',
        "installed": "",
        "installed before": "autoload -Uz compinit && compinit -u\n",
    },
}
REPORT = {  # Ctrl-] writes the line that is being typed, whole or not at all
    "bash": "report() {{ printf '%s\\n' \"$READLINE_LINE\" > {0}/part; mv {0}/part {0}/line; }}; "
    "bind -x '\"\\C-]\": report'\n",
    "zsh": 'report() {{ print -r -- "$BUFFER" > {0}/part; mv {0}/part {0}/line }}; '
    "zle -N report; bindkey '^]' report\n",
}


@pytest.fixture(scope="module")
def shell(tmp_path_factory):
    """Give an environment in which `sensorless` is this project's."""
    place = tmp_path_factory.mktemp("bin")
    program = place / "sensorless"
    program.write_text(f'#!/bin/sh\nPYTHONPATH="{ROOT}" exec "{sys.executable}" -m sandbox "$@"\n')
    program.chmod(0o755)
    return {**os.environ, "PATH": f"{place}{os.pathsep}{os.environ['PATH']}", "HOME": str(place)}


@pytest.mark.parametrize(("kind", "how"), [(kind, how) for kind in START for how in START[kind]])
def test_a_shell_completes(kind, how, shell, tmp_path, monkeypatch, capsys):
    """A shell of its own behind a pseudo terminal: words, then a tab; the line it then has."""
    if shutil.which(kind) is None:
        pytest.skip(f"no {kind}")
    file = tmp_path / f".{kind}rc"
    file.write_text(START[kind][how])
    around = {**shell, "HOME": str(tmp_path), "ZDOTDIR": str(tmp_path), "TERM": "dumb"}
    if how != "evaluated":
        for name in ("HOME", "ZDOTDIR"):
            monkeypatch.setenv(name, str(tmp_path))
        for _ in range(2):
            assert main(["completion", kind, "--install"]) == 0
        assert (
            file.read_text().count(
                "completion of sensorless" if kind == "zsh" else "# Load sensorless"
            )
            == 1
        )
    file.write_text(file.read_text() + REPORT[kind].format(tmp_path) + f"touch {tmp_path}/ready\n")
    # all answers in one shell
    cases = list(CASES.values())[: None if (kind, how) == ("bash", "evaluated") else 1]
    lines = typed(kind, around, tmp_path, [" ".join(words) for words, _ in cases])
    for (words, wanted), line in zip(cases, lines, strict=True):
        assert line.split()[:-1] == words[:-1]
        found = line.split()[-1]
        assert all(w.startswith(found) for w in wanted), line
        assert len(found) >= len(words[-1]), line
        assert len(wanted) > 1 or {found} == wanted, line


def typed(kind: str, around: dict[str, str], place: Path, lines: list[str]) -> list[str]:
    """Return what lines, each with a tab, become in an interactive shell."""
    import pty

    pid, terminal = pty.fork()
    if pid == 0:
        os.execvpe(kind, [kind, "-i"], around)
    try:
        wait_for(place / "ready", pid)
        time.sleep(0.5)
        found = []
        for line in lines:
            os.write(terminal, line.encode() + b"\t\x1d")
            wait_for(place / "line", pid)
            found.append((place / "line").read_text())
            (place / "line").unlink()
            os.write(terminal, b"\x15")  # Ctrl-U: an empty line
        return found
    finally:
        os.close(terminal)
        os.kill(pid, 9)
        os.waitpid(pid, 0)


def wait_for(path: Path, pid: int) -> None:
    """Wait, as long as a machine that does other things takes, until a child that runs has written
    a file."""
    while not path.exists():
        assert os.waitpid(pid, os.WNOHANG) == (0, 0), f"the shell ended without {path}"
        time.sleep(0.05)


@pytest.mark.parametrize("kind", ["bash", "zsh", "fish", "powershell"])
def test_scripts_for_shells(kind, capsys):
    assert main(["completion", kind]) == 0
    said = capsys.readouterr().out
    assert "compare" in said
    if shutil.which(kind) and kind != "powershell":
        subprocess.run([kind, "-n"], input=said, text=True, check=True)


def test_completion_installed(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert main(["completion", "bash", "--install"]) == 0
    (file,) = [p for p in tmp_path.rglob("sensorless") if p.is_file()]
    assert "compare" in file.read_text()
    assert str(file) in capsys.readouterr().out.replace("\n", "")


def test_a_run_and_maps_as_xarray(run):
    found = run.to_xarray()
    assert found.i_a.dims == ("t",)
    assert found.i_a.attrs["units"] == "A"
    np.testing.assert_array_equal(found.i_a.values, run.recording.i_a)
    np.testing.assert_array_equal(found.t.values, run.recording.t)
    plane = sandbox.maps("ipm_exchanged", points=5)
    found = plane.to_xarray()
    assert dict(found.sizes) == {"i_d": 5, "i_q": 5}
    np.testing.assert_array_equal(found.l_dd.values, plane.maps.l_dd)  # first axis i_d
    np.testing.assert_array_equal(found.i_q.values, plane.maps.i_q)
    rows = sandbox.audit("ipm_exchanged").to_xarray()
    assert rows["load"].dims == ("row",)


def test_a_notebook_shows_figure_and_table(run):
    text = sandbox.audit("ipm_exchanged")._repr_html_()
    assert "valid up to" in text
    assert 'src="data:image/png;base64,' in text
    assert "<th>angle_local_deg (deg)</th>" in text
    assert "<table>" in run._repr_html_()
    without = sandbox.export_estimator("qnull")._repr_html_()  # neither figure nor table
    assert "<table>" not in without
    assert "qnull for ipm_exchanged" in without


def test_a_result_is_shown(run, monkeypatch):
    opened = []
    monkeypatch.setattr(
        "sandbox.public.showing.show",
        lambda place: opened.append(sorted(os.listdir(place))) or "opened",
    )
    assert sandbox.audit("ipm_exchanged").show() == "opened"
    assert opened == [["audit.json", "audit.parquet", "audit.png"]]


@of("get_include")
def test_an_estimator_in_c_is_built_by_the_line_that_is_told(tmp_path, capsys):
    """The same line in the tutorial, the README and the header; it builds the example from
    anywhere."""
    line = 'cc -std=c99 -O2 -fPIC -shared -I "$(sensorless include)" -o mine.so mine.c -lm'
    places = (
        "docs/tutorials/plot_7_estimator.py",
        "estimators/c/README.md",
        "estimators/c/sensorless_estimator.h",
    )
    assert [line in (ROOT / p).read_text() for p in places] == [True] * 3
    assert main(["include"]) == 0
    folder = capsys.readouterr().out.strip()
    assert folder == sandbox.get_include()
    if shutil.which("cc") is None:
        pytest.skip("no C compiler")
    shutil.copy(Path(folder) / "examples" / "smallest.c", tmp_path / "mine.c")
    command = line.replace("$(sensorless include)", folder)
    subprocess.run(command, shell=True, cwd=tmp_path, check=True)
    assert sandbox.load_estimator_library(tmp_path / "mine.so").name


@of("compiled", "compiled_step")
def test_a_compiled_estimator_is_written_with_the_page_alone(tmp_path):
    """One that says what it was told, as in Python: the angle of a locked rotor."""
    (tmp_path / "own.py").write_text(
        "import numpy as np\n"
        "from sandbox import Estimate, Estimator, compiled, compiled_step\n"
        "@compiled\n"
        "def kept(state):\n"
        "    return state[0]\n"
        "@compiled_step\n"
        "def step(state, sample, belief, tuning):\n"
        "    return Estimate(kept(state), 0.0, kept(state), 0.0, 1.0, 0.0, 0.0, 0.0)\n"
        "def init(belief, tuning, angle=None):\n"
        "    return np.array([angle or 0.0])\n"
        'ESTIMATOR = Estimator("own", "keeps what it was told", init, step, injection="none")\n'
    )
    still = sandbox.Scenario("still", (sandbox.Segment(0.02),), start_up=False)
    found = sandbox.simulate("ipm", still, tmp_path / "own.py", closed_loop=False)
    assert found.error_deg.max == pytest.approx(0.0, abs=1e-9)
    assert sandbox.load_estimator(tmp_path / "own.py").compiled


def test_completion_needs_no_compiler():
    """Names of estimators, which a shell asks for at each tab, bring in nothing heavy."""
    code = (
        "import sys; from sandbox.cli import main; main(['__complete', 'compare', "
        "'--estimator', '']);"
    )
    code += "print('numba' in sys.modules, 'matplotlib' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "False False"
    assert "ekf_filterpy" in done.stdout
    assert application().name == ("sensorless",)
