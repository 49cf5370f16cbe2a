"""The page in a real browser without a window, and who may ask for it."""

import http.client
import json
import re
import shutil
import time
from importlib.util import find_spec
from urllib.parse import urlsplit

import pytest

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
pytestmark = [
    pytest.mark.skipif(not find_spec("panel"), reason="the extra view is not installed"),
    pytest.mark.skipif(not find_spec("selenium"), reason="selenium is not installed"),
    pytest.mark.skipif(not (CHROMIUM and DRIVER), reason="chromium and chromedriver are not installed"),
]

FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--window-size=1280,1100"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage"),
)
SECONDS = 60


@pytest.fixture(scope="module")
def page(address, tmp_path_factory):
    from selenium import webdriver  # every worker reads this file, and one of them needs it

    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for flag in (*FLAGS, f"--user-data-dir={tmp_path_factory.mktemp('profile')}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    driver.set_page_load_timeout(SECONDS)
    driver.get(address)
    until(lambda: driver.execute_script("return window.Bokeh && Bokeh.documents.length") and image(driver))
    yield driver
    driver.quit()


def until(true, seconds=SECONDS):
    """What a function gives once that is something."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        found = true()
        if found:
            return found
        time.sleep(0.1)
    pytest.fail(f"not within {seconds} s: {true}")


def image(driver):
    """The numbers of the map as the browser has them, thinned; None while there is no map."""
    return driver.execute_script("""
        for (const model of Bokeh.documents[0]._all_models.values())
            if (model.type === 'GlyphRenderer' && model.glyph.type === 'Image') {
                const found = model.data_source.data.image[0];
                if (found) return Array.from(found).filter((_, i) => i % 997 === 0).map(v => isNaN(v) ? null : v);
            }
    """)


def set_slider(driver, place):
    driver.execute_script("""
        for (const model of Bokeh.documents[0]._all_models.values())
            if (model.type.includes('Slider')) model.value = arguments[0];
    """, place)  # fmt: skip


def test_a_result_in_the_browser(page, address):
    """It loads without an error and asks no other machine; a slider shows other cells."""
    assert [entry for entry in page.get_log("browser") if entry["level"] == "SEVERE"] == []
    events = (json.loads(entry["message"])["message"] for entry in page.get_log("performance"))
    sent = [e["params"] for e in events if e["method"] == "Network.requestWillBeSent"]
    asked = {e["request"]["url"] for e in sent if e["documentURL"].startswith(address)}
    assert len(asked) > 3
    assert [url for url in asked if not url.startswith((address, "data:", "blob:"))] == []

    before = image(page)
    set_slider(page, 0)
    after = until(lambda: (now := image(page)) != before and now)
    assert sum(a != b for a, b in zip(before, after, strict=True)) > 50
    set_slider(page, 1)
    until(lambda: image(page) == before)


SWITCHED = 101
"""Protocols: to a websocket."""


def test_only_pages_of_this_machine_reach_the_server(address):
    """A page from elsewhere whose name comes to mean this machine (DNS rebinding) reads nothing, by no protocol."""
    here = urlsplit(address)

    def asked(host, path="/", **headers):
        connection = http.client.HTTPConnection(here.hostname, here.port, timeout=60)
        connection.request("GET", path, headers={"Host": host, **headers})
        answer = connection.getresponse()
        text = answer.read().decode() if answer.status != SWITCHED else ""
        connection.close()
        return answer.status, text

    status, page = asked(here.netloc)
    token = re.search(r'"token":"([^"]+)"', page)[1]
    keys = {"Sec-WebSocket-Key": "AQIDBAUGBwgJCgsMDQ4PEC==", "Sec-WebSocket-Version": "13"}
    keys |= {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Protocol": f"bokeh, {token}"}

    def answers(name):
        host, script = f"{name}:{here.port}", "/static/js/bokeh.min.js"
        return [asked(host, "/ws", Origin=f"http://{host}", **keys)[0], asked(host, script)[0]]

    assert status == 200
    for name in ("127.0.0.1", "localhost", "LOCALHOST", "[::1]"):
        assert answers(name) == [SWITCHED, 200], name
    for name in ("evil.example", "localhost.evil.example", "127.0.0.1.evil.example", "127.0.0.2", "127x0.0.1", "my"):
        assert answers(name) == [403, 403], name
        assert asked(f"{name}:{here.port}")[0] == 403
