"""Units that the names of columns say and a config leaves out: its author reads them, and [signals] does not."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from dsd_cli.files.config import Config


class LeftOut(NamedTuple):
    """A column whose name ends in a unit as `init` reads it, and the unit in which it is read. key : of [signals]."""

    channel: str
    column: str
    unit: str
    taken: str

    @property
    def what(self) -> str:
        return f'signals.{self.channel} = "{self.column}" reads like {self.unit}, and is taken as {self.taken}'

    @property
    def remedy(self) -> str:
        return f'signals.{self.channel}_unit = "{self.unit}", or "{self.taken}" if it is'

    @property
    def line(self) -> str:
        return f"{self.what}: set {self.remedy}"


def left_out(config: Config) -> list[LeftOut]:
    """Of position and velocity of which [signals] says neither a unit nor a scale, those whose names say another unit
    than SI."""
    from dsd_cli.files.names_in import unit_in
    from dsd_cli.files.recognise import Recognised

    found, per, signals = [], {"position": "", "velocity": "/s"}, config.signals
    for channel in per:
        column = signals.columns().get(channel, "")
        said = Recognised(channel, column, unit_in(column, channel))
        kind = said.of_kind
        scaled = config.says(f"signals.{channel}_scale") or abs(getattr(signals, f"{channel}_scale")) != 1.0
        bare = not getattr(signals, f"{channel}_unit") and not scaled
        if bare and kind is not None and kind[1] != 1.0 and not said.by_default:
            found.append(LeftOut(channel, column, said.named, kind[0] + per[channel]))
    return found
