"""The page in a headless Chromium; skipped with the reason where there is none."""

import json
import time

import pytest

from amoeboid.cli.main import main
from explore.chromium import browser, kill
from explore.serving import Page, children, explorer, gone

pytestmark = pytest.mark.slow

SPEED = "explorer.known.states?.states.at(-1).numbers.max_retrograde_speed"
FRAME = "explorer.live.latest"
ABOVE, BELOW, BISTABLE = 7.5, 3.0, 5.5


def at(tab, v_p0):
    """The page at a v_p0, once its states are known."""
    tab.type_value("v_p0", str(v_p0))
    tab.until(f"explorer.known.states?.value === {v_p0}")


def start(tab, kind):
    before = tab.value("explorer.live.begun")
    tab.value(f"document.getElementById('start').value = '{kind}'")
    tab.click("#restart")
    tab.until(f"explorer.live.begun > {before} && {FRAME}")


def test_a_slider_moves_the_branch_the_states_and_the_shape(tab):
    at(tab, BISTABLE)
    assert tab.value("document.querySelectorAll('#outlines svg').length") == 3
    before = tab.value("[document.getElementById('branch').innerHTML, explorer.known.branch.text]")
    tab.set_slider("D", 300)
    tab.until(f"explorer.known.branch.text !== {json.dumps(before[1])} && {SPEED} > 0")
    tab.until("document.getElementById('busy').textContent === ''")
    assert tab.value("document.getElementById('branch').innerHTML") != before[0]
    assert tab.value("document.querySelector('#p-D').getAttribute('aria-valuetext')").endswith(
        "L^2/T"
    )


def test_of_two_changes_in_a_row_the_last_is_shown(tab):
    tab.type_value("v_p0", "6.8")
    tab.type_value("v_p0", "7.1")
    tab.until("explorer.known.states?.value === 7.1")
    time.sleep(1.0)
    assert tab.value("explorer.known.states.value") == 7.1


def test_the_cell_polarizes_above_the_threshold_and_not_below(tab):
    tab.value("(() => { const p = document.getElementById('pace'); p.value = 8;"
              "p.dispatchEvent(new Event('input')); })()")  # fmt: skip
    at(tab, BELOW)
    start(tab, "noise")
    tab.until(f"{FRAME}?.t > 8 && {FRAME}.polarity < 0.02")
    at(tab, ABOVE)
    tab.until(f"{FRAME}?.polarity > 0.3")
    assert "polarizes" in tab.value("document.getElementById('sentences').textContent")
    assert tab.value("document.querySelectorAll('#map path').length") > 0


def test_a_poke_by_mouse_turns_the_cell(tab):
    at(tab, 6.0)
    start(tab, "polarization")
    tab.until(f"{FRAME}?.t > 0.2")
    assert max(map(abs, tab.value(f"{FRAME}.position")[:2])) < 0.02  # it runs along z
    tab.value("(() => { const s = document.getElementById('strength'); s.value = 3;"
              "s.dispatchEvent(new Event('input')); })()")  # fmt: skip
    for _ in range(3):
        tab.click("#cell", right=0.56, down=0.5)
        time.sleep(0.5)
    tab.until(f"Math.max(Math.abs({FRAME}?.position[0]), Math.abs({FRAME}.position[1])) > 0.1")
    tab.click("#lines")
    tab.until("document.getElementById('dialog').open")
    assert "pokes=[" in tab.value("document.getElementById('dialog-text').textContent")
    tab.click("#close")


def test_pause_stops_the_cell_and_it_goes_on(tab):
    tab.click("#pause")
    t = tab.until(f"{FRAME}?.paused && {FRAME}.t")
    time.sleep(0.5)
    assert tab.value(f"{FRAME}.t") == t
    assert tab.value("document.getElementById('pause').textContent") == "Go on"
    tab.click("#pause")
    tab.until(f"{FRAME}?.t > {t}")


def test_a_wrong_value_shows_the_rule_beside_its_slider(tab):
    tab.type_value("D", "-1")
    words = tab.until("document.getElementById('p-D-wrong').textContent")
    assert "D must be a finite number >= 0, got -1" in words
    assert tab.value("document.getElementById('p-D-text').getAttribute('aria-invalid')") == "true"
    assert not tab.value("document.getElementById('p-D-wrong').hidden")
    tab.type_value("D", "0.4")
    tab.until("document.getElementById('p-D-wrong').hidden")


