"""What the window answers to, and whom: its own page, by the token, on this machine."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from functools import wraps
from importlib.resources import files
from secrets import compare_digest
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp, Receive, Scope, Send

from schuler.errors import InputError, SchulerError
from schuler.report.page import plotly_script
from schuler.view.folder import Folder
from schuler.view.jobs import Jobs, reading
from schuler.view.series import Shelf

MOST_BYTES = 1 << 16
"""Of the body of a request."""
_HEADERS = {
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
_OURS = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; connect-src 'self'; "
    "img-src 'self' data: blob:; frame-src 'self'; frame-ancestors 'none'; base-uri 'none'; "
    "form-action 'none'"
)
_THEIRS = (
    "sandbox allow-scripts allow-downloads; default-src 'none'; script-src 'unsafe-inline'; "
    "style-src 'unsafe-inline'; img-src data: blob:; font-src data:; frame-ancestors 'self'; "
    "base-uri 'none'; form-action 'none'"
)
"""For pages of the folder: they can show themselves, and reach nothing."""


class Guard:
    """Lets only requests of the window's own page through.

    Parameters
    ----------
    app : ASGI application
        What is guarded.
    token : str
        The secret that the address of the window holds.
    port : int
        Where it listens.
    """

    def __init__(self, app: ASGIApp, token: str, port: int) -> None:
        self._app = app
        self._token = token.encode()
        self._hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}
        self._cookie = cookie_name(port)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or refuse."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        if scope["type"] == "http":
            refused = self._refused(Request(scope))
            answer = self._app if refused is None else PlainTextResponse(refused, 403, _HEADERS)
            await answer(scope, receive, send)

    def _refused(self, request: Request) -> str | None:
        hosts = request.headers.getlist("host")
        if len(hosts) != 1 or hosts[0] not in self._hosts:
            return "this window is not called so"
        origin = request.headers.get("origin")
        if origin is not None and origin not in {f"http://{h}" for h in self._hosts}:
            return "another page asks"
        if request.method not in ("GET", "HEAD") and origin is None:
            return "a request without an origin"
        given = request.cookies.get(self._cookie, "")
        if request.url.path == "/" and "token" in request.query_params:
            given = request.query_params["token"]
        if not compare_digest(given.encode(), self._token):
            return "open the address that `schuler view` printed: its token is missing or old"
        return None


def cookie_name(port: int) -> str:
    """Return the name of the cookie; windows of other ports have their own."""
    return f"schuler-view-{port}"


def application(
    folder: Folder, jobs: Jobs, token: str, port: int, words: Callable[[str], str] = str
) -> ASGIApp:
    """Return the guarded application.

    Parameters
    ----------
    folder : Folder
        What is shown.
    jobs : Jobs
        What is done.
    token : str
        Secret of this window.
    port : int
        Where it listens.
    words : callable
        Puts errors into the words of the reader.
    """
    shelf = Shelf()

    def answered(function: Callable[[Mapping[str, Any]], Any]) -> Callable[..., Any]:
        """Make an endpoint of a function of what is asked; errors are one line."""

        @wraps(function)
        async def endpoint(request: Request) -> Response:
            try:
                found = await run_in_threadpool(function, await _asked(request))
            except SchulerError as error:
                return JSONResponse({"error": words(str(error))}, 400, _HEADERS)
            except OSError as error:
                return JSONResponse({"error": error.strerror or str(error)}, 400, _HEADERS)
            return found if isinstance(found, Response) else JSONResponse(found, headers=_HEADERS)

        return endpoint

    def listing(asked: Mapping[str, Any]) -> Any:
        return folder.listing() | {"folder": folder.root.name}

    def recording(asked: Mapping[str, Any]) -> Any:
        return shelf.series(folder.path(asked.get("file")), reading(asked)).facts()

    def series(asked: Mapping[str, Any]) -> Any:
        shown = shelf.series(folder.path(asked.get("file")), reading(asked))
        try:
            start, stop = float(asked["start"]), float(asked["stop"])
        except (KeyError, ValueError):
            raise InputError("no stretch of time", expected="start and stop in s") from None
        return shown.window(start, stop)

    def page(asked: Mapping[str, Any]) -> Response:
        content = folder.page(asked.get("file")).read_bytes()
        return _file(content, "text/html", _THEIRS)

    def start(asked: Mapping[str, Any]) -> Any:
        return jobs.start(asked).shown()

    def stop(asked: Mapping[str, Any]) -> Any:
        jobs.stop(int(asked["number"]) if str(asked.get("number")).isdecimal() else 0)
        return jobs.shown()

    get = {"/api/files": listing, "/api/recording": recording, "/api/series": series,
           "/api/jobs": lambda asked: jobs.shown(), "/page": page}  # fmt: skip
    post = {"/api/jobs": start, "/api/stop": stop}
    routes = [Route(path, answered(call)) for path, call in get.items()]
    routes += [Route(path, answered(call), methods=["POST"]) for path, call in post.items()]
    routes += [Route("/", _door(token, port)), Route("/assets/{name}", _asset)]
    return Guard(Starlette(routes=routes), token, port)


async def _asked(request: Request) -> Mapping[str, Any]:
    """Return what a request asks for: its query, or the JSON that it carries."""
    if request.method != "POST":
        return dict(request.query_params)
    body = b""
    async for part in request.stream():
        body += part
        if len(body) > MOST_BYTES:
            raise InputError("too much is asked at once")
    try:
        asked = json.loads(body)
    except ValueError:
        asked = None
    if not isinstance(asked, dict):
        raise InputError("a request that is no JSON", expected="an object")
    return asked


def _door(token: str, port: int) -> Callable[[Request], Response]:
    """Return the way in: the token of the address becomes a cookie, and leaves the address."""

    def door(request: Request) -> Response:
        if "token" not in request.query_params:
            return _asset_named("view.html")
        answer = RedirectResponse("/", 303, _HEADERS)
        answer.set_cookie(cookie_name(port), token, httponly=True, samesite="strict")
        return answer

    return door


def _asset(request: Request) -> Response:
    return _asset_named(request.path_params["name"])


def _asset_named(name: str) -> Response:
    if name == "plotly.js":
        return _file(plotly_script().encode(), "text/javascript", _OURS)
    kinds = {"view.html": "text/html", "view.js": "text/javascript", "view.css": "text/css"}
    if name not in kinds:
        return PlainTextResponse("there is no such file", 404, _HEADERS)
    content = (files("schuler.view") / "assets" / name).read_bytes()
    return _file(content, kinds[name], _OURS)


def _file(content: bytes, kind: str, policy: str) -> Response:
    headers = _HEADERS | {"Content-Security-Policy": policy}
    return Response(content, media_type=f"{kind}; charset=utf-8", headers=headers)
