"""What `dsd detect` shall look for in a log, and how that log measures it."""

from __future__ import annotations

from dataclasses import dataclass, field

from dsd_cli.detect.grid import Grid
from dsd_cli.detect.kernel import Backend
from dsd_cli.detect.settings import DetectorSettings
from dsd_cli.effects import Role, get_effect
from dsd_cli.errors import UsageError
from dsd_cli.plant.model import ObserverSettings, PlantModel
from dsd_cli.plant.observer import APERTURE
from dsd_cli.signals.log import DHatSource


@dataclass(frozen=True)
class Plan:
    """What to detect, and how the log measures it.

    Attributes
    ----------
    model : what all states share; its effects apply to every state.
    d_hat_source : "logged", or what the observer computes d_hat from.
    logged_aperture : intervals one logged value of d_hat averages (2 for a d_hat that was computed from position).
    channels : channels to read beside u and d_hat, needed by effects.

    Raises
    ------
    UsageError : an effect that needs more than the kernel computes per state.
    """

    grid: Grid
    settings: DetectorSettings
    model: PlantModel
    observer: ObserverSettings
    d_hat_source: DHatSource = "logged"
    logged_aperture: int = 1
    channels: tuple[str, ...] = ()
    backend: Backend | None = None
    effects: list[PlantModel] = field(init=False)

    def __post_init__(self) -> None:
        _check_effects({*self.model.effects, *(name.split(".", 1)[0] for name in self.grid.effects)})
        models = [self.model.with_values(combination) for combination in self.grid.combinations]
        _check_commands(models)
        object.__setattr__(self, "effects", models)

    @property
    def has_effects(self) -> bool:
        """Whether any state has forces beside u."""
        return any(model.effects for model in self.effects)

    @property
    def has_motion(self) -> bool:
        """Whether the rows show how the axis moves, so that forces which the model lacks can be asked for."""
        return self.settings.output == "d_hat" and any(name in self.columns for name in ("velocity", "position"))

    @property
    def has_friction(self) -> bool:
        """Whether a friction of the model acts where the speed turns (aperture 1: the speed is known there)."""
        roles = {get_effect(name).role for model in self.effects for name in model.effects}
        return Role.FRICTION in roles and self.aperture == 1

    @property
    def measured(self) -> str:
        """The column that carries the disturbance."""
        return "d_hat" if self.d_hat_source == "logged" else self.d_hat_source

    @property
    def columns(self) -> list[str]:
        """Channels needed in every row."""
        return list(dict.fromkeys(["u", self.measured, *self.channels]))

    @property
    def aperture(self) -> int:
        """Intervals that one value of d_hat averages."""
        return self.logged_aperture if self.d_hat_source == "logged" else APERTURE[self.d_hat_source]


def _check_commands(models: list[PlantModel]) -> None:
    """No table over u."""
    for model in models:
        for name, values in model.effects.items():
            effect = get_effect(name)
            if effect.needs_of is not None and "u" in effect.needed(values):
                why = "its table is over the command after the delay"
                raise UsageError(f"dsd detect cannot take {name} yet: {why}", "leave it out of [model] and [states]")


def _check_effects(names: set[str]) -> None:
    """Forces must be the same for every delay and inertia, and those of a row must not rest on other rows."""
    for name in sorted(names):
        effect = get_effect(name)
        if effect.role is Role.INPUT:
            why = "it changes the command before the delay"
        elif effect.role is Role.STRUCTURE:
            why = "it hangs a load on the motor"
        elif effect.memory:
            why = "it has memory"
        elif "u" in effect.needs and effect.needs_of is None:
            why = "it looks at the command after the delay"
        else:
            continue
        raise UsageError(f"dsd detect cannot take {name} yet: {why}", "leave it out of [model] and [states]")
