"""The page in a real browser without a window, and who may ask for it."""

import csv
import http.client
import json
import re
import shutil
import time
from importlib.util import find_spec
from urllib.parse import urlsplit

import numpy as np
import pytest

import sweep

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
    profile, downloads = tmp_path_factory.mktemp("profile"), tmp_path_factory.mktemp("downloads")
    for flag in (*FLAGS, f"--user-data-dir={profile}"):
        options.add_argument(flag)
    options.add_experimental_option("prefs", {"download.default_directory": str(downloads)})
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    driver.downloads = downloads
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


def everything(driver):
    """All text of the page, within shadow roots too."""
    return driver.execute_script("""
        const texts = [];
        const walk = node => {
            if (node.tagName === 'TR') texts.push('\\n');
            if (node.shadowRoot) walk(node.shadowRoot);
            for (const child of node.childNodes || [])
                child.nodeType === 3 ? texts.push(child.textContent) : child.tagName === 'STYLE' || walk(child);
            if (node.tagName === 'TD') texts.push('|');
        };
        walk(document.body);
        return texts.join('');
    """)


def set_slider(driver, place):
    driver.execute_script("""
        for (const model of Bokeh.documents[0]._all_models.values())
            if (model.type.includes('Slider')) model.value = arguments[0];
    """, place)  # fmt: skip


def table(driver):
    """Names and values of the table on the page."""
    return {line.split("|")[0]: line.split("|")[1] for line in everything(driver).splitlines() if line.count("|") == 4}


def click(driver, x, y):
    """Clicks where the axes of the picture have these values."""
    at = driver.execute_script("""
        const find = views => { for (const view of views) {
            if (view.model.type === 'Figure') return view;
            const found = find(view.child_views || []); if (found) return found; } };
        const view = find(Object.values(Bokeh.index.roots ? Bokeh.index.roots : Bokeh.index));
        const box = view.el.getBoundingClientRect(), frame = view.frame ?? view.canvas_view;
        return [box.left + view.frame.x_scale.compute(arguments[0]), box.top + view.frame.y_scale.compute(arguments[1]),
                window.innerWidth, window.innerHeight];
    """, x, y)  # fmt: skip
    from selenium.webdriver.common.action_chains import ActionChains

    mouse = ActionChains(driver)
    mouse.w3c_actions.pointer_action.move_to_location(round(at[0]), round(at[1]))
    mouse.click().perform()


def download(driver, label, suffix):
    button = driver.execute_script("""
        const walk = node => {
            if (node.tagName === 'A' && node.textContent.trim() === arguments[0]) return node;
            for (const child of [...(node.shadowRoot ? [node.shadowRoot] : []), ...(node.childNodes || [])]) {
                const found = walk(child); if (found) return found;
            }
        };
        return walk(document.body);
    """, label)  # fmt: skip
    button.click()
    return until(lambda: next(iter(driver.downloads.glob(f"*.{suffix}")), None))


def test_a_result_in_the_browser(page, address, result):
    """It loads without an error and asks no other machine; a slider, a click and the downloads give its numbers."""
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

    with sweep.open_result(result) as dataset:
        dataset = dataset.isel(a=1).load()
    cell = dataset.isel(mu=30, R=3)
    click(page, float(cell.mu) * 1.05, float(cell.R) + 0.02)
    found = until(lambda: {"period"} <= (rows := table(page)).keys() and rows)
    for name in ("mu", "R", "a", "period", "amplitude"):
        assert float(found[name]) == float(cell[name])
    assert found["status"] == "OK"

    lines = [line for line in download(page, "CSV", "csv").read_text().splitlines() if not line.startswith("#")]
    rows = np.array([float(row["period"]) for row in csv.DictReader(lines)])
    assert np.array_equal(rows.reshape(41, 21), dataset.period, equal_nan=True)
    assert download(page, "PNG", "png").read_bytes().startswith(b"\x89PNG")
    study = sweep.study(download(page, "TOML", "toml"))
    assert (study.fixed["a"], list(study.axes)) == (1.0, ["mu", "R"])


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
