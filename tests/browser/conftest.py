"""A running server, a Chromium that draws WebGL in software, and pages that tell what went wrong in them."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, BrowserContext, Error, Page, expect, sync_playwright

from tests.browser.serving import Server

ARTIFACTS = Path(__file__).resolve().parents[2] / "test-artifacts"
FLAGS = [
    "--headless=new",
    # As on a machine without a graphics card: the processor draws the page, and WebGL by SwiftShader.
    "--enable-unsafe-swiftshader",
    "--no-sandbox",
    "--disable-quic",
    "--disable-background-networking",
]
# On a machine that is busy a page takes its time.
expect.set_options(timeout=120_000)
SIZE = {"width": 1280, "height": 720}
#: A mission with two vehicles that takes a second or two.
FIRST_LOOK = {"scenario": "first-look", "trials": 3, "algorithms": ["dead_reckoning", "cekf", "nekf"]}
SOLO = {"scenario": "first-look", "trials": 1, "algorithms": ["cekf"]}


def chromium() -> str:
    """The Chromium to drive; the tests fail where there is none."""
    named = os.environ.get("COOPNAV_CHROMIUM")
    names = [named] if named else ["chromium", "chromium-browser", "google-chrome"]
    found = next(filter(None, map(shutil.which, names)), None)
    if found is None:
        pytest.fail("no Chromium found: install one, or name it in COOPNAV_CHROMIUM (make browser does it)")
    return found


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker(pytest.mark.browser)
    # Last: Playwright leaves an event loop running, in which no other test could start its own.
    items.sort(key=lambda item: item.get_closest_marker("browser") is not None)


@pytest.fixture(scope="session")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    server = Server(tmp_path_factory.mktemp("data"))
    server.start()
    yield server
    server.stop()


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium(), args=FLAGS)
        yield browser
        browser.close()


class Watch:
    """Collects what a page should not do: errors on its console, requests to other hosts.

    A refusal that a test provokes is no fault of the page; such a test names its status in `refusals`.
    """

    def __init__(self) -> None:
        self.errors: list[str] = []
        self.hosts: set[str] = set()
        self.refusals: set[int] = set()

    def over(self, context: BrowserContext) -> None:
        context.on("console", lambda message: message.type == "error" and self.errors.append(message.text))
        context.on("weberror", lambda error: self.errors.append(str(error.error)))
        context.on("request", lambda request: self._request(request.url))

    def _request(self, url: str) -> None:
        found = re.match(r"(?:https?|wss?)://([^/]+)", url)
        if found:
            self.hosts.add(found[1])

    @property
    def faults(self) -> list[str]:
        expected = [f"the server responded with a status of {status}" for status in self.refusals]
        return [e for e in self.errors if not any(words in e for words in expected)]


@contextmanager
def window(browser: Browser, server: Server, watch: Watch, **kind: Any) -> Iterator[BrowserContext]:
    """A browser window on the server, at the end of which nothing may have gone wrong in its pages.

    `kind` is what Playwright's contexts are given: viewport, has_touch, …
    """
    toured = {"origin": server.url, "localStorage": [{"name": "coopnav.tour", "value": "seen"}]}
    before = {"cookies": [], "origins": [toured]}
    context = browser.new_context(**{"viewport": SIZE} | kind, base_url=server.url, storage_state=before)  # type: ignore[arg-type]
    context.set_default_timeout(60_000)
    watch.over(context)
    yield context
    context.close()
    assert watch.faults == []
    assert watch.hosts <= {server.url.removeprefix("http://")}


@pytest.fixture
def watch() -> Watch:
    return Watch()


@pytest.fixture
def context(browser: Browser, server: Server, watch: Watch) -> Iterator[BrowserContext]:
    with window(browser, server, watch) as context:
        yield context


@pytest.fixture
def page(context: BrowserContext) -> Page:
    return context.new_page()


@pytest.fixture(scope="session")
def run(server: Server) -> str:
    """Id of a finished run of the first mission."""
    return server.finished(FIRST_LOOK)


@pytest.fixture(scope="session")
def solo(server: Server) -> str:
    """Id of a finished run of one estimator."""
    return server.finished(SOLO)


@pytest.fixture(scope="module")
def _opened(request: pytest.FixtureRequest, browser: Browser, server: Server, run: str) -> Iterator[Page]:
    with window(browser, server, Watch()) as context:
        page = context.new_page()
        page.goto(f"/#run={run}{getattr(request.module, 'LAYOUT', '')}")
        yield page


@pytest.fixture
def opened(_opened: Page, run: str) -> Page:
    """The page of this module with the finished run open, its clock at the end, its first vehicle chosen."""
    page = _opened
    page.locator("#table tbody tr").nth(5).wait_for()
    page.locator(".plot .js-line").nth(5).wait_for()
    page.mouse.move(5, 5)
    page.locator(".vehicle").first.click()
    page.locator("#stage").focus()
    page.keyboard.press("End")
    page.evaluate("document.querySelector('#stage').scrollTo(0, 0)")
    return page


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo) -> Any:
    """Keeps a screenshot of what a failed test looked at."""
    report = yield
    if report.when == "call" and report.failed:
        ARTIFACTS.mkdir(exist_ok=True)
        for page in (x for x in getattr(item, "funcargs", {}).values() if isinstance(x, Page)):
            with suppress(Error):
                page.screenshot(path=ARTIFACTS / f"failed-{item.name}.png", timeout=60_000)
    return report


@pytest.fixture
def keep(request: pytest.FixtureRequest) -> Callable[[Page], Any]:
    """Keeps a screenshot under the test's name."""
    ARTIFACTS.mkdir(exist_ok=True)
    name = request.node.name.removeprefix("test_")
    taken = 0

    def take(page: Page) -> None:
        nonlocal taken
        taken += 1
        page.bring_to_front()  # of a page behind another there may be nothing to capture
        with suppress(Error):  # a picture for people; what a test asserts is elsewhere
            page.screenshot(path=ARTIFACTS / f"{name}-{taken}.png", timeout=60_000)

    return take
