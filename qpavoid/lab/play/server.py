"""The page and its WebSocket, on loopback unless told otherwise."""

import asyncio
import json
from contextlib import suppress
from pathlib import Path
from urllib.parse import urlsplit

from qpavoid.compiled import PACKAGE
from qpavoid.errors import InvalidInputError, MissingExtraError, QPAvoidError
from qpavoid.lab.play.loop import FRAME_TIME, Loop
from qpavoid.lab.play.messages import MOST_BYTES, Drag, Release, Set, read_message
from qpavoid.lab.play.session import Session

try:
    from aiohttp import WSCloseCode, WSMsgType, web
    from aiohttp.typedefs import Handler
except ImportError:
    raise MissingExtraError("The page's server, aiohttp,", "play") from None

LOOPBACK = ("127.0.0.1", "::1", "localhost")

GONE = 10.0
"""s; a client that takes nothing for so long is dropped."""

HERE = Path(__file__).parent
REPORT = PACKAGE / "lab" / "study" / "report"
OWN = ("form.js", "hands.js", "play.js", "play.css")
SHARED = ("style.css", "pen.js", "panels.js", "charts.js")
PAGES = {
    "/": HERE / "page.html",
    **{f"/{name}": HERE / name for name in OWN},
    **{f"/{name}": REPORT / name for name in SHARED},
}

LOOP = web.AppKey("loop", Loop)
CLIENTS = web.AppKey("clients", set[web.WebSocketResponse])


def serve(
    config: str,
    controller: str = "qp-ahead",
    host: str = "127.0.0.1",
    port: int = 8008,
    allow_remote: bool = False,
    data: str | None = None,
) -> None:
    """Serve the page until it is interrupted; the clock starts with the first client.

    Args:
        config: Path of a scenario file, or its shipped name.
        controller: Name of the controller that drives first.
        host: Name or address to bind.
        port: Port; 0: any free one.
        allow_remote: Let other machines in. Whoever reaches the page can drive it.
        data: Folder of published data sets, where the scenario needs one.

    Raises:
        InvalidInputError: The host is not loopback and that was not allowed, or the
            port cannot be had.
        UnknownNameError: No controller or scenario of that name.
        ConfigError: The scenario file is not valid.
    """
    check_host(host, allow_remote)
    loop = Loop(Session(config, controller, data))
    with suppress(KeyboardInterrupt):
        try:
            asyncio.run(_serve(loop, host, port, allow_remote))
        finally:
            loop.stop()


def check_host(host: str, allow_remote: bool) -> None:
    """Raise InvalidInputError for a host that other machines could reach."""
    if host not in LOOPBACK and not allow_remote:
        raise InvalidInputError(
            f"{host!r} can be reached from other machines, and whoever reaches the "
            f"page can drive it; use one of {', '.join(LOOPBACK)}, or --allow-remote"
        )


async def _serve(loop: Loop, host: str, port: int, allow_remote: bool) -> None:
    """Bind, say where, and serve until cancelled."""
    app = make_app(loop, allow_remote)
    runner = web.AppRunner(app, access_log=None, shutdown_timeout=1.0)
    await runner.setup()
    try:
        try:
            await web.TCPSite(runner, host, port).start()
        except (OSError, OverflowError) as error:
            raise InvalidInputError(
                f"cannot serve on {host}, port {port} ({error}); "
                "choose another with --port"
            ) from None
        name = f"[{host}]" if ":" in host else host
        print(f"http://{name}:{runner.addresses[0][1]}/   Ctrl-C ends", flush=True)
        await asyncio.Event().wait()
    finally:
        await runner.cleanup()


def make_app(loop: Loop, allow_remote: bool = False) -> web.Application:
    """Return the application that shows a loop to browsers."""

    @web.middleware
    async def own_pages_only(
        request: web.Request, handler: Handler
    ) -> web.StreamResponse:
        _check_origin(request, allow_remote)
        return await handler(request)

    app = web.Application(middlewares=[own_pages_only])
    app[LOOP], app[CLIENTS] = loop, set()
    for address in PAGES:
        app.router.add_get(address, _page)
    app.router.add_get("/recording.toml", _recording)
    app.router.add_get("/live", _live)
    app.on_response_prepare.append(_no_strangers)
    app.on_shutdown.append(_close_all)
    return app


