"""The window opens: a socket on this machine alone, and an address with a secret in it."""

from __future__ import annotations

import errno
import secrets
import socket
import webbrowser
from collections.abc import Callable
from pathlib import Path
from threading import Timer

from schuler.data.exportable import optional
from schuler.errors import InputError
from schuler.view.folder import Folder
from schuler.view.jobs import Jobs

HOST = "127.0.0.1"


def serve(
    folder: Path,
    *,
    port: int = 0,
    browser: bool = True,
    told: Callable[[str], None] = print,
    words: Callable[[str], str] = str,
) -> None:
    """Show a folder in the browser until interrupted.

    Parameters
    ----------
    folder : Path
        An existing folder.
    port : int
        Where to listen; 0: any that is free.
    browser : bool
        Open the browser.
    told : callable
        Is told the address.
    words : callable
        Puts errors into the words of the reader.
    """
    uvicorn = optional("uvicorn", "view")
    optional("starlette", "view")
    from schuler.view.app import application

    shown = Folder(folder)
    with _socket(port) as listening:
        port = listening.getsockname()[1]
        token = secrets.token_urlsafe(32)
        jobs = Jobs(shown)
        app = application(shown, jobs, token, port, words)
        address = f"http://{HOST}:{port}/?token={token}"
        told(address)
        if browser:
            Timer(0.5, webbrowser.open, (address,)).start()
        how = uvicorn.Config(
            app, log_level="error", access_log=False, server_header=False, ws="none",
            lifespan="off", timeout_graceful_shutdown=1,
        )  # fmt: skip
        try:
            uvicorn.Server(how).run(sockets=[listening])
        except KeyboardInterrupt:
            pass
        finally:
            jobs.close()


def _socket(port: int) -> socket.socket:
    """Return a socket that listens on this machine alone."""
    if not 0 <= port <= 65535:
        raise InputError(f"port {port}", expected="0 to 65535, 0 for any that is free")
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    if hasattr(socket, "SO_EXCLUSIVEADDRUSE"):  # Windows: nobody else may listen there
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_EXCLUSIVEADDRUSE, 1)
    else:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((HOST, port))
        listening.listen(64)
    except OSError as error:
        listening.close()
        why = (
            "is in use" if error.errno == errno.EADDRINUSE else f"cannot be used ({error.strerror})"
        )
        raise InputError(f"port {port} {why}", cure="name another, or --port 0") from None
    return listening
