"""The page in a real browser without a window: it loads, a slider changes the picture, a click gives the right cell."""

import csv
import json
import shutil
import time
from importlib.util import find_spec

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


def test_the_page_loads_without_an_error_and_asks_nothing_of_other_machines(page, address):
    severe = [entry for entry in page.get_log("browser") if entry["level"] == "SEVERE"]
    assert severe == []
    events = (json.loads(entry["message"])["message"] for entry in page.get_log("performance"))
    sent = [e["params"] for e in events if e["method"] == "Network.requestWillBeSent"]
    asked = {e["request"]["url"] for e in sent if e["documentURL"].startswith(address)}
    assert len(asked) > 3
    assert [url for url in asked if not url.startswith((address, "data:", "blob:"))] == []


def set_slider(driver, place):
    driver.execute_script("""
        for (const model of Bokeh.documents[0]._all_models.values())
            if (model.type.includes('Slider')) model.value = arguments[0];
    """, place)  # fmt: skip


def test_a_slider_changes_the_picture(page):
    before = image(page)
    set_slider(page, 0)
    after = until(lambda: (now := image(page)) != before and now)
    assert sum(a != b for a, b in zip(before, after, strict=True)) > 50
    set_slider(page, 1)
    until(lambda: image(page) == before)


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


def test_a_click_gives_the_row_of_its_cell(page, result):
    with sweep.open_result(result) as dataset:
        cell = dataset.isel(mu=30, R=3, a=1).load()
        click(page, float(cell.mu) * 1.05, float(cell.R) + 0.02)
    found = until(lambda: {"period"} <= (rows := table(page)).keys() and rows)
    for name in ("mu", "R", "a", "period", "amplitude"):
        assert float(found[name]) == float(cell[name])
    assert found["status"] == "OK"


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


def test_what_is_shown_can_be_saved_as_a_table_a_picture_and_a_study(page, result):
    with sweep.open_result(result) as dataset:
        period = dataset.period.isel(a=1).values
    lines = [line for line in download(page, "CSV", "csv").read_text().splitlines() if not line.startswith("#")]
    rows = list(csv.DictReader(lines))
    assert len(rows) == 41 * 21
    found = np.array([float(r["period"]) for r in rows]).reshape(41, 21)
    assert np.array_equal(found, period, equal_nan=True)
    assert download(page, "PNG", "png").read_bytes().startswith(b"\x89PNG")
    study = sweep.study(download(page, "TOML", "toml"))
    assert study.fixed["a"] == 1.0
    assert list(study.axes) == ["mu", "R"]
