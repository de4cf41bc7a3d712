"""The command line's front door: the one place where errors become messages and exit codes.

The commands stand in the table of `cli/commands.py`.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from typing import Annotated, Any

import typer

from ahgateway import __version__
from ahgateway.apps.signs import teach_streams
from ahgateway.cli.commands import LazyGroup
from ahgateway.errors import AhGatewayError, PlcRefusedError, TransportError

REPEAT_S = 0.1

app = typer.Typer(
    cls=LazyGroup,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Runs a bit-exact copy of a Delta AH500's PID controllers beside the PLC and says whether they agree.\n\n"
    "Every command only reads, except those that say otherwise and ask for --arm.\n\n"
    "Exit codes: 0 pass, 1 a difference found, 2 usage or profile, 3 inconclusive, 4 our fault.",
)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"ahgateway {__version__}")
        raise typer.Exit


@app.callback()
def root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Options that stand before any command."""


def exit_code(error: AhGatewayError) -> int:
    """Map an error to its exit code: the link and the PLC make a run inconclusive, all else is usage."""
    return 3 if isinstance(error, TransportError | PlcRefusedError) else 2


def _ask_again(lost: Any) -> None:
    """Repeat a Ctrl-C that fell into a callback of Python's own: it is dropped there, and the command would go on."""
    if lost.exc_type is KeyboardInterrupt:
        again = threading.Timer(REPEAT_S, _interrupt)
        again.daemon = True
        again.start()
        return
    sys.__unraisablehook__(lost)


def _interrupt() -> None:
    """Send Ctrl-C to the main thread, also where it sleeps; where threads have no signals, it wakes by itself."""
    to_thread = getattr(signal, "pthread_kill", None)
    if to_thread is None:
        signal.raise_signal(signal.SIGINT)
    else:
        to_thread(threading.main_thread().ident, signal.SIGINT)


def main() -> None:
    """Run the command line; the entry point of the `ahgateway` script."""
    if sys.unraisablehook is sys.__unraisablehook__:
        sys.unraisablehook = _ask_again
    teach_streams()
    try:
        app()
    except AhGatewayError as error:
        typer.echo(f"error: {error.message if not str(error) else error}", err=True)
        if error.hint:
            typer.echo(f"\nhint: {error.hint}", err=True)
        sys.exit(exit_code(error))
    except BrokenPipeError:
        # The reader of our output went away (`| head`): nothing is left to say.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(3)
    except KeyboardInterrupt:
        typer.echo("stopped", err=True)
        sys.exit(3)
    except Exception as error:
        if os.environ.get("AHGATEWAY_DEBUG"):
            raise
        typer.echo(f"internal error: {type(error).__name__}: {error}", err=True)
        typer.echo("\nhint: this is our fault; set AHGATEWAY_DEBUG=1, run it again and report what it prints", err=True)
        sys.exit(4)


if __name__ == "__main__":
    main()
