"""`dsd check`: can this log answer?"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import PurePath
from typing import TYPE_CHECKING, Annotated

import typer

from dsd_cli.cli.options import (
    CONFIG_FILE,
    ConfigOption,
    EffectsFromOption,
    Format,
    FormatOption,
    FromOption,
    QuietOption,
    SetOption,
    ToOption,
)
from dsd_cli.cli.pictures import PlotOption

if TYPE_CHECKING:
    from dsd_cli.cli.progress import Progress
    from dsd_cli.files.config import Config
    from dsd_cli.identify.checks.results import Finding
    from dsd_cli.report.plots_check import Checked

LogsArgument = Annotated[
    list[str], typer.Argument(metavar="LOG...", help="Log files (CSV, Parquet, MF4, ...); - is stdin.")
]
StrictOption = Annotated[bool, typer.Option("--strict", help="Exit 3 if a log has a finding of severity error.")]


def check(
    log: LogsArgument,
    config: ConfigOption = CONFIG_FILE,
    strict: StrictOption = False,
    plot: PlotOption = None,
    form: FormatOption = Format.TABLE,
    start: FromOption = None,
    end: ToOption = None,
    override: SetOption = None,
    effects_from: EffectsFromOption = None,
    quiet: QuietOption = False,
) -> None:
    """Say whether LOG can answer: signs, units, clock, excitation, sensor, and which values of [model] it identifies.

    Each finding names the key of the config that mends it. [signals] alone is needed; [observer] adds the checks of
    d_hat, [model] those of its values.
    """
    import sys

    from dsd_cli.cli.identification import check_logs, print_json
    from dsd_cli.cli.pictures import check_plot, put_picture
    from dsd_cli.cli.progress import Progress
    from dsd_cli.cli.user_effects import use_effects
    from dsd_cli.files.config import load_config
    from dsd_cli.report.checks import print_table, to_json

    check_logs(log, ())
    use_effects(effects_from)
    settings = load_config(config, override or ()).within(start, end)
    check_plot(plot, [config, *log, *settings.files, *(effects_from or ())])
    with Progress(not quiet) as progress:
        checked = [checked_log(path, settings, quiet, progress) for path in log]
    results = [one.result for one in checked]
    if form is Format.JSON:
        print_json(to_json(results))
    else:
        print_table(results, sys.stdout)
    if plot is not None:
        from dsd_cli.report.plots_check import draw

        put_picture(plot, lambda: draw(checked, settings.signals.units), quiet)
    failed = [result for result in results if result.errors]
    if strict and failed:
        from dsd_cli.errors import CheckFailed

        raise CheckFailed("; ".join(f"{one.log}: {one.errors[0].what}" for one in failed))


def checked_log(path: str, config: Config, quiet: bool, progress: Progress) -> Checked:
    """Read and check one log; every channel may be missing but u (and the time).

    Raises
    ------
    DataError : it cannot be read, or no usable row is in it.
    """
    from functools import partial

    from dsd_cli.cli.identification import warn
    from dsd_cli.cli.odd_values import lone_spikes, said_of_spikes, zero_offsets
    from dsd_cli.cli.plan import as_logged, log_columns, made, naming, observer_settings, reading, window
    from dsd_cli.cli.recordings import absent, believed_model, by_updates, check_sizes
    from dsd_cli.files.config.remedies import keys_that_multiply
    from dsd_cli.files.logs import load_log
    from dsd_cli.identify.checks import check_log
    from dsd_cli.report.plots_check import Checked

    config = as_logged(config, path)
    columns = log_columns(config.signals)
    optional = {name for name in columns if name not in ("t", "u")}
    with naming(path):
        loaded = load_log(path, columns, optional, **reading(config), watch=progress.watch)
    progress.clear()
    check_sizes(loaded.log.source, loaded)
    lacking = absent(config, columns, loaded)
    loaded = by_updates(loaded)
    warn(quiet, [f"{loaded.log.source}: {warning}" for warning in (*loaded.warnings, *lacking)])
    progress(f"checking {PurePath(path).name}")
    result = check_log(
        loaded.log,
        None if config.model.inertia is None else believed_model(config),
        None if config.observer is None else observer_settings(config),
        loaded.restarts,
        dropped=loaded.dropped,
        factors=config.signals.factors(),
        keys_of=partial(keys_that_multiply, config.signals),
        u_shift=config.signals.u_shift,
        maker=made(config).maker,
    ).named(config.signals.units)
    fast = _too_fast(config, result.excitation.top_speed or 0.0)
    asked = [_open_unit(config)] if config.signals.units.assumed else []
    spikes = said_of_spikes(loaded.log, lone_spikes(loaded.log))
    odd = [*fast, *zero_offsets(loaded.log, config.signals), *spikes]
    result = replace(result, findings=(*odd, *_unread(config), *result.findings, *asked))
    if window(config.signals):
        result = replace(result, findings=tuple(_widened(finding) for finding in result.findings))
    return Checked(loaded.log, tuple(loaded.restarts), result)


def _unread(config: Config) -> list[Finding]:
    """Units in the names of columns that the config leaves out: every number of the motion is off by that factor."""
    from dsd_cli.cli.unit_in_name import left_out
    from dsd_cli.identify.checks.results import Finding

    return [Finding(one.what, one.channel, "warning", 0.95, one.remedy) for one in left_out(config)]


def _open_unit(config: Config) -> Finding:
    from dsd_cli.files.config.signals import UNKNOWN
    from dsd_cli.identify.checks.results import Finding

    channel, per = ("position", "") if config.signals.position_unit == UNKNOWN else ("velocity", "/s")
    units = [f'"{unit}{per}"' for unit in ("rad", "deg", "turn", "m", "mm")]
    return Finding(
        "the unit of the motion is unknown: it is taken as rad or m",
        channel,
        "note",
        1.0,
        f"signals.{channel}_unit = {', '.join(units[:-1])} or {units[-1]}: gravity and cogging are named by it;"
        " `dsd init LOG --force --set` with it sizes inertia and rho as well",
    )


#: A rotor's rim bursts at 360 m/s or so, the root of strength over density of good steel: at this speed, rad/s, all of
#: more than 36 mm radius have. No axis on rails has been as fast as sound, m/s.
_FASTEST = {"rad": 1e4, "m": 340.0}


def _too_fast(config: Config, speed: float) -> list[Finding]:
    """A speed that no axis has had in the unit in which it is read."""
    from dsd_cli.identify.checks.results import Finding

    unit = config.signals.units.position or "rad"
    if not speed > _FASTEST[unit]:
        return []
    speed, turns = (float(f"{x:.3g}") for x in (speed, 60.0 * speed / math.tau))
    turning = f" ({turns:,.0f} rpm)" if unit == "rad" else ""
    what = f"speed up to {speed:,.0f} {unit}/s{turning} is implausible: is the motion in {unit}?"
    others = (
        '"counts" with counts_per_turn, "deg", "mm"' if unit == "rad" else '"mm", "um", "counts" with counts_per_metre'
    )
    remedy = f"signals.position_unit and velocity_unit = what the columns hold: {others}, ...; or their _scale"
    return [Finding(what, "position" if config.signals.position else "velocity", "warning", 0.95, remedy)]


def _widened(finding: Finding) -> Finding:
    """Where only a part of a log is read, there may be more of it."""
    if not finding.remedy.startswith("a longer log"):
        return finding
    return replace(finding, remedy=f"widen --from and --to, or {finding.remedy.removesuffix(' is needed')}")
