"""What physics exists: one file = one effect; the catalogue finds them by looking into this folder."""

from dsd_cli.effects.base import Channels, Effect, Parameter, Ranges, Role, Shape, SpectralLines, Values
from dsd_cli.effects.catalogue import (
    catalogue,
    delays_command,
    find_effect,
    free_name,
    get_effect,
    is_angle,
    kind_of,
    named_effects,
    register,
    told_apart,
    unregister,
)
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
    "delays_command",
    "find_effect",
    "free_name",
    "get_effect",
    "is_angle",
    "kind_of",
    "load_effects",
    "named_effects",
    "register",
    "told_apart",
    "unregister",
]
