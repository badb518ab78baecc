"""What physics exists: one file = one effect; the catalogue finds them by looking into this folder."""

from dsd_cli.effects.base import Channels, Effect, Parameter, Role
from dsd_cli.effects.catalogue import catalogue, get_effect

__all__ = ["Channels", "Effect", "Parameter", "Role", "catalogue", "get_effect"]
