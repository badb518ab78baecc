"""The whole of `dsd.toml`, read and checked once; every command takes from it what it needs."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from dsd_cli.errors import UsageError
from dsd_cli.files.config.effect_values import check_complete
from dsd_cli.files.config.fitting import Fit
from dsd_cli.files.config.history import History
from dsd_cli.files.config.overrides import with_effects, with_values
from dsd_cli.files.config.own_effects import OwnEffects, read_own_effects
from dsd_cli.files.config.planning import Plan
from dsd_cli.files.config.priors import with_known, with_window
from dsd_cli.files.config.rules import Place, Section, key, shown, table, tables
from dsd_cli.files.config.sections import Csv, Detector, Model, Observer, States
from dsd_cli.files.config.signals import Signals
from dsd_cli.files.config.simulation import Simulate
from dsd_cli.files.config.text import read_text

S = TypeVar("S", bound=Section)


class Config(Section):
    """A rig: its log, observer, model, states, detector and simulation, and what improved its model.

    Sections without defaults are None when the file lacks them; `require` hands them out or says what is missing.
    `name` is the file for messages, `folder` what relative paths start from, `written` what the file (and the
    command line) said, without the defaults.
    """

    name: str
    folder: Path
    written: Mapping[str, Any]
    signals: Signals = key(table(Signals), "column names in the log", default=Signals())
    csv: Csv = key(table(Csv), "where the rows of a text file are", default=Csv())
    observer: Observer | None = key(table(Observer), "the disturbance observer", default=None)
    effects: OwnEffects = key(table(OwnEffects), "effects of your own", default=OwnEffects())
    model: Model = key(table(Model), "what the plant is believed to be", default=Model())
    fit: Fit = key(table(Fit), "what a fit may change", default=Fit())
    states: States | None = key(table(States), "the grid of candidate states", default=None)
    detector: Detector = key(table(Detector), "how the state is chosen", default=Detector())
    simulate: Simulate | None = key(table(Simulate), "what `dsd simulate` runs", default=None)
    plan: Plan = key(table(Plan), "what a motion of `dsd plan` may reach", default=Plan())
    history: tuple[History, ...] = key(tables(History), "steps of `dsd add` and `dsd improve`, newest last", default=())

    def __init__(
        self,
        *,
        name: str = "dsd.toml",
        folder: Path = Path(),
        written: Mapping[str, Any] | None = None,
        **sections: Any,
    ) -> None:
        super().__init__(**sections)
        self.__dict__.update(name=name, folder=folder, written=written or {})
        self.__dict__["signals"] = self.signals.in_layout(self.csv.layout)

    def check(self, at: Place) -> None:
        believed = self.model.effects
        if self.states is not None:
            check_complete(self.states.effects, at.child("states.effects"), believed)
            self._check_initial(self.states, at.child("detector.initial"))
        for i, event in enumerate(self.simulate.events if self.simulate else ()):
            check_complete(event.effects, at.child("simulate.events").item(i).child("effects"), believed)

    def _check_initial(self, states: States, at: Place) -> None:
        initial = self.detector.initial
        if initial is None:
            return
        for name, value, grid in (("delay", initial.delay, "delays"), ("inertia", initial.inertia, "inertias")):
            candidates = getattr(states, grid)
            if not any(math.isclose(value, candidate, rel_tol=1e-9) for candidate in candidates):
                raise at.child(name).wrong(value, f"one of states.{grid} = {shown(candidates)}")

    def require(self, kind: type[S]) -> S:
        """The section of that class, e.g. `config.require(Observer)`.

        Raises
        ------
        UsageError : the file does not have it.
        """
        for name, spec in self.keys.items():
            if kind in spec.rule.sections:
                found = getattr(self, name)
                if found is None:
                    needed = ", ".join(k for k, s in kind.keys.items() if s.required)
                    raise UsageError(f"{self.name}: [{name}] is missing", f"{spec.meaning}; it needs {needed}")
                return found
        raise TypeError(f"{kind.__name__} is no section of the config")

    def require_inertia(self) -> float:
        """`[model] inertia`.

        Raises
        ------
        UsageError : the file does not have it.
        """
        if self.model.inertia is None:
            raise Place(self.name, "model").missing("inertia", "inertia J of the plant, a number above 0")
        return self.model.inertia

    def says(self, dotted: str) -> bool:
        """Whether the file or the command line gives this key, e.g. `signals.d_hat`; False if it is a default."""
        here: Any = self.written
        for part in dotted.split("."):
            if not isinstance(here, Mapping) or part not in here:
                return False
            here = here[part]
        return True

    def resolve(self, file: str) -> Path:
        """A file named in the config: relative to the config's folder."""
        return self.folder / file

    @property
    def files(self) -> tuple[Path, ...]:
        """The files that the config names: transition matrix, reference, effects of the user."""
        named = [getattr(self.detector.transition, "file", None)]
        if self.simulate is not None:
            named.append(getattr(self.simulate.reference, "file", None))
        return (*(self.resolve(file) for file in named if file is not None), *self.effect_files)

    @property
    def effect_files(self) -> tuple[Path, ...]:
        """Python files with effects of the user."""
        return tuple(self.resolve(file) for file in self.effects.files)

    def override(self, values: Iterable[str] = (), effects: Iterable[str] = ()) -> Config:
        """With `--set` values (`model.inertia=0.7`) and `--effect` texts (`coulomb_friction:level=0.5`) in place.

        Raises
        ------
        UsageError : a text that cannot be read, or a config that is wrong with it.
        """
        values, effects = tuple(values), tuple(effects)
        if not values and not effects:
            return self
        name = self.name if " with --" in self.name else f"{self.name} with --{'set' if values else 'effect'}"
        return read_config(with_effects(with_values(self.written, values), effects), name, self.folder)

    def with_signals(self, signals: Mapping[str, Any]) -> Config:
        """With these keys as [signals]."""
        return read_config({**self.written, "signals": dict(signals)}, self.name, self.folder)

    def knowing(
        self, fix: Iterable[str] = (), bounds: Iterable[str] = (), prior: Iterable[str] = (), hold: bool = False
    ) -> Config:
        """With `--fix`, `--bounds`, `--prior` and `--hold` in [fit].

        Raises
        ------
        UsageError : a text that cannot be read, or a [fit] that is wrong with it.
        """
        texts = {"fix": tuple(fix), "bounds": tuple(bounds), "prior": tuple(prior)}
        if not (any(texts.values()) or hold):
            return self
        known = with_known(self.written, self.name, (self.fit, self.model), texts, hold)
        return read_config(known, self.name, self.folder)

    def within(self, start: float | None, end: float | None) -> Config:
        """With `--from` and `--to` in [signals]; None leaves what the file says.

        Raises
        ------
        UsageError : no finite numbers, or nothing between them.
        """
        if start is None and end is None:
            return self
        return read_config(with_window(self.written, self.signals, self.name, start, end), self.name, self.folder)

    def to_toml(self) -> str:
        """What the file and the command line said, as TOML; reading it gives the same config."""
        import tomlkit  # late: only where a config is written

        return tomlkit.dumps(self.written)


