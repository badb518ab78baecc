"""What each channel of an unknown log is, by what it does: the clock, what moves, what makes it move.

found = guess_roles(channels, named)     # named: roles that names and units have given already
"""

from dsd_cli.roles.control_input import ONLY_CAUSE, Guess
from dsd_cli.roles.guess import Roles, guess_roles
from dsd_cli.signals.facts import Channel, Facts, Slope, facts_of, slope_of

__all__ = ["ONLY_CAUSE", "Channel", "Facts", "Guess", "Roles", "Slope", "facts_of", "guess_roles", "slope_of"]
