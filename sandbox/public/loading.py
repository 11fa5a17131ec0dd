"""Names, files or objects in, objects out: motors, scenarios, estimators, campaigns."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from estimators.registry import AnyEstimator, check_known
from estimators.registry import load_estimator as registered
from estimators.registry import load_estimator_library as registered_library
from model.drive_files import fetched, load_drive
from model.effects.adopt import adopt, inherit
from model.errors import BadInput
from model.parameters import Drive
from sandbox.drive import scenario as scenarios
from sandbox.drive.scenario import Scenario
from sandbox.recordings import importing, motion_log
from sandbox.recordings.campaign import ROTORS, Campaign
from sandbox.recordings.findings import Doubt, Finding, Unanswered
from sandbox.recordings.motion_log import MotionCampaign

if TYPE_CHECKING:
    from estimators.contract import Estimator

AnyCampaign = str | Path | Campaign
inherit()  # effects of other packages: before anything is compiled


def use_effects(file: str | Path) -> tuple[str, ...]:
    """Add effects of your own to the library, before the first run or replay of the process.

    Parameters
    ----------
    file : str or Path
        A Python file whose tuple `EFFECTS` holds cards with equations at ports of the plant
        (`model.effects.card`).

    Returns
    -------
    tuple of str
        The names added; simulations, replays and diagnoses know them from now on.

    Raises
    ------
    BadInput
        For a file that cannot be read, a card without an equation, a name that is taken, or if the
        plant has been compiled already.

    Examples
    --------
    >>> from sandbox import use_effects
    >>> use_effects("my_effects.py")  # doctest: +SKIP
    ('fan', 'resolver')
    """
    return tuple(card.name for card in adopt(file))


def load_motor(motor: str | Path | Drive = "ipm_exchanged") -> Drive:
    """Return a motor with its converter and its injection.

    Parameters
    ----------
    motor : str, Path or Drive
        A name of `list_motors`, a TOML file (`[motor]`, `[drive]`, `[injection]`), a flux map with
        a TOML file of the same name beside it, or a drive, which is returned as it is.

    Returns
    -------
    Drive
        `.motor` (ohm, H, Wb, A peak, N m, rpm), `.converter` (s, V, A), `.injection` (Hz, V),
        `.provenance`.

    Raises
    ------
    BadInput
        For an unknown name (with the nearest one), or a value out of its range.

    Examples
    --------
    >>> from sandbox import load_motor
    >>> load_motor("ipm_exchanged").motor.rated_current  # A, peak
    1.2
    """
    if isinstance(motor, Drive):
        return motor
    return load_drive(_text(motor, "motor", "a Drive"))


def load_scenario(scenario: str | Path | Scenario = "staircase") -> Scenario:
    """Return a scenario: what load and speed are asked for, segment by segment.

    Parameters
    ----------
    scenario : str, Path or Scenario
        A name of `list_scenarios`, a TOML file, or a scenario, which is returned as it is.

    Returns
    -------
    Scenario
        `.segments` (durations and ramps in s, load as a share of rated current, speed as a share of
        rated speed).

    Raises
    ------
    BadInput
        For an unknown name (with the nearest one), or a value out of its range.

    Examples
    --------
    >>> from sandbox import Scenario, Segment, load_scenario
    >>> load_scenario("staircase").rotor
    'locked'
    >>> Scenario("mine", (Segment(0.3), Segment(0.5, load=1.2, ramp=0.1))).duration  # s
    0.8
    """
    if isinstance(scenario, Scenario):
        return scenario
    return scenarios.load_scenario(_text(scenario, "scenario", "a Scenario"))


def load_estimator(estimator: AnyEstimator = "qnull") -> Estimator:
    """Return an estimator.

    Parameters
    ----------
    estimator : str, Path or Estimator
        A name of `list_estimators`, a Python file that defines `ESTIMATOR`, a shared library (see
        `load_estimator_library`), or an estimator, which is returned as it is. A file is run: only
        take one that you trust.

    Returns
    -------
    Estimator
        `.init` and `.step`, its name and its card.

    Raises
    ------
    BadInput
        For an unknown name (with the nearest one), a file that cannot be run or defines no
        `ESTIMATOR`, and an estimator of one's own that bears a built-in one's name.

    Examples
    --------
    >>> from sandbox import load_estimator
    >>> load_estimator("ekf_filterpy").compiled
    False
    """
    if not isinstance(estimator, (str, Path)):
        from estimators.contract import Estimator

        if not isinstance(estimator, Estimator):
            _text(estimator, "estimator", "an Estimator")
    return registered(estimator)


def load_estimator_library(path: str | Path) -> Estimator:
    """Return an estimator written in C (or anything that calls like it), run in the compiled loop
    at full speed.

    Parameters
    ----------
    path : str or Path
        A shared library with the functions of `estimators/c/sensorless_estimator.h`, in float or
        double (estimators/c/README.md). Its code is run: only take one that you trust.

    Returns
    -------
    Estimator
        For `simulate`, `compare` and `protocol`; the same object again while the file is the same.

    Raises
    ------
    BadInput
        For a file that does not exist or is no library, a function that is missing, a library for
        another version of the interface, or a state of an impossible size.

    Examples
    --------
    >>> from sandbox import load_estimator_library, simulate
    >>> simulate("ipm_exchanged", "staircase", load_estimator_library("mine.so"))  # doctest: +SKIP
    <SimulationResult: mine saturated, ipm_exchanged, staircase, ...>
    """
    if not isinstance(path, (str, Path)):
        _text(path, "estimator library", "a library")
    return registered_library(path)


def read_campaign(
    folder: AnyCampaign,
    columns: str | Path | None = None,
    rotors: Sequence[str] = ROTORS,
    *,
    preset: str | None = None,
) -> Campaign:
    """Return the recordings of a folder with the drive's nominal model.

    Parameters
    ----------
    folder : str, Path or Campaign
        A folder with `campaign.toml` and its tables (Parquet, CSV and others, see
        sandbox/recordings/IMPORTING.md), one table in it, or a campaign, which is returned as it
        is.
    columns : str or Path, optional
        A TOML file that maps names and units of another program (sandbox/recordings/IMPORTING.md).
    rotors : sequence of str
        Which recordings to read: 'locked', 'driven', 'free'.
    preset : str, optional
        A program whose column names and units are known (`list_presets`), beside or instead of
        `columns`.

    Returns
    -------
    Campaign
        `campaign["file"]` is a recording, `campaign["file"]["i_a"]` a column (n,), `.to_pandas()` a
        data frame. Times in s, currents in A, voltages in V, angles in electrical rad, torques in N
        m.

    Raises
    ------
    BadInput
        Names the file, column, row or key that is wrong.

    Examples
    --------
    >>> import tempfile
    >>> from sandbox import Scenario, Segment, read_campaign, simulate
    >>> short = Scenario("short", (Segment(0.05),), start_up=False)
    >>> with tempfile.TemporaryDirectory() as place:
    ...     _ = simulate("ipm_exchanged", short, record=f"{place}/bench")
    ...     campaign = read_campaign(f"{place}/bench")
    >>> campaign["short"]["i_a"].shape
    (200,)
    """
    if isinstance(folder, Campaign):
        return folder
    place, mapped = (
        Path(_text(folder, "campaign", "a Campaign")),
        None if columns is None else Path(columns),
    )
    asked = (place, mapped, preset, tuple(rotors))
    try:
        campaign = importing.read_recordings(place, mapped, tuple(rotors), preset)
    except BadInput as error:
        raise _cause(asked, error) from None
    _refuse_exchanged(asked, [f for f in campaign.findings if isinstance(f, Unanswered)])
    return campaign


Asked = tuple[Path, Path | None, str | None, tuple[str, ...]]  # of `importing.source_of`


def _cause(asked: Asked, error: BadInput) -> BadInput:
    """Return a refusal, by columns that are exchanged where these are its cause."""
    from sandbox.public.campaigns.exchanged import put_right

    try:
        return put_right(importing.source_of(*asked), error)
    except BadInput:
        return error


def _refuse_exchanged(asked: Asked, found: Sequence[Finding]) -> None:
    """Raise BadInput where what is doubted comes of columns that are exchanged."""
    if found:
        from sandbox.public.campaigns.exchanged import refuse_exchanged

        refuse_exchanged(importing.source_of(*asked), found)


def motion_only(
    folder: AnyCampaign, columns: str | Path | None, preset: str | None
) -> MotionCampaign | None:
    """Return the motion of a folder that can be judged by its motion alone, None for any other
    campaign."""
    if isinstance(folder, Campaign):
        return None
    place, mapped = (
        Path(_text(folder, "campaign", "a Campaign")),
        None if columns is None else Path(columns),
    )
    asked = (place, mapped, preset, ROTORS)
    source = importing.source_of(*asked)
    why = motion_log.motion_only(source)
    if why is None:
        return None
    from sandbox.gap.motion.checked import checked_motion

    try:
        motion = motion_log.read_motion(source, why)
        found = checked_motion(motion)
    except BadInput as error:
        raise _cause(asked, error) from None
    doubts = [f for f in (*motion.findings, *found) if isinstance(f, (Unanswered, Doubt))]
    _refuse_exchanged(asked, doubts)
    return replace(motion, findings=(*motion.findings, *found))


def ready(
    motor: str | Path | Drive,
    estimators: Iterable[AnyEstimator],
    effects: Mapping[str, float],
    scenario: Scenario | None = None,
) -> tuple[Drive, list[Estimator]]:
    """Return a motor and estimators; what is wrong with names, a motor's file or effects, and
    whether the motor's model can start up and carry a scenario's loads, is told before anything is
    compiled, and a flux map is downloaded after all else is read."""
    asked = list(estimators)
    for one in asked:
        check_known(one)
    here = isinstance(motor, Drive) or not fetched(_text(motor, "motor", "a Drive"))
    drive = load_motor(motor) if here else None
    if drive is not None and effects:
        from sandbox.plant.sets import complete

        complete(drive.motor, drive.converter, effects)
    if drive is not None and scenario is not None and not effects:
        # what effects do to the motor is looked at later
        from sandbox.drive.design import design
        from sandbox.drive.feasible import check_feasible

        # whether an estimator injects is not known before it is loaded
        check_feasible(drive, scenario, design(drive, scenario.start_up, injects=False), False)
    own = [load_estimator(one) for one in asked]  # compiles
    return load_motor(motor) if drive is None else drive, own


def several(given: Any) -> list[Any]:
    """Return one thing (a name, path or object) or several of them as a list."""
    return (
        list(given)
        if isinstance(given, Iterable) and not isinstance(given, (str, Path))
        else [given]
    )


def _text(given: object, kind: str, thing: str) -> str | Path:
    """Return a name or path; BadInput for anything else."""
    if not isinstance(given, (str, Path)):
        raise BadInput(
            f"{kind} = {given!r:.60} is neither a name nor a file nor {thing}; give one of them"
        )
    return given
