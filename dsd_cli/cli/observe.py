"""`dsd observe`: d_hat for a log that has none."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from dsd_cli.cli.options import (
    CONFIG_FILE,
    ConfigOption,
    EffectsFromOption,
    FromOption,
    LogArgument,
    QuietOption,
    SetOption,
    ToOption,
)
from dsd_cli.cli.pictures import PlotOption

if TYPE_CHECKING:
    from dsd_cli.files.logs import LoadedLog
    from dsd_cli.plant.model import ObserverSettings
    from dsd_cli.signals.log import Log

OutputNeeded = Annotated[
    str, typer.Option("-o", "--output", metavar="FILE", help="Log to write (.csv or .parquet); - is stdout.")
]


def observe(
    log: LogArgument,
    output: OutputNeeded,
    config: ConfigOption = CONFIG_FILE,
    start: FromOption = None,
    end: ToOption = None,
    override: SetOption = None,
    effects_from: EffectsFromOption = None,
    plot: PlotOption = None,
    quiet: QuietOption = False,
) -> None:
    """Add the observed disturbance d_hat, computed from velocity (or from position alone), to LOG.

    Writes the channels that the config names, under the tool's own names. Rows that cannot be used are left out, and so
    are those in which a log only repeats what its sensors said before.
    """
    from dsd_cli.cli.identification import say
    from dsd_cli.cli.pictures import check_plot, put_picture
    from dsd_cli.cli.plan import as_logged, log_columns, naming, observer_settings, optional_columns, reading
    from dsd_cli.cli.progress import Progress
    from dsd_cli.cli.recordings import of_new_rows
    from dsd_cli.cli.user_effects import use_effects
    from dsd_cli.files.config import load_config
    from dsd_cli.files.logs import load_log, write_log
    from dsd_cli.files.tables_out import check_output

    use_effects(effects_from)
    settings = as_logged(load_config(config, override or ()).within(start, end), log)
    observer = observer_settings(settings)
    if output != "-":
        check_output(output, (log, config, *settings.files, *(effects_from or ())))
    check_plot(plot, (log, config, output, *settings.files, *(effects_from or ())))
    columns = log_columns(settings.signals)
    columns.pop("d_hat", None)
    with naming(log), Progress(not quiet) as progress:
        how = reading(settings)
        loaded = load_log(log, columns, optional_columns(settings), **how, unwrap=True, watch=progress.watch)
        loaded = of_new_rows(loaded)
        progress("observing")
        observed = _observed(loaded, observer)
        _check_finite(loaded.log.source, observed)
        progress("writing")
        write_log(output, observed, (log, config))
    for warning in loaded.warnings:
        say(quiet, f"dsd: warning: {loaded.log.source}: {warning}")
    counts = "".join(f"; {reason} {count:,}" for reason, count in loaded.dropped.items() if count)
    say(quiet, f"{output}: {len(observed):,} samples, d_hat computed from {observed.d_hat_source}{counts}")
    if plot is not None:
        from dsd_cli.report.plots_channels import draw

        units = settings.signals.units
        put_picture(plot, lambda: draw(loaded.log.source, observed, loaded.restarts, units), quiet)


def _check_finite(name: str, log: Log) -> None:
    import numpy as np

    from dsd_cli.errors import DataError

    if not np.isfinite(log["d_hat"]).all():
        row = int(np.flatnonzero(~np.isfinite(log["d_hat"]))[0])
        raise DataError(
            f"{name}: d_hat is not finite from t = {log['t'][row]:g} s on",
            "set the ranges of the channels in [signals], such as velocity_range; is nominal_inertia right?",
        )


def _observed(loaded: LoadedLog, settings: ObserverSettings) -> Log:
    """The observer starts anew wherever the samples do not continue (a gap, another recording)."""
    from dataclasses import replace
    from itertools import pairwise

    import numpy as np

    from dsd_cli.files.table_source import OWN_CHANNELS
    from dsd_cli.plant.observer import observe_log

    log = loaded.log
    edges = [0, *(at for at in loaded.restarts if 0 < at < len(log)), len(log)]
    parts = [
        observe_log(replace(log, channels={name: x[a:b] for name, x in log.channels.items()}), settings)
        for a, b in pairwise(edges)
    ]
    d_hat = np.concatenate([part["d_hat"] for part in parts])
    metadata = {**log.metadata, OWN_CHANNELS: "t (s), u, d_hat, velocity, position (SI), as [signals] reads them"}
    source = parts[0].d_hat_source
    return replace(log, channels={**log.channels, "d_hat": d_hat}, d_hat_source=source, metadata=metadata)
