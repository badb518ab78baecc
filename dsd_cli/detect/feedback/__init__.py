"""The detected state back into a controller: with hysteresis, and only when it is confident."""

from dsd_cli.detect.feedback.adaptation import Adaptation, AdaptSettings

__all__ = ["AdaptSettings", "Adaptation"]