def read_config(written: Mapping[str, Any], name: str = "dsd.toml", folder: Path = Path()) -> Config:
    """Nested tables, as TOML gives them, to a config; `name` is used in messages.

    Raises
    ------
    UsageError : names file, key, what was found and what is allowed.
    """
    at = Place(name)
    if _is_deep(written):
        raise UsageError(f"{name}: nested too deeply", "a config has at most five levels")
    for unread, value in written.items():
        if unread not in Config.keys:
            raise at.unknown(unread, Config.keys, what="section" if isinstance(value, Mapping) else "key")
    sections = {s: Config.keys[s].rule.read(value, at.child(s)) for s, value in written.items()}
    config = Config(**sections, name=name, folder=folder, written=written)
    config.check(at)
    return config


def _is_deep(value: Any, limit: int = 20) -> bool:
    inside = value.values() if isinstance(value, Mapping) else value if isinstance(value, list | tuple) else ()
    return limit == 0 or any(_is_deep(item, limit - 1) for item in inside)


def parse_config(text: str, name: str = "dsd.toml", folder: Path = Path()) -> Config:
    """TOML text to a config.

    Raises
    ------
    UsageError : not TOML (with line and column), or not a valid config.
    """
    return read_config(parse_tables(text, name), name, folder)


def parse_tables(text: str, name: str) -> dict[str, Any]:
    """TOML text to nested tables.

    Raises
    ------
    UsageError : not TOML (with line and column).
    """
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        place = re.fullmatch(r"(.*) \(at (line \d+, column \d+|end of document)\)", str(error), re.DOTALL)
        reason, where = place.groups() if place else (str(error), "somewhere")
        raise UsageError(f"{name}: {where}: not valid TOML", " ".join(reason.split())) from error
    except RecursionError:
        raise UsageError(f"{name}: nested too deeply", "a config has at most five levels") from None


def load_config(path: str | Path, values: Iterable[str] = (), effects: Iterable[str] = ()) -> Config:
    """A config file, with `--set` values and `--effect` texts in place if there are any.

    Raises
    ------
    UsageError : no such file, not TOML, or not a valid config.
    """
    path = Path(path)
    text = config_text(path, "config file", "`dsd init` writes one, -c FILE names another")
    written = parse_tables(text, str(path))
    read_own_effects(written, str(path), path.parent)
    values = tuple(values)
    try:
        config = read_config(written, str(path), path.parent)
    except UsageError:
        if not values:
            raise
        # --set may say what is missing in the file
        return read_config(with_values(written, values), f"{path} with --set", path.parent).override((), effects)
    return config.override(values, effects)


def config_text(path: Path, what: str, hint: str = "") -> str:
    """The text of a file that a user wrote; `what` it is called and the `hint` are for messages.

    Raises
    ------
    UsageError : no such file, or it cannot be read as text.
    """
    try:
        return read_text(path)
    except FileNotFoundError as error:
        raise UsageError(f"{path}: no such {what}", hint) from error
    except OSError as error:
        raise UsageError(f"{path}: cannot be read", error.strerror or str(error)) from error
    except UnicodeDecodeError as error:
        raise UsageError(f"{path}: byte {error.start} is not UTF-8", "save the file as UTF-8") from error
