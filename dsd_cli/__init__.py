"""`dsd`: which delay, which inertia, which missing physics explains a servo axis' log."""

__version__ = "0.2.0"