def _check_origin(request: web.Request, allow_remote: bool) -> None:
    """Refuse pages of others, also those whose name was bound to this machine."""
    try:
        host = urlsplit(f"//{request.host}").hostname
        origin = request.headers.get("Origin")
        own = origin is None or urlsplit(origin).netloc == request.host
    except ValueError:
        host, own = None, False
    if not own or (host not in LOOPBACK and not allow_remote):
        raise web.HTTPForbidden(text="this page is served to itself only")


async def _no_strangers(request: web.Request, response: web.StreamResponse) -> None:
    response.headers["Content-Security-Policy"] = (
        "default-src 'self'; img-src data:; frame-ancestors 'none'"
    )
    response.headers["X-Content-Type-Options"] = "nosniff"
    response.headers["Cache-Control"] = "no-store"


async def _close_all(app: web.Application) -> None:
    clients: set[web.WebSocketResponse] = app[CLIENTS]
    for client in tuple(clients):
        await client.close(code=WSCloseCode.GOING_AWAY, message=b"the server ends")


async def _page(request: web.Request) -> web.FileResponse:
    return web.FileResponse(PAGES[request.path])


async def _recording(request: web.Request) -> web.Response:
    text = await asyncio.to_thread(request.app[LOOP].recording)
    if not text:
        raise web.HTTPNotFound(text="nothing has been recorded yet")
    return web.Response(
        text=text,
        content_type="application/toml",
        headers={"Content-Disposition": 'attachment; filename="recording.toml"'},
    )


async def _live(request: web.Request) -> web.WebSocketResponse:
    """Talk with one client until it is gone."""
    client = web.WebSocketResponse(
        max_msg_size=MOST_BYTES, heartbeat=GONE, compress=False
    )
    await client.prepare(request)
    loop, clients = request.app[LOOP], request.app[CLIENTS]
    clients.add(client)
    loop.start()
    showing = asyncio.create_task(_show(loop, client))
    try:
        await _listen(loop, client)
    finally:
        showing.cancel()
        clients.discard(client)
    return client


async def _show(loop: Loop, client: web.WebSocketResponse) -> None:
    """Send what is new, at the client's own pace; what it missed is gone."""
    seen = [0, 0]
    with suppress(ConnectionError, TimeoutError):
        while True:
            for i, (number, text) in enumerate((loop.world, loop.frame)):
                if number != seen[i]:
                    seen[i] = number
                    await asyncio.wait_for(client.send_str(text), GONE)
            await asyncio.sleep(FRAME_TIME / 4)
    with suppress(ConnectionError):
        await client.close()


async def _listen(loop: Loop, client: web.WebSocketResponse) -> None:
    """Do what a client says; tell it alone what cannot be done."""
    held: set[int] = set()
    try:
        async for message in client:
            if message.type is not WSMsgType.TEXT:
                await _complain(client, "", "only text messages are understood")
                continue
            await _obey(loop, client, message.data, held)
    finally:
        loop.let_go(held)


async def _obey(
    loop: Loop, client: web.WebSocketResponse, text: str, held: set[int]
) -> None:
    """Do one message; ``held`` are the discs that the client has in hand."""
    about = ""
    try:
        message = read_message(text)
        about = f"{message.section}.{message.key}" if isinstance(message, Set) else ""
        await asyncio.to_thread(loop.do, message)
    except QPAvoidError as error:
        await _complain(client, about, str(error))
        return
    if isinstance(message, Drag):
        held.add(message.disc)
    elif isinstance(message, Release):
        held.discard(message.disc)


async def _complain(client: web.WebSocketResponse, about: str, what: str) -> None:
    with suppress(ConnectionError):
        await client.send_str(
            json.dumps({"kind": "error", "about": about, "message": what})
        )
