"""The page in a real browser: hover, flip, zoom, sort; and that it needs nothing from outside."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from bench import page
from bench.page.gather import content
from tests.page.browser import Browser, browser, middle, require_browser
from tests.page.sample import STAGE, report

SCENES = ("cornell", "a </script> scene")


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "report.html"
    page.write(path, report(*SCENES))
    return path


@pytest.fixture(scope="module")
def window(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    require_browser()
    with browser(tmp_path_factory.mktemp("browser")) as opened:
        yield opened


@pytest.fixture
def shown(window: Browser, path: Path) -> Browser:
    """The page, freshly loaded."""
    window.resize(1280, 900)
    window.open(path)
    return window


def box(window: Browser, selector: str) -> list[float]:
    """x, y, width and height of an element in the viewport, once it is scrolled to."""
    script = """const e = document.querySelector(arguments[0]); e.scrollIntoView({block: "center"});
        const b = e.getBoundingClientRect(); return [b.x, b.y, b.width, b.height];"""
    return [float(value) for value in window.run(script, selector)]


def view(window: Browser) -> dict[str, Any]:
    found: dict[str, Any] = window.run("return viewer.view()")
    return found


def grey(window: Browser, canvas: str = "canvas-a") -> int:
    """The level in the middle of the picture."""
    script = """const c = document.getElementById(arguments[0]);
        return c.getContext("2d").getImageData(c.width / 2, c.height / 2, 1, 1).data[0];"""
    return int(window.run(script, canvas))


# ------------------------------------------------------------------------------------------------ without a browser


def test_the_page_is_one_file_that_asks_for_nothing(path):
    text = path.read_text()
    own = re.sub(r'<script type="text/plain" id="library">[^<]*</script>', "", text)
    assert not re.search(r"<link|<img|@import|<script[^>]+src=|https?://", own)
    assert text.count("</script>") == 3
    assert len(text) < 3_000_000


def test_the_content_is_json_without_holes():
    data = content(report(*SCENES))
    assert json.loads(json.dumps(data, allow_nan=False)) == data
    (first, second) = data["scenes"]
    assert second["name"] == SCENES[1]
    names = [m["name"] for m in first["methods"]]
    assert names[0] == "noisy"
    assert "6 paths" in names
    assert "1 paths" not in names  # that is the noisy frame
    by_name = {m["name"]: m for m in first["methods"]}
    assert by_name["BMFR"]["equal"]["samples"] == 1 + (20 - 2) // 10
    assert by_name["BMFR"]["front"] == {"rmse": True, "flip": True}
    assert by_name["BMFR + TAA"]["pictures"] is None
    assert math.isclose(by_name["BMFR"]["ms"], 50.0)


def test_hard_cases_are_shown_in_groups(shown):
    rows = shown.run("return [...document.querySelectorAll('#hard tbody tr')].map(r => r.innerText.trim())")
    assert rows == ["light", "all black\t0", "firefly\t1e5\tFAILS"]
    assert shown.run("return document.querySelector('#hard td.bad').textContent") == "FAILS"


# --------------------------------------------------------------------------------------------------- in a browser


def test_nothing_goes_wrong_while_it_loads(shown):
    assert shown.run("return [...document.querySelectorAll('.failed')].length") == 0
    assert shown.run("return document.getElementById('machine').textContent").startswith("some <renderer>")
    assert shown.run("return document.querySelectorAll('#scatter .scatterlayer .point').length") >= 7
    assert shown.run("return [...document.querySelectorAll('#scene-choice button')].map(b => b.textContent)") == list(
        SCENES
    )


def test_pointing_at_a_mark_tells_the_setting(shown):
    script = """const p = document.getElementById("scatter"); p.scrollIntoView({block: "center"});
        const t = p.data.findIndex(t => t.name === "BMFR"), l = p._fullLayout, b = p.getBoundingClientRect();
        return [b.x + l._size.l + l.xaxis.d2p(p.data[t].x[0]), b.y + l._size.t + l.yaxis.d2p(p.data[t].y[0])];"""
    x, y = shown.run(script)
    shown.mouse((x - 80, y), (x - 3, y), (x, y))
    shown.wait("document.querySelector('#scatter .hovertext')", "the hover label")
    told = shown.run("return document.querySelector('#scatter .hovertext').textContent")
    assert "--denoiser bmfr" in told
    assert "0.0100" in told
    assert "in that time 2 paths" in told


def test_number_keys_flip_without_moving_the_view(shown):
    box(shown, "#canvas-a")
    shown.wait("viewer.view().a === 'BMFR'", "the first picture")
    assert grey(shown) == 120
    before = view(shown)
    shown.press("0")
    assert view(shown) == {**before, "a": "reference"}
    assert grey(shown) == 200
    shown.press("1")
    assert (view(shown)["a"], grey(shown)) == ("noisy", 40)
    pressed = shown.run("return document.querySelector('#slots [aria-pressed=true]').textContent")
    assert pressed == "1noisy"
    shown.press("9")  # there is no such picture
    assert view(shown)["a"] == "noisy"


def test_pictures_of_variants_are_nearly_without_loss(shown):
    box(shown, "#canvas-a")
    shown.run("viewer.show(arguments[0])", STAGE.name)
    assert shown.run("return document.getElementById('pick-a').value") == STAGE.name
    corner = "document.getElementById('canvas-a').getContext('2d').getImageData(20, 20, 1, 1).data[0]"
    shown.wait(f"Math.abs({corner} - 160) < 3", "its picture")


def test_the_wheel_zooms_about_the_mouse_and_dragging_pans_both(shown):
    shown.press("c")
    x, y, width, height = box(shown, "#canvas-a")
    corner = (int(x + 0.75 * width), int(y + 0.25 * height))
    shown.wheel(*corner, -800)
    shown.wait("viewer.view().zoom > 2.5", "a larger picture")
    zoomed = view(shown)
    # What was under the mouse still is: 0.75 = view.x + 0.25 / zoom.
    assert zoomed["x"] + 0.25 / zoomed["zoom"] == pytest.approx(0.75, abs=0.01)
    assert zoomed["y"] - 0.25 / zoomed["zoom"] == pytest.approx(0.25, abs=0.01)
    start = middle((x, y, width, height))
    shown.mouse(start, (start[0] + 40, start[1] + 20), button=True)
    moved = view(shown)
    assert moved["x"] == pytest.approx(zoomed["x"] - 40 / width / zoomed["zoom"], abs=0.01)
    assert moved["y"] == pytest.approx(zoomed["y"] - 20 / height / zoomed["zoom"], abs=0.01)
    # Both panes show the same part: the white square is at the same place in either.
    script = """const spot = (id) => {
            const c = document.getElementById(id), d = c.getContext("2d").getImageData(0, 0, c.width, c.height).data;
            for (let i = 0; i < d.length; i += 4) if (d[i] === 255) return i;
        };
        return [spot("canvas-a"), spot("canvas-b")];"""
    first, second = shown.run(script)
    assert first == second is not None
    shown.run("document.getElementById('zoom-fit').click()")
    assert view(shown)["zoom"] == 1


def test_the_error_map_is_coloured_by_magma(shown):
    box(shown, "#canvas-a")
    shown.press("e")
    corner = "[...document.getElementById('canvas-a').getContext('2d').getImageData(5, 5, 1, 1).data]"
    shown.wait(f"{corner}[0] > 100", "the map")
    red, green, blue, _ = shown.run(f"return {corner}")
    assert min(red, blue) > 1.5 * green  # magma at 120 of 255: purple
    assert shown.run("return document.getElementById('caption-a').textContent").startswith("BMFR: FLIP")
    shown.press("e")
    assert not view(shown)["map"]


def test_tables_sort_by_their_headings(shown):
    names = "return [...document.querySelectorAll('#table tbody tr td:first-child')].map(c => c.textContent)"
    assert shown.run(names)[0] == "noisy"  # by time at first
    click = "document.querySelectorAll('#table thead button')[4].click()"
    shown.run(click)
    by_rmse = shown.run(names)
    assert by_rmse[0].startswith("BMFR")
    assert by_rmse[-2:] == ["noisy", "noise of the reference"]
    shown.run(click)
    assert shown.run(names)[0] == "noisy"
    assert shown.run(names)[-1] == "noise of the reference"


def test_another_error_and_another_scene(shown):
    shown.run("const s = document.getElementById('metric-choice'); s.value = 'flip'; s.onchange({target: s})")
    assert "FLIP" in shown.run("return document.querySelector('#scatter .ytitle').textContent")
    shown.run("document.querySelectorAll('#scene-choice button')[1].click()")
    assert SCENES[1] in shown.run("return document.getElementById('scatter-say').textContent")
    shown.run("document.getElementById('stage-choice').click()")
    names = shown.run("return [...document.querySelectorAll('#table tbody td:first-child')].map(c => c.textContent)")
    assert "SVGF without accumulation" not in names


def test_nothing_sticks_out_on_a_phone(shown):
    shown.resize(500, 900)  # as narrow as headless Chromium's windows get
    shown.wait("window.innerWidth <= 500", "a narrow window")
    wide = """return [...document.querySelectorAll("main section > *, header > *, nav")].filter(
        e => e.getBoundingClientRect().right > document.documentElement.clientWidth + 1)"""
    shown.wait(f"(() => {{ {wide} }})().length === 0", "a page that fits")
    shown.wait("document.documentElement.scrollWidth <= window.innerWidth", "a page that need not be scrolled sideways")
