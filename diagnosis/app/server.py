"""The server of the page: this machine's browser alone, with a token, and nothing loaded from elsewhere."""

from __future__ import annotations

import secrets
import socket
import webbrowser
from collections.abc import Callable
from hmac import compare_digest
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from shared.console import OK, NotNegative, new_console
from shared.errors import ZeroshotError
from shared.shipped import USUAL

if TYPE_CHECKING:
    from bokeh.server.auth_provider import AuthProvider
    from bokeh.server.server import Server

    from diagnosis.app.job import Job
    from diagnosis.app.project import Project

ADDRESS = "127.0.0.1"
_CLOSED = "/closed"


def app(
    folder: Path = Path("room"),
    *,
    system: Path | None = None,
    port: NotNegative = 0,
    browser: Annotated[bool, Parameter(negative="--no-browser")] = True,
) -> int:
    """Open a page in the browser that leads from a file of measurements to a diagnosis.

    The page and all files stay on this machine. The address that is printed has a token, without which nobody gets in.
    Ctrl-C ends it.

    Parameters
    ----------
    folder
        Where everything is kept: go on with it by giving it again.
    system
        System description (TOML), its folder, or the name of one that comes with the package; if not given,
        MixedAirCO2.
    port
        Port of the page; any that is free, if 0.
    browser
        Whether the browser is opened.
    """
    console = new_console()

    def ready(address: str) -> None:
        console.print(f"{address}\nFiles are kept in {folder.resolve()}. Ctrl-C ends the page.", soft_wrap=True)

    serve(folder, system, port=port, browser=browser, ready=ready)
    return OK


def serve(
    folder: Path | str,
    system: Path | str | None = None,
    *,
    port: int = 0,
    browser: bool = True,
    ready: Callable[[str], None] = lambda _: None,
) -> None:
    """Serve the page until the process is interrupted.

    Parameters
    ----------
    folder, system, port, browser
        As of the command, :func:`app`.
    ready
        Is told the page's address when it can be opened.

    Raises
    ------
    ZeroshotError
        If folder, description or port cannot be used, or panel is not installed.
    """
    from diagnosis.app.project import Project

    project = Project(folder, system or USUAL)
    jobs: dict[str, Job] = {}
    server, address = page_server(project, jobs, port)
    # everybody on the machine can read the browser's command line, and only this user the file that it names
    door = project.folder / ".open.html"
    try:
        server.start()
        ready(address)
        if browser:
            door.touch(mode=0o600)
            door.write_text(f'<meta http-equiv="refresh" content="0;url={address}">', encoding="utf-8")
            server.io_loop.add_callback(webbrowser.open, door.as_uri())
        server.io_loop.start()
    finally:
        door.unlink(missing_ok=True)
        if "job" in jobs:
            jobs["job"].stop()
        server.stop()


def page_server(project: Project, jobs: dict[str, Job], port: int = 0) -> tuple[Server, str]:
    """A server that is not started yet, and the page's address with its token."""
    try:
        import panel as pn
    except ModuleNotFoundError:
        raise ZeroshotError("the page needs panel, which is not installed: pip install 'zeroshot-fmu[app]'") from None
    from diagnosis.app.page import CSS, POLL, Page

    port, token = _free(port), secrets.token_urlsafe(24)
    pn.extension("filedropper", raw_css=[CSS], notifications=False)

    def page() -> Any:
        view = pn.Column(sizing_mode="stretch_width", margin=(8, 8))

        def loaded() -> None:
            browser = pn.state.browser_info
            made = Page(project, jobs, zone=(browser and browser.timezone) or "")
            view.objects = [made.view]
            pn.state.add_periodic_callback(made.poll, period=POLL)
            if browser is not None:
                browser.param.watch(lambda event: made.guess_clock(event.new or ""), "timezone")

        pn.state.onload(loaded)
        return view

    server = pn.io.server.get_server(
        {"/": page},
        port=port,
        address=ADDRESS,
        websocket_origin=[f"{ADDRESS}:{port}"],
        title=f"Diagnosis of {project.described.name}",
        auth_provider=_only_with(token, port),
    )
    return server, f"http://{ADDRESS}:{port}/?token={token}"


def _free(port: int) -> int:
    """A port that nobody listens at: the one that is asked for, or any if that is 0."""
    with socket.socket() as probe:
        try:
            probe.bind((ADDRESS, port))
        except (OSError, OverflowError):
            raise ZeroshotError(
                f"port: {port} cannot be had on {ADDRESS}; expected one from 1024 to 65535 that nothing listens at, or"
                " 0 for any that is free"
            ) from None
        return int(probe.getsockname()[1])


def _only_with(token: str, port: int) -> AuthProvider:
    """Lets in who names the token in the address, and knows him by a cookie from then on."""
    from bokeh.server.auth_provider import AuthProvider
    from tornado.web import RequestHandler
    from tornado.websocket import WebSocketHandler

    cookie = f"diagnosis-{port}"

    class Closed(RequestHandler):
        def get(self) -> None:
            self.set_status(403)
            self.finish("This page opens with the address that the command printed, its token included.")

    class Token(AuthProvider):
        login_url = _CLOSED
        get_login_url = None
        login_handler = Closed
        logout_url = None
        logout_handler = None
        get_user_async = None

        @property
        def get_user(self) -> Any:
            def user(handler: RequestHandler) -> str | None:
                named = handler.get_query_argument("token", "")
                if named and compare_digest(named.encode(), token.encode()):
                    if not isinstance(handler, WebSocketHandler):
                        handler.set_cookie(cookie, token, httponly=True, samesite="Strict")
                    return "user"
                return "user" if compare_digest((handler.get_cookie(cookie) or "").encode(), token.encode()) else None

            return user

    return Token()
