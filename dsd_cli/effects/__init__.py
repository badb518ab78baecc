"""What physics exists: one file = one effect; the catalogue finds them by looking into this folder."""

from dsd_cli.effects.base import Channels, Effect, Parameter, Ranges, Role, Shape, SpectralLines, Values
from dsd_cli.effects.catalogue import catalogue, get_effect, register, unregister
from dsd_cli.effects.user import load_effects

__all__ = [
    "Channels",
    "Effect",
    "Parameter",
    "Ranges",
    "Role",
    "Shape",
    "SpectralLines",
    "Values",
    "catalogue",
    "get_effect",
    "load_effects",
    "register",
    "unregister",
]
