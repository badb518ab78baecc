"""A group of commands that imports a command's module only when that command runs."""

from __future__ import annotations

import inspect
from importlib import import_module
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from dsd_cli.cli.coercion import use_plain_coercion
from dsd_cli.cli.help_text import HelpContext
from dsd_cli.cli.sharing import with_option
from dsd_cli.cli.user_effects import TrustOption

#: Of every command, also of those of a group.
HELP = {"help_option_names": ["-h", "--help"]}
#: Command -> (module in `dsd_cli.cli`, function, one line for `dsd --help`). A new command is a file and a line here.
COMMANDS = {
    "init": ("init_", "init", "Write a commented dsd.toml to start from."),
    "columns": ("columns", "columns", "Show every channel of a log and what it may be."),
    "simulate": ("simulate", "simulate", "Simulate a plant with delay and effects; write its log."),
    "observe": ("observe", "observe", "Add the observed disturbance d_hat to a log."),
    "detect": ("detect", "detect", "Label every sample with the most likely delay and inertia."),
    "tune": ("tune", "tune", "Choose rho, window, transition and grid of the detector."),
    "check": ("check", "check", "Say whether a log can answer: signs, units, clock, excitation."),
    "compare": ("compare", "compare", "Say how well the model predicts a log, and where it fails."),
    "diagnose": ("diagnose", "diagnose", "Say which physical effect the model lacks."),
    "add": ("add", "add", "Add an effect to the model of the config, fitted to a log."),
    "improve": ("improve", "improve", "Diagnose and add, step by step, until nothing is left to add."),
    "learn": ("learn", "learn", "Learn the law that no effect of the catalogue has."),
    "plan": ("plan_motion", "plan", "Plan the motion whose log settles what is left open."),
    "report": ("report", "report", "Write one HTML page with all results for a log."),
    "fleet": ("fleet", "app", "Run detect, compare or diagnose over many logs; one table."),
    "import": ("import_", "import_", "Read a joint of a simulator (MJCF, URDF) or values as a config."),
    "passport": ("passport", "passport", "Sign values of an axis within limits; say what changed."),
    "export": ("export", "export", "Write the model for a simulator, a controller or another tool."),
    "schema": ("schema", "schema", "Print the JSON schema of a command's result."),
    "effects": ("effects", "effects", "Show the catalogue of physical effects."),
}


def load_command(name: str) -> Any:
    """The command of that name, built from the signature and docstring of its function."""
    module, function, short_help = COMMANDS[name]
    found = getattr(import_module(f"dsd_cli.cli.{module}"), function)
    if isinstance(found, typer.Typer):  # a command with commands of its own
        app = found
        for one in app.registered_commands:
            one.callback, one.context_settings = _with_trust(one.callback), HELP
    else:
        app = typer.Typer(add_completion=False, rich_markup_mode=None)
        app.command(name, short_help=short_help, context_settings=HELP)(_with_trust(found))
    command = get_command(app)
    for one in (command, *getattr(command, "commands", {}).values()):
        use_plain_coercion(one)
        one.context_class = HelpContext
    return command


def _with_trust(command: Any) -> Any:
    """The command with `--trust`, if it reads a config."""
    reads = "config" in inspect.signature(command).parameters
    return with_option(command, "trust", TrustOption, False) if reads else command


class LazyGroup(TyperGroup):
    """Lists commands from the table; only the one that is run is imported."""

    context_class = HelpContext

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self.commands = {
            name: TyperCommand(name, help=line, rich_markup_mode=None) for name, (*_, line) in COMMANDS.items()
        }

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        name, command, rest = super().resolve_command(ctx, args)
        return name, load_command(name) if name in COMMANDS else command, rest
