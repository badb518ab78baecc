"""The options of the commands that fit: they read logs, hold some out and know values alike."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dsd_cli.cli.identification import HoldoutOption
from dsd_cli.cli.options import (
    CONFIG_FILE,
    BoundsOption,
    ConfigOption,
    EffectsFromOption,
    FixOption,
    Format,
    FormatOption,
    FromOption,
    PriorOption,
    QuietOption,
    SetOption,
    ToOption,
)
from dsd_cli.cli.pictures import PlotOption

if TYPE_CHECKING:
    from dsd_cli.files.config import Config

StatesOption = Annotated[
    bool,
    typer.Option("--states", help="Set [states], rho and (where d_hat is not logged) Jn by the new model, too."),
]


@dataclass(frozen=True)
class ReadOptions:
    """What a command that fits all of its logs is given beside them."""

    config: ConfigOption = CONFIG_FILE
    plot: PlotOption = None
    form: FormatOption = Format.TABLE
    fix: FixOption = None
    bounds: BoundsOption = None
    prior: PriorOption = None
    start: FromOption = None
    end: ToOption = None
    override: SetOption = None
    effects_from: EffectsFromOption = None
    quiet: QuietOption = False

    def settings(self, hold: bool = False, logs: Sequence[str] = ()) -> Config:
        """The config with all of these in place; effects of the user are known from now on.

        logs : of the command, of which one that is not there is said first: it is what the command line is about.

        Raises
        ------
        DataError : no such log. UsageError : a config, an effect or a value that cannot be used.
        """
        from dsd_cli.cli.user_effects import use_effects
        from dsd_cli.errors import DataError
        from dsd_cli.files.config import load_config

        if missing := next((one for one in logs if one != "-" and not os.path.lexists(one)), ""):
            raise DataError(f"{missing}: no such file")
        use_effects(self.effects_from)
        read = load_config(self.config, self.override or ()).within(self.start, self.end)
        return read.knowing(self.fix or (), self.bounds or (), self.prior or (), hold)

    def files(self, settings: Config) -> tuple[str | Path, ...]:
        """What is read beside the logs that are fitted: no output may be one of these."""
        return (*settings.files, *(self.effects_from or ()))


@dataclass(frozen=True)
class FitOptions(ReadOptions):
    """The same, and logs that are held out."""

    holdout: HoldoutOption = None

    @property
    def apart(self) -> tuple[str, ...]:
        """Logs that no fit sees."""
        return tuple(self.holdout or ())

    def files(self, settings: Config) -> tuple[str | Path, ...]:
        """With those that are held out."""
        return (*self.apart, *super().files(settings))
