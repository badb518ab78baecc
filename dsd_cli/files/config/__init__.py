"""`dsd.toml`: `load_config(path)` reads and checks it, the sections are frozen dataclasses."""

from dsd_cli.files.config.config import Config, config_text, load_config, parse_config, parse_tables, read_config
from dsd_cli.files.config.fitting import Fit
from dsd_cli.files.config.history import History
from dsd_cli.files.config.planning import Plan
from dsd_cli.files.config.sections import Detector, Initial, Model, Observer, States, Stay, TransitionFile
from dsd_cli.files.config.signals import Signals
from dsd_cli.files.config.simulation import (
    Column,
    Controller,
    Event,
    Multisine,
    Planned,
    Reference,
    Simulate,
    Sine,
    Step,
    Trapezoid,
)

__all__ = [
    "Column",
    "Config",
    "Controller",
    "Detector",
    "Event",
    "Fit",
    "History",
    "Initial",
    "Model",
    "Multisine",
    "Observer",
    "Plan",
    "Planned",
    "Reference",
    "Signals",
    "Simulate",
    "Sine",
    "States",
    "Stay",
    "Step",
    "TransitionFile",
    "Trapezoid",
    "config_text",
    "load_config",
    "parse_config",
    "parse_tables",
    "read_config",
]
