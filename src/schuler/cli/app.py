"""The program: its commands, and what becomes of errors."""

from __future__ import annotations

import errno
import os
import re
import sys
import warnings
from collections.abc import Sequence
from contextlib import suppress
from io import TextIOWrapper

from cyclopts import App, Parameter
from cyclopts.exceptions import CycloptsError

from schuler import __version__
from schuler.cli.console import MANNERS, say
from schuler.cli.options.groups import OPTIONS
from schuler.cli.registry import help_line, verbs
from schuler.errors import InputError, SchulerError
from schuler.execution.progress import behave

_NEGATIVE = re.compile(r"-\.?\d")
GOOD, FAILED_CHECK, BAD_INPUT, BUG, INTERRUPTED = 0, 1, 2, 70, 130
EPILOGUE = (
    "With every command: --quiet (no tables, no progress), --verbose (every step), --no-color, "
    "--force (write over files that exist).\n\n"
    "Exit codes: 0 all is well, 1 a check failed, 2 bad input (one line on stderr says why)."
)


def _show_default(value: object) -> object:
    """Hide the defaults that say nothing: no, none, and empty."""
    return None if value in (None, False, (), "") else value


def program(arguments: Sequence[str]) -> App:
    """Return the program with its verbs; only the one that is called is imported."""
    app = App(
        name="schuler",
        version=__version__,
        help="MEMS inertial sensors: error models, and GNSS/INS with honest uncertainty.",
        help_epilogue=EPILOGUE,
        help_format="plaintext",  # a list of single lines: markdown would only cost its import
        default_parameter=Parameter(negative=(), show_default=_show_default),
        group_parameters=OPTIONS,
        suppress_keyboard_interrupt=False,
    )
    paths = verbs()
    listed = not arguments or arguments[0] not in paths
    for name, path in paths.items():
        line = help_line(path) if listed else None
        app.command(path, name=name, help=line, help_format="markdown")
    app.register_install_completion_command(help="Complete verbs and options in your shell.")
    return app


def run(arguments: Sequence[str]) -> int:
    """Run one command and turn every error into one line; nothing temporary is left behind."""
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w")  # noqa: SIM115, PTH123 (until the end)
    if sys.stdout is None:
        return _bad_input("standard output is closed; > /dev/null hides what is printed")
    try:
        return _run(arguments)
    finally:
        output_file = sys.modules.get("schuler.output_file")
        if output_file is not None:
            output_file.release_all()


def _run(arguments: Sequence[str]) -> int:
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            # A terminal that cannot show a letter shows its escape; that must not end the run.
            stream.reconfigure(errors="backslashreplace")
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _show_warning
            arguments = _behave(arguments)
            code = _imported(program(arguments), arguments)(
                _joined(arguments),
                exit_on_error=False,
                print_error=False,
                result_action="return_value",
            )
            sys.stdout.flush()
        return code if isinstance(code, int) else GOOD
    except CycloptsError as error:
        return _bad_input(_words(error), arguments)
    except SchulerError as error:
        return _bad_input(str(error))
    except KeyboardInterrupt:
        say("interrupted; nothing was written")
        return INTERRUPTED
    except BrokenPipeError:
        # The reader of our output is gone (as in `| head`): not an error, but stop quietly.
        _forget_stdout()
        return GOOD
    except OSError as error:
        if error.errno is None:  # not of the operating system, so not the user's doing
            return _bug(error)
        if error.errno in (errno.ENOSPC, errno.EIO) and not error.filename:
            _forget_stdout()  # files of ours name themselves
            return _bad_input(f"standard output cannot be written ({error.strerror})")
        place = f"{error.filename}: " if error.filename else ""
        return _bad_input(f"{place}{error.strerror or error}")
    except MemoryError:
        return _bad_input("not enough memory for this input; cut it into parts")
    except Exception as error:
        return _bug(error)


def _forget_stdout() -> None:
    """Send what is still to be printed nowhere, so that nothing fails a second time at exit."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _behave(arguments: Sequence[str]) -> list[str]:
    """Take what every command understands out of its arguments."""
    given = {name: f"--{name}" in arguments for name in ("quiet", "verbose", "no-color", "force")}
    if given["quiet"] and given["verbose"]:
        raise InputError("--quiet and --verbose together", expected="one of them")
    MANNERS.quiet, MANNERS.no_color = given["quiet"], given["no-color"]
    MANNERS.force = given["force"]
    behave("quiet" if given["quiet"] else "verbose" if given["verbose"] else "usual")
    return [a for a in arguments if not (a.startswith("--") and given.get(a[2:]))]


def check(arguments: Sequence[str], where: str) -> None:
    """Raise when a command would not be understood; nothing is done."""
    try:
        _imported(program(arguments), arguments).parse_args(
            _joined(_behave(arguments)), exit_on_error=False, print_error=False
        )
    except CycloptsError as error:
        raise InputError(_words(error).rstrip("."), where=where) from None


def _imported(app: App, arguments: Sequence[str]) -> App:
    """Return the program when the verb that is called can be imported."""
    path = verbs().get(arguments[0]) if arguments else None
    if path is None:
        return app
    try:
        app[arguments[0]]
    except Exception as error:
        if path.startswith("schuler."):
            raise
        raise InputError(
            f"the verb '{arguments[0]}' of another package ({path}) cannot be used: {error}",
            expected="a function that can be imported",
        ) from error
    return app


def _bug(error: Exception) -> int:
    if os.environ.get("SCHULER_DEBUG"):
        raise error
    say(f"a bug in schuler: {type(error).__name__}: {error}; SCHULER_DEBUG=1 shows where")
    return BUG


def _joined(arguments: Sequence[str]) -> list[str]:
    """Join `--json -` and `--lever-arm -1,0,0`, whose values look like options, by `=`."""
    joined: list[str] = []
    for argument in arguments:
        before = joined[-1] if joined else ""
        named = before.startswith("--") and "=" not in before and before != "--"
        if named and (_NEGATIVE.match(argument) or (argument, before) == ("-", "--json")):
            joined[-1] = f"{before}={argument}"
        else:
            joined.append(argument)
    return joined


def _bad_input(message: str, arguments: Sequence[str] = ()) -> int:
    command = arguments[0] if arguments and not arguments[0].startswith("-") else ""
    hint = ""
    if arguments:
        known = command in verbs()
        hint = f" (see schuler {command} --help)" if known else " (see schuler --help)"
    say(message.rstrip(".") + hint)
    return BAD_INPUT


def _words(error: CycloptsError) -> str:
    text = str(error).replace('"', "'")
    return text[:1].lower() + text[1:]


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: object = None,
    line: str | None = None,
) -> None:
    """Show a warning as one line, without the place in the source that means nothing to a user."""
    say(f"note: {message}")
