"""`dsd`: the commands, and the one place where failures become one line and an exit code."""

from __future__ import annotations

import io
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, NoReturn

import typer
from typer.main import get_command

from dsd_cli import __version__
from dsd_cli.cli.coercion import use_plain_coercion
from dsd_cli.cli.ending import Ended, at_once, end_in_order, leave
from dsd_cli.cli.help_text import width_of
from dsd_cli.cli.lazy import LazyGroup
from dsd_cli.errors import DsdError, printable

# Small matrices: threads of the linear algebra only wait for each other, by a hundred times where the cores are busy.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Arrow's allocator gives back memory 10 ms after it was freed; the next block of a long log asks for it again, and
# clearing its pages was a tenth of a run.
os.environ.setdefault("MIMALLOC_PURGE_DELAY", "10000")

#: What a shell reports for a command ended by SIGINT, and by a closed pipe (SIGPIPE).
INTERRUPTED, CLOSED_PIPE = 130, 141

#: Set by a shell that asks what could follow (`dsd --install-completion`).
COMPLETE = "_DSD_COMPLETE"

_USAGE_ERROR: type[Exception] = typer.BadParameter.__mro__[
    2
]  # every failure of the command line parser derives from it

app = typer.Typer(
    cls=LazyGroup,
    add_completion=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(version_text())
        raise typer.Exit


def version_text() -> str:
    """Version, and which of its kernels are compiled."""
    return f"dsd {__version__} (detector kernel: {_kernel()}, effects: {_recursions()})"


def _kernel() -> str:
    try:
        from dsd_cli.detect.kernel import active_backend
    except ImportError:
        return "none"
    return str(active_backend())


def _recursions() -> str:
    try:
        from dsd_cli.effects.memory import COMPILED
    except ImportError:
        return "none"
    return "python" if COMPILED is None else "compiled"


@app.callback()
def dsd(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show version and kernel, and exit."),
    ] = False,
) -> None:
    """Disturbance State Distinction: which physics a servo axis' model lacks, which delay and inertia hold now."""


def main() -> NoReturn:
    """Run `dsd` with the arguments of the process and exit."""
    try:
        end_in_order()
        code = run(sys.argv[1:])
        at_once()
    except Ended as ended:
        code = 128 + ended.number
    if unfinished := sys.modules.get("dsd_cli.files.whole"):
        unfinished.sweep()
    leave(code)


def run(arguments: list[str]) -> int:
    """Run `dsd` with these arguments; the exit code. Prints one line on stderr for whatever goes wrong."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a character that the terminal does not have is no failure
            stream.reconfigure(errors="backslashreplace")
    if os.environ.get("DSD_DEBUG") != "1":
        warnings.simplefilter("ignore")  # of libraries, in their words; what matters is said in ours
    try:
        try:
            code = _invoke(arguments)
            sys.stdout.flush()
            return code
        except DsdError as error:
            return _fail(str(error), error.exit_code)
        except _USAGE_ERROR as error:
            return _fail(_usage(error), 2)
        except typer.Abort:
            return INTERRUPTED
        except BrokenPipeError:
            raise
        except OSError as error:
            return _fail(f"{error.filename or 'input or output'}: {error.strerror or error}", 1)
        except MemoryError as error:
            what = f"not enough memory: {error}" if str(error) else "not enough memory"
            return _fail(f"{what}: take a shorter log, a shorter window or fewer states", 1)
        except Exception as error:
            if (ended := _ended_behind(error)) is not None:
                return 128 + ended.number
            if isinstance(error, ImportError) and _memory_is_limited():
                return _fail(f"not enough memory to load a library ({error}): raise the limit of memory (ulimit -v)", 1)
            return _fail_unexpectedly(error)
    except BrokenPipeError:
        return _leave_pipe()
    except SystemExit as leaving:  # rich's answer to a closed pipe
        if isinstance(leaving.__context__, BrokenPipeError):
            return _leave_pipe()
        raise
    except Ended as ended:
        return 128 + ended.number
    except KeyboardInterrupt:
        return INTERRUPTED


def _memory_is_limited() -> bool:
    try:
        import resource
    except ImportError:  # Windows
        return False
    return resource.getrlimit(resource.RLIMIT_AS)[0] != resource.RLIM_INFINITY


def _ended_behind(error: BaseException | None) -> Ended | None:
    """The signal whose handling failed with this error, in a library that was interrupted at a bad moment."""
    while error is not None and not isinstance(error, Ended):
        error = error.__context__
    return error


def _invoke(arguments: list[str]) -> int:
    group = get_command(app)
    use_plain_coercion(group)
    if (wanted := os.environ.get(COMPLETE)) is not None:
        from typer.completion import shell_complete

        return shell_complete(group, {}, "dsd", COMPLETE, wanted)
    if not arguments:
        with group.make_context("dsd", ["x"], resilient_parsing=True, terminal_width=width_of(sys.stderr)) as context:
            typer.echo(group.get_help(context), err=True)
        return 2
    try:
        with group.make_context("dsd", list(arguments), terminal_width=width_of(sys.stdout)) as context:
            group.invoke(context)
    except typer.Exit as leave:
        return int(leave.exit_code)
    return 0


#: (command, option that others have) -> why it has none.
_ELSEWHERE = {
    ("compare", "--hold"): "--hold: compare fits nothing, the model is as the config has it in any case",
    ("check", "--hold"): "--hold: check judges what is identifiable from the log alone; improve takes --hold",
    **{
        (
            "check",
            option,
        ): f"{option}: check judges what is identifiable from the log alone; diagnose, add and improve take {option}"
        for option in ("--prior", "--fix", "--bounds")
    },
}


def _usage(error: Exception) -> str:
    """What the parser complains about, as one line with the way to the help."""
    text = " ".join(error.format_message().split()).rstrip(".").replace("Value error, ", "")  # type: ignore[attr-defined]
    context = getattr(error, "ctx", None)
    if why := _ELSEWHERE.get((context.info_name if context else "", getattr(error, "option_name", ""))):
        return why
    if text.startswith("Missing argument") and context:
        wanted = [param.metavar for param in context.command.params if param.param_type_name == "argument"]
        text += f" (of {' '.join(wanted)})" if len(wanted) > 1 and all(wanted) else ""
    return f"{text}: see '{context.command_path if context else 'dsd'} --help'"


def _fail(line: str, code: int) -> int:
    with _room_or_not():
        sys.stdout.flush()
    with _room_or_not():
        print("dsd: error:", printable(line), file=sys.stderr)
    return code


@contextmanager
def _room_or_not() -> Iterator[None]:
    """A disk that is full may be the very thing that is to be said, and stderr may be on it too."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError:
        return


def _fail_unexpectedly(error: Exception) -> int:
    if os.environ.get("DSD_DEBUG") == "1":
        import traceback

        traceback.print_exception(error)
    what = f"unexpected {type(error).__name__}: {error}"
    return _fail(f"{what}: please report this, with the output of the same command under DSD_DEBUG=1", 1)


def _leave_pipe() -> int:
    """Nobody reads stdout any more: give what is still buffered to the null device, so that the exit is quiet."""
    null = os.open(os.devnull, os.O_WRONLY)
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            os.dup2(null, stream.fileno())
    return CLOSED_PIPE
