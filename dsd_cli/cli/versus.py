"""`dsd compare -c a.toml -c b.toml`: two models side by side, on a log and value by value."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dsd_cli.cli.options import Format

if TYPE_CHECKING:
    from dsd_cli.files.config import Config
    from dsd_cli.identify.compare.versus import Moved, Versus


def compare_configs(
    configs: Sequence[Config], logs: Sequence[str], form: Format, quiet: bool, plot: Path | None = None
) -> None:
    """Print both tables; logs are read as the first config says.

    Raises
    ------
    UsageError : two configs of one name, or that read a log differently. DataError : see `load_recording`.
    """
    import sys

    from dsd_cli.cli.identification import print_json
    from dsd_cli.cli.recordings import believed_model
    from dsd_cli.errors import UsageError
    from dsd_cli.report.versus import print_versus, versus_json

    names = [config.name.partition(" with --")[0] for config in configs]
    if len(set(names)) < len(names):
        raise UsageError(f"{names[0]} is given twice", "each config once")
    for name, config in zip(names[1:], configs[1:], strict=True):
        _check_alike(names[0], configs[0], name, config)
    models = {name: believed_model(config) for name, config in zip(names, configs, strict=True)}
    found: Versus | None = None
    if logs:
        from dsd_cli.cli.identification import warn
        from dsd_cli.cli.progress import Progress
        from dsd_cli.cli.recordings import load_recording
        from dsd_cli.identify.compare.versus import versus
        from dsd_cli.plant.beyond import held_beyond

        with Progress(not quiet) as progress:
            loaded = [load_recording(path, configs[0], progress=progress) for path in logs]
            progress.clear()
            warn(quiet, (f"{path}: {w}" for path, one in zip(logs, loaded, strict=True) for w in one.warnings))
            for name in names[1:]:  # reading a log looks at the first model alone
                pairs = zip(logs, loaded, strict=True)
                beyond = ((path, held_beyond(models[name], one.recording.pieces)) for path, one in pairs)
                warn(quiet, (f"{name}: {path}: {line}" for path, lines in beyond for line in lines))
            progress("comparing the models")
            found = versus([one.recording for one in loaded], models)
    differences = {name: _moved(configs[0], config) for name, config in zip(names[1:], configs[1:], strict=True)}
    units = configs[0].signals.units
    if form is Format.JSON:
        print_json(versus_json(names, list(logs), found, differences, units))
    else:
        print_versus(names, found, differences, units, sys.stdout)
    if plot is not None and found is not None:
        from dsd_cli.cli.pictures import put_picture
        from dsd_cli.report.plots_versus import draw

        compared = found
        put_picture(plot, lambda: draw(compared, units), quiet)


def _check_alike(one: str, first: Config, other: str, second: Config) -> None:
    """Both must read a log alike: else J in kg stands beside J in g, and the order decides which model is better. One
    that has no name for the unit of u contradicts no name."""
    from dsd_cli.errors import UsageError
    from dsd_cli.files.config.signals import Signals

    ours, theirs, usual = ({k: getattr(s, k) for k in s.keys} for s in (first.signals, second.signals, Signals()))
    alike = {"start", "end"} | ({"u_unit"} if "" in (ours["u_unit"], theirs["u_unit"]) else set())
    differ = [key for key in ours if key not in alike and ours[key] != theirs[key]]
    if differ and any(theirs[key] != usual[key] for key in usual if key not in alike):
        keys = ", ".join(f"signals.{key}" for key in differ[:4])
        raise UsageError(
            f"{one} and {other} read a log differently ({keys}), so their values and errors do not compare",
            "give both the same [signals]; a config without any takes those of the first",
        )


def _moved(first: Config, second: Config) -> tuple[Moved, ...]:
    from dsd_cli.cli.recordings import believed_model
    from dsd_cli.identify.compare.versus import moved, paired, renamed
    from dsd_cli.identify.fit.values import flat
    from dsd_cli.report.value_units import units_of

    model, beside = believed_model(first), believed_model(second)
    names = paired(model, beside)
    one, other = flat(model), renamed(flat(beside), names)
    units = units_of(dict.fromkeys((*one, *other)), first.signals.units)
    return moved(one, other, fitted_errors(first), renamed(fitted_errors(second), names), units)


def fitted_errors(config: Config) -> dict[str, float]:
    """Standard errors out of the last step of [[history]], of values that [model] still has as they were fitted."""
    from dsd_cli.cli.recordings import believed_model
    from dsd_cli.identify.fit.values import flat

    if not config.history:
        return {}
    last, now = config.history[-1], flat(believed_model(config))
    return {
        name: float(error)
        for name, error in last.fitted_errors.items()
        if name in now and name in last.fitted and math.isclose(now[name], last.fitted[name], rel_tol=1e-4)
    }