def test_reload_and_a_second_tab_go_on(tab, chromium, server):
    tab.value("explorer.before = true")
    tab.call("Page.reload")
    tab.until("!explorer.before && explorer.known.states && explorer.live.latest")
    second = chromium.open(server[1])
    second.until("explorer.known.states && explorer.live.latest")
    second.click("#pause")
    second.until(f"{FRAME}?.paused")
    assert not tab.value(f"{FRAME}?.paused")
    second.close()


def test_presets_and_physical_units(tab):
    for name in tab.value("[...document.querySelectorAll('#preset option')].map((o) => o.value)"):
        tab.value(f"(() => {{ const s = document.getElementById('preset'); s.value = '{name}';"
                  "s.dispatchEvent(new Event('change')); })()")  # fmt: skip
        tab.until(f"explorer.state.preset.name === '{name}'")
        tab.until("document.getElementById('busy').textContent === '' && explorer.known.states")
        assert tab.value("[...document.querySelectorAll('.wrong')].every((w) => w.hidden)")
    assert "µm/s" in tab.value("document.getElementById('sliders').textContent")
    assert "um/s" in tab.value("document.getElementById('sentences').textContent")


def test_keyboard_and_screen_readers(tab):
    unnamed = tab.value(
        "[...document.querySelectorAll('input, select, button, canvas')].filter((e) =>"
        "!(e.labels?.length || e.getAttribute('aria-label') || e.textContent.trim()))"
        ".map((e) => e.outerHTML)"
    )
    assert unnamed == []
    tree = tab.call("Accessibility.getFullAXTree")["nodes"]
    images = [n for n in tree if n.get("role", {}).get("value") in ("image", "img")]
    assert all(n.get("name", {}).get("value") for n in images if not n.get("ignored"))
    tab.value("document.getElementById('p-v_p0').focus()")
    before = tab.value("explorer.state.values.v_p0")
    tab.key("ArrowRight")
    assert tab.value("explorer.state.values.v_p0") > before
    tab.value("document.getElementById('cell').focus()")
    tab.key("Enter")
    tab.click("#lines")
    tab.until("document.getElementById('dialog').open")
    assert "pokes=[" in tab.value("document.getElementById('dialog-text').textContent")
    assert tab.value("document.getElementById('sentences').getAttribute('aria-live')") == "polite"


@pytest.mark.parametrize("width", [390, 1280])
@pytest.mark.parametrize("dark", [False, True])
def test_it_fits_the_screen(chromium, server, width, dark, tmp_path):
    tab = chromium.open(server[1], width=width, height=844, dark=dark)
    tab.until("explorer.known.states && explorer.live.latest")
    assert tab.value("document.documentElement.scrollWidth") <= width
    wide = "[...document.querySelectorAll('.scroll')].map((e) => e.scrollWidth - e.clientWidth)"
    assert max(tab.value(wide)) <= 0
    assert tab.value("document.documentElement.classList.contains('dark')") == dark
    tab.close()


def test_a_fifth_page_keeps_saying_why_it_does_not_work(chromium, server):
    address = server[1]
    with Page(address), Page(address), Page(address), Page(address):
        tab = chromium.open(address)
        words = "document.getElementById('connection').textContent"
        tab.until(f"{words}.includes('at most 4 pages')")
        time.sleep(2.0)  # it tries again after 1.5 s
        assert "at most 4 pages" in tab.value(words)
        assert not tab.value("document.getElementById('connection').hidden")
    tab.until("document.getElementById('connection').hidden && explorer.known.states")
    tab.close()


def test_a_page_in_one_file_asks_no_host(chromium, tmp_path):
    path = tmp_path / "page.html"
    assert main(["explore", "--export", str(path), "--set", "D=0.4", "--set", "v_p0=5.5"]) == 0
    assert path.stat().st_size < 400_000
    tab = chromium.open(path.as_uri())
    tab.until("explorer.known.states")
    assert tab.value("explorer.known.branch.folds[0].x") == pytest.approx(5.2096, abs=1e-3)
    speed = tab.value(SPEED)
    tab.set_slider("v_p0", 24)
    tab.until(f"{SPEED} > {speed}")
    tab.set_slider("D", 0)
    tab.until("explorer.known.branch.folds.length === 0")
    asked = [e["request"]["url"] for e in tab.events("Network.requestWillBeSent")]
    assert {url.partition(":")[0] for url in asked} <= {"file", "data"}
    assert tab.events("Runtime.exceptionThrown") == []
    tab.close()


def test_a_killed_browser_leaves_no_process():
    # the page must open within this time, also on a busy machine
    with browser() as own, explorer("--idle", "30") as (process, address):
        own.open(address).until("explorer.live.latest")
        below = children(process.pid)
        assert len(below) == 2
        kill(own.process)
        assert process.wait(150) == 0
        assert gone(below)
