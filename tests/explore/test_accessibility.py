"""The page for those who use a keyboard, a screen reader, or see contrast badly."""

from itertools import pairwise

import pytest

pytestmark = pytest.mark.slow

CONTRAST = """
(() => {
  const numbers = (color) => color.match(/[\\d.]+/g).map(Number);
  const luminance = (color) => {
    const [r, g, b] = numbers(color).slice(0, 3).map((v) => v / 255)
      .map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const ratio = (a, b) => {
    const [low, high] = [luminance(a), luminance(b)].sort((x, y) => x - y);
    return (high + 0.05) / (low + 0.05);
  };
  const clear = (color) => numbers(color)[3] === 0;
  const behind = (element) => {
    for (let e = element; e; e = e.parentElement) {
      const color = getComputedStyle(e).backgroundColor;
      if (!clear(color)) return color;
    }
    return "rgb(255, 255, 255)";
  };
  const seen = (e) => e.checkVisibility() && e.getBoundingClientRect().width > 0;
  const found = [];
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const e = walk.currentNode.parentElement;
    if (!walk.currentNode.textContent.trim() || !seen(e) || e.closest("script, title")) continue;
    const style = getComputedStyle(e);
    const color = e instanceof SVGElement ? style.fill : style.color;
    found.push([ratio(color, behind(e)), 4.5, "text", walk.currentNode.textContent.trim().slice(0, 40)]);
  }
  for (const e of document.querySelectorAll("button, select, input[type=text]")) {
    if (seen(e)) found.push([ratio(getComputedStyle(e).borderTopColor, behind(e.parentElement)), 3, "edge", e.id]);
  }
  for (const name of ["--stable", "--unstable", "--here", "--ink"]) {
    const probe = document.createElement("i");
    probe.style.color = `var(${name})`;
    document.getElementById("branch").append(probe);
    found.push([ratio(getComputedStyle(probe).color, behind(probe)), 3, "line", name]);
    probe.remove();
  }
  return found;
})()
"""  # noqa: E501

FOCUSED = """
(() => {
  const e = document.activeElement;
  const box = e.getBoundingClientRect();
  const all = [...document.querySelectorAll("*")];
  return { id: e.id || e.dataset.poke || e.className || e.tagName, order: all.indexOf(e),
           top: box.top + scrollY, seen: box.width > 0 && box.height > 0,
           outline: parseFloat(getComputedStyle(e).outlineWidth) };
})()
"""


@pytest.mark.parametrize("dark", [False, True])
def test_all_text_has_a_contrast_of_4_5_and_controls_and_lines_one_of_3(chromium, server, dark):
    tab = chromium.open(server[1], dark=dark)
    tab.until("explorer.known.states && explorer.live.latest")
    tab.value("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    tab.type_value("D", "-1")
    tab.until("!document.getElementById('p-D-wrong').hidden")
    found = tab.value(CONTRAST)
    tab.close()
    assert {kind for _, _, kind, _ in found} == {"text", "edge", "line"}
    assert len(found) > 100
    assert [one for one in found if one[0] < one[1]] == []


@pytest.mark.parametrize("width", [390, 1280])
def test_the_tab_key_reaches_every_control_in_the_order_of_the_page(chromium, server, width):
    tab = chromium.open(server[1], width=width, height=844)
    tab.until("explorer.known.states && explorer.live.latest")
    tab.value("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    wanted = tab.value(
        "[...document.querySelectorAll('button, select, input, summary, canvas, a')].filter((e) =>"
        "e.checkVisibility() && !e.closest('dialog')).length"
    )
    reached = []
    while len(reached) < 2 * wanted:
        tab.key("Tab")
        here = tab.value(FOCUSED)
        if reached and here["order"] <= reached[-1]["order"]:
            break
        reached.append(here)
    tab.close()
    ids = [one["id"] for one in reached]
    assert ids[0] == "skip"
    assert len(reached) >= wanted - 1, ids  # of the two units only the chosen one
    assert all(one["seen"] and one["outline"] >= 2 for one in reached), reached
    assert {"preset", "cell", "pause", "p-v_p0", "p-gamma_n", "p-stress-text", "vary"} <= set(ids)
    if width == 390:  # one column: what comes later is farther down
        tops = [one["top"] for one in reached[1:]]
        assert all(b > a - 60 for a, b in pairwise(tops)), reached


def test_every_control_has_a_name_and_every_description_exists(tab):
    unnamed = tab.value(
        "[...document.querySelectorAll('input, select, button, canvas, svg[role=img]')]"
        ".filter((e) => !(e.labels?.length || e.getAttribute('aria-label') ||"
        "e.textContent.trim())).map((e) => e.outerHTML)"
    )
    assert unnamed == []
    missing = tab.value(
        "[...document.querySelectorAll('[aria-describedby], [aria-labelledby], label[for]')]"
        ".flatMap((e) => `${e.getAttribute('aria-describedby') ?? ''} "
        "${e.getAttribute('aria-labelledby') ?? ''} ${e.getAttribute('for') ?? ''}`.split(/\\s+/))"
        ".filter((id) => id && !document.getElementById(id))"
    )
    assert missing == []
    ids = tab.value("[...document.querySelectorAll('[id]')].map((e) => e.id)")
    assert len(ids) == len(set(ids))
    levels = tab.value("[...document.querySelectorAll('main h1, main h2, main h3')].map((e) =>"
                       "e.tagName)")  # fmt: skip
    assert set(levels) == {"H2"}
    assert tab.value("document.documentElement.lang") == "en"


def test_what_changes_is_announced(tab):
    live = tab.value(
        "Object.fromEntries([...document.querySelectorAll('[aria-live], [role=alert],"
        "[role=status]')].map((e) => [e.id, [e.getAttribute('role'),"
        "e.getAttribute('aria-live')]]))"
    )
    assert live["sentences"] == ["status", "polite"]  # the verdict
    assert live["connection"][0] == "alert"
    assert live["p-D-wrong"][0] == "alert"
    assert live["saved"] == ["status", "polite"]
    assert live["observables"] == [None, "off"]  # twenty times a second would be too often
    assert "busy" not in live
    names = tab.value("['p-v_p0', 'p-v_p0-text'].map((id) => [...document.getElementById(id)"
                      ".getAttribute('aria-describedby').split(' ')])")  # fmt: skip
    assert all("p-v_p0-wrong" in found for found in names)


def test_less_motion_begins_with_a_cell_that_waits(chromium, server):
    tab = chromium.open(server[1], still=True)
    tab.until("explorer.known.states && explorer.live.latest?.paused")
    assert tab.value("document.getElementById('pause').textContent") == "Go on"
    t = tab.value("explorer.live.latest.t")
    tab.click("#pause")
    tab.until(f"explorer.live.latest?.t > {t} && !explorer.live.latest.paused")
    tab.click("#restart")  # by hand: it moves
    tab.until("explorer.live.latest?.t > 0.1 && !explorer.live.latest.paused")
    tab.close()
