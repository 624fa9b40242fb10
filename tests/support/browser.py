"""A real browser for the tests of pages: Chromium, through playwright."""

import os
import shutil
from contextlib import contextmanager
from urllib.parse import urlsplit

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


@contextmanager
def chromium():
    """A headless Chromium; the test is skipped where there is none."""
    sync_api = pytest.importorskip(
        "playwright.sync_api", reason="no playwright: pip install 'qpavoid[test]'"
    )
    path = os.environ.get("QPAVOID_CHROMIUM") or next(
        filter(None, map(shutil.which, NAMES)), None
    )
    if path is None:
        pytest.skip(f"no Chromium: none of {', '.join(NAMES)}; set QPAVOID_CHROMIUM")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=FLAGS)
        yield browser
        browser.close()


@contextmanager
def opened(browser, url, width=1280, height=900, dark=False, errors_allowed=False):
    """A page at a URL; it must say no errors and ask nobody but its own server."""
    scheme = "dark" if dark else "light"
    context = browser.new_context(
        viewport={"width": width, "height": height}, color_scheme=scheme
    )
    page, errors, outside = context.new_page(), [], []

    def said(message):
        if message.type in ("error", "warning"):
            errors.append(message.text)

    def asked(request):
        if request.url.startswith(("data:", "blob:", "about:")):
            return
        own, other = urlsplit(url), urlsplit(request.url)
        served = own.netloc and own.netloc == other.netloc
        if not served and request.url != url.partition("#")[0]:
            outside.append(request.url)

    page.on("console", said)
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("request", asked)
    page.goto(url)
    yield page
    context.close()
    assert errors_allowed or errors == [], errors
    assert outside == [], outside
