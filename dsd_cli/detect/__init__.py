"""Which state holds now: the grid of candidate models, and the likelihoods of a hidden Markov model over it."""

from dsd_cli.detect.engine import Engine, Label, Labels
from dsd_cli.detect.grid import Grid
from dsd_cli.detect.settings import DetectorSettings
from dsd_cli.detect.transition import Transition

__all__ = ["DetectorSettings", "Engine", "Grid", "Label", "Labels", "Transition"]
