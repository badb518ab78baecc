"""`[observer] filter` and `u` that are "auto", or that nobody gave: what a log says about how its d_hat was made."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

from dsd_cli.errors import UsageError
from dsd_cli.plant.maker import MAKERS, Maker, left_open

if TYPE_CHECKING:
    from dsd_cli.files.config import Config
    from dsd_cli.files.logs import LoadedLog

    Reader = Callable[[Config, str, int], LoadedLog]

#: Rows that are looked at.
MOST_ROWS = 200_000
_KEYS = ("filter", "u")


def known_maker(config: Config, log: str, read: Reader) -> Config:
    """The config with what its log says in place of "auto"; with the maker of this package where the log has no d_hat.

    Parameters
    ----------
    read : the log as the config says, with d_hat as it is in the file, and no more than so many rows.

    Raises
    ------
    UsageError : the log is a stream, or does not say it.
    DataError : it cannot be read.
    """
    section = config.observer
    if section is None or all(getattr(section, key) != "auto" for key in _KEYS):
        return config
    if log == "-":
        raise UsageError(
            f'{config.name}: observer {_open(config)} = "auto" needs a log in a file',
            "dsd check of a file of that drive names them",
        )
    maker = _asked(_Question(config, log, read))
    if maker is None:
        raise UsageError(
            f'{log}: does not say how d_hat was made, and observer {_open(config)} is "auto"',
            "give observer.filter and observer.u: the log is too short to say",
        )
    return config.override(maker.keys)


def open_makers(config: Config, logs: Sequence[str], read: Reader) -> tuple[Config, tuple[Maker, ...]]:
    """(the config, by which d_hat is read as it is; the makers that it leaves open of logs without any motion, or
    none). What [observer] does not give is open, "auto" or not: where no motion is logged a default is no knowledge.

    Parameters
    ----------
    read : as for `known_maker`.
    """
    section = config.observer
    said = [key for key in _KEYS if config.says(f"observer.{key}")]
    if section is None or not said:
        return config, MAKERS
    if "-" in logs:
        return config, ()
    makers = left_open(*(getattr(section, key) if key in said else "auto" for key in _KEYS))
    if len(makers) < 2 or any(_moves(read(config, log, MOST_ROWS)) for log in logs):
        return config, ()
    return config.override(Maker().keys), makers


def half_said(config: Config) -> tuple[str, ...]:
    """That one of both keys alone is given, for a stream, of which the other is not asked."""
    open_ = [key for key in _KEYS if not config.says(f"observer.{key}")]
    if len(open_) != 1:
        return ()
    how = f'"{getattr(config.observer, open_[0])}"'
    return (f"observer.{open_[0]} is not given, and a stream is not asked who made d_hat: it is read as {how}",)


def _moves(loaded: LoadedLog) -> bool:
    """Whether a motion is logged, or d_hat is not, or of this package."""
    log = loaded.log
    return "velocity" in log or "position" in log or "d_hat" not in log or log.d_hat_source != "logged"


def _open(config: Config) -> str:
    return " and ".join(key for key in _KEYS if getattr(config.observer, key) == "auto")


class _Question:
    """A config and a log, alike where both read alike: several parts of one command ask."""

    def __init__(self, config: Config, log: str, read: Reader) -> None:
        self.config, self.log, self.read = config, log, read
        self._key = (log, config.name, repr(config.written.get("signals")), repr(config.written.get("observer")))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Question) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)


@lru_cache(maxsize=8)
def _asked(question: _Question) -> Maker | None:
    from dsd_cli.files.config import Observer
    from dsd_cli.identify.d_hat_makers import of_log
    from dsd_cli.plant.model import ObserverSettings, PlantModel

    config, section = question.config, question.config.require(Observer)
    loaded = question.read(config, question.log, MOST_ROWS)
    if "d_hat" not in loaded.log or loaded.log.d_hat_source != "logged":
        return Maker()
    observer = ObserverSettings(section.nominal_inertia, section.time_constant, section.sign)
    given = config.model
    inertia = given.inertia or section.nominal_inertia
    model = PlantModel(inertia, given.delay, given.effects, given.rest_speed)
    return of_log(loaded.log, loaded.restarts, model, observer, left_open(section.filter, section.u))
