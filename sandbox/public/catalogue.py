"""What there is, by name: listed from the files themselves, so that nothing is compiled to list
it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from model.errors import BadInput

if TYPE_CHECKING:
    from estimators.contract import Estimator


def list_motors() -> dict[str, str]:
    """Return the motors that come with the package: name and one line each.

    Returns
    -------
    dict of str to str

    Examples
    --------
    >>> from sandbox import list_motors
    >>> "ipm_exchanged" in list_motors()
    True
    """
    from model.drive_files import describe as line_of
    from model.drive_files import mapped_names, motor_names

    return {name: line_of(name) for name in (*motor_names(), *mapped_names())}


def list_scenarios() -> dict[str, str]:
    """Return the scenarios that come with the package: name and one line each.

    Returns
    -------
    dict of str to str

    Examples
    --------
    >>> from sandbox import list_scenarios
    >>> list(list_scenarios())
    ['creep_reversal', 'speed_steps', 'staircase']
    """
    from sandbox.drive.scenario import load_scenario, scenario_names

    return {name: load_scenario(name).description for name in scenario_names()}


def list_estimators() -> dict[str, str]:
    """Return the estimators that come with the package, the usual one first: name and one line
    each.

    Returns
    -------
    dict of str to str

    Examples
    --------
    >>> from sandbox import list_estimators
    >>> list(list_estimators())[0]
    'qnull'
    """
    from estimators.registry import summaries

    return summaries()


def list_effects() -> dict[str, str]:
    """Return the effects that a plant may have and the model lacks: name, subsystem and one line
    each.

    Returns
    -------
    dict of str to str

    Examples
    --------
    >>> from sandbox import list_effects
    >>> list_effects()["dead_time"].partition(":")[0]
    'inverter'
    """
    from model.effects.adopt import inherit
    from model.effects.library import effect_names, load_effect

    inherit()
    cards = map(load_effect, effect_names())
    return {card.name: f"{card.subsystem}: {card.summary}" for card in cards}


def list_datasets() -> dict[str, str]:
    """Return the data sets of others that can be fetched: name and one line each.

    Returns
    -------
    dict of str to str

    Examples
    --------
    >>> from sandbox import list_datasets
    >>> "thor_fea" in list_datasets()
    True
    """
    from model.datasets import catalogue

    return dict(catalogue())


def list_presets() -> dict[str, str]:
    """Return the programs whose logs are known by name, for `preset` of `diagnose`, `check` and
    `identify`.

    Returns
    -------
    dict of str to str

    Examples
    --------
    >>> from sandbox import list_presets
    >>> "odrive" in list_presets()
    True
    """
    from sandbox.recordings.formats.presets import preset_line, preset_names

    return {name: preset_line(name) for name in preset_names()}


def list_tests() -> dict[str, str]:
    """Return the tests of the protocol, for `tests` of `protocol`: name and one line each.

    Returns
    -------
    dict of str to str

    Examples
    --------
    >>> from sandbox import list_tests
    >>> list(list_tests())[:3]
    ['start', 'static_map', 'load_step']
    """
    from sandbox.evaluation.protocol_names import LINES

    return dict(LINES)


def describe(name: str) -> str:
    """Return the card of an effect, an estimator, a motor or a scenario as text.

    Parameters
    ----------
    name : str
        Of an effect: equation, source, parameters with units and bounds, what it is confused with.
        Of an estimator: injection, delay, speeds, source, and the cost of a step in ns, measured
        now. Of a motor or a scenario: the numbers of its file.

    Returns
    -------
    str

    Raises
    ------
    BadInput
        For an unknown name, with the nearest one.

    Examples
    --------
    >>> from sandbox import describe
    >>> "dead_time.time" in describe("dead_time")
    True
    """
    from estimators.registry import estimator_names
    from model.drive_files import mapped_names, motor_names
    from model.effects.adopt import inherit
    from model.effects.library import card_text, effect_names, load_effect
    from model.errors import unknown
    from sandbox.drive.scenario import scenario_names

    inherit()
    if name in effect_names():
        return card_text(load_effect(name))
    if name in estimator_names():
        return _estimator_card(name)
    if name in (motors := [*motor_names(), *mapped_names()]):
        return motor_card(name)
    if name in scenario_names():
        return scenario_card(name)
    known = (*effect_names(), *estimator_names(), *motors, *scenario_names())
    raise unknown("effect, estimator, motor or scenario", name, known)


def card_of(kind: str, name: str) -> str:
    """Return a card of one kind: 'effects', 'estimators', 'motors' or 'scenarios'; BadInput where
    the name is not of that kind."""
    from estimators.registry import estimator_names
    from model.drive_files import mapped_names, motor_names
    from model.effects.adopt import inherit
    from model.effects.library import effect_names
    from model.errors import unknown
    from sandbox.drive.scenario import scenario_names

    inherit()
    motors = [*motor_names(), *mapped_names()]
    kinds = {
        "effects": effect_names(),
        "estimators": estimator_names(),
        "motors": motors,
        "scenarios": scenario_names(),
    }
    known = kinds.get(kind)
    if known is None:
        raise BadInput(
            f"'{kind}' have no cards; {', '.join(f'`list {k} NAME`' for k in kinds)} print one"
        )
    if name not in known:
        raise unknown(kind.removesuffix("s"), name, known)
    return describe(name)


def motor_card(name: str) -> str:
    """Return what the file of a motor of the package states, as lines a person can read; nothing is
    downloaded."""
    from dataclasses import fields

    from model.drive_files import motor_file
    from model.effects.library import entry
    from model.given import read_toml
    from model.parameters import Converter, Injection, Motor

    data = read_toml(motor_file(name))
    rows = [entry(f"{name}:", str(data["motor"]["description"]), 2), ""]
    for kind, table in ((Motor, "motor"), (Converter, "drive"), (Injection, "injection")):
        units = {f.name: f.metadata.get("unit", "") for f in fields(kind)}
        stated = {k: v for k, v in data.get(table, {}).items() if k not in ("name", "description")}
        rows += [entry(k, f"{v} {units.get(k, '')}".rstrip(), 22) for k, v in stated.items()]
    if "flux_map" in data:
        rows.append(
            entry(
                "flux map",
                f"data set '{data['flux_map'].get('dataset', data['flux_map'].get('file'))}'",
                22,
            )
        )
    if source := data.get("provenance", {}).get("source"):
        rows.append(entry("source", str(source), 22))
    return "\n".join(rows)


def scenario_card(name: str) -> str:
    """Return what a scenario of the package asks for, stretch by stretch, as lines a person can
    read."""
    from model.effects.library import entry
    from sandbox.drive.scenario import load_scenario

    s = load_scenario(name)
    rows = [entry(f"{name}:", s.description, 2), ""]
    rows += [entry("rotor", f"{s.rotor}, {s.reference} controlled", 22)]
    rows += [
        entry(
            "lasts",
            f"{s.duration:g} s, and starting up before" if s.start_up else f"{s.duration:g} s",
            22,
        )
    ]
    for k, x in enumerate(s.segments, 1):
        texts = [f"{x.duration:g} s", f"load {100.0 * x.load:g} %"]
        texts += [f"i_d {100.0 * x.current_d:g} %"] * bool(x.current_d)
        texts += [f"speed {100.0 * x.speed:g} % of rated"] * (s.rotor != "locked")
        texts += [f"reached in {x.ramp:g} s"] * bool(x.ramp)
        texts += [
            f"the last {x.duration - s.settle_of(x):.3g} s count" if x.score else "not evaluated"
        ]
        rows.append(entry(f"stretch {k}", ", ".join(texts), 22))
    return "\n".join(rows)


def _estimator_card(name: str) -> str:
    """Return an estimator's card; the cost of a step is measured here and now."""
    from estimators.registry import load_estimator
    from model.drive_files import load_drive
    from sandbox.evaluation.protocol_names import BELIEFS
    from sandbox.evaluation.step_cost import cost

    e, motor = load_estimator(name), "ipm_exchanged"
    prices = [
        f"{belief} {cost(load_drive(motor), name, belief, 0)['step_ns']:.0f}" for belief in BELIEFS
    ]
    said = (
        f"{', '.join(prices)} ns a step, measured now on "
        f"{motor}{'' if e.compiled else ' (in Python)'}"
    )
    return estimator_card_text(e, said)


def estimator_card_text(e: Estimator, cost: str) -> str:
    """Return an estimator's card as lines a person can read; cost: what a step costs, in words."""
    from model.effects.library import entry

    rows = [
        ("injection", e.injection),
        ("delay", e.delay),
        ("speeds", e.speeds),
        ("cost", cost),
        ("source", e.source),
    ]
    return "\n".join(
        [entry(f"{e.name}:", e.summary, 2), "", *(entry(head, text, 11) for head, text in rows)]
    )
