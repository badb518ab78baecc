"""The page in a real browser: it draws, zooms, changes steps, prints, and asks nobody for anything."""

import re
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.report.page.conftest import LOG, POSITION, UNIT, U, browser

WIDE, NARROW = {"width": 1280, "height": 900}, {"width": 400, "height": 800}
#: Every chart, its range of time (None for a cloud), and how many points it has drawn.
CHARTS = """() => dsd.charts.map(c => ({name: c.figure.dataset.chart, time: !c.spec.x,
    x: [c.plot.scales.x.min, c.plot.scales.x.max], y: [c.plot.scales.y.min, c.plot.scales.y.max],
    points: c.plot.data.slice(1).map(s => s.filter(v => v != null).length)}))"""


def until(page, expression: str) -> None:
    """Waits for it from outside: the page's own policy forbids to evaluate texts in it."""
    end = time.monotonic() + 300.0
    while not page.evaluate(expression):
        assert time.monotonic() < end, expression
        page.wait_for_timeout(50)


@pytest.fixture(scope="session")
def executable() -> str:
    """A browser; where there is none, the tests say so, before a page is made for them."""
    pytest.importorskip("playwright.sync_api", reason="no browser tests: playwright is not installed")
    path = browser()
    if path is None:
        pytest.skip("no browser tests: no Chromium is installed (apt-get install chromium, or set DSD_BROWSER)")
    return path


@pytest.fixture(scope="module")
def chromium(executable: str) -> Iterator[object]:
    """It runs, for the tests of this file."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as tool:
        running = tool.chromium.launch(
            executable_path=executable, args=["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"]
        )
        yield running
        running.close()


@pytest.fixture
def opened(executable, chromium, folder: Path):
    """Opens the page; whatever it complains of or asks for fails the test at its end."""
    contexts, said, asked = [], [], []

    def go(viewport=WIDE, **settings) -> SimpleNamespace:
        context = chromium.new_context(viewport=viewport, offline=True, **settings)
        contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(120_000)
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("dialog", lambda dialog: said.append(dialog.message))
        page.on("request", lambda request: asked.append(request.url))
        address = (folder / "page.html").as_uri()
        page.goto(address)
        asked.remove(address)
        until(page, "window.dsd && dsd.charts.length > 0")
        return page

    yield go
    for context in contexts:
        context.close()
    assert said == []
    assert asked == []


def test_it_draws_every_panel(opened):
    page = opened()
    charts = page.evaluate(CHARTS)
    names = [chart["name"] for chart in charts]
    assert {"u", "velocity", "position", "label-delay", "label-inertia", "d_hat-given", "residual-given",
            "d_hat-step", "force-step", "given-velocity", "step-velocity"} <= set(names)  # fmt: skip
    assert page.locator("figure[data-chart]").count() == len(charts)
    assert page.locator("figure[data-chart] canvas").count() == len(charts)
    empty = [chart["name"] for chart in charts if max(chart["points"]) < 5]
    assert empty == []
    inked = """() => dsd.charts.filter(c => { const k = c.plot.ctx.canvas;
        const d = k.getContext("2d").getImageData(0, 0, k.width, k.height).data; let n = 0;
        for (let i = 3; i < d.length; i += 4) n += d[i] > 0; return n < 500; }).map(c => c.figure.dataset.chart)"""
    assert page.evaluate(inked) == []


def test_the_story_is_in_order(opened):
    page = opened()
    assert page.locator("h2").all_text_contents() == [
        "The log and its quality", "What was detected", "How the model compares", "Where it fails", "What is missing",
        "The ladder", "Values, and what they are worth",
        "What is not identifiable from these data, and the experiment that would show it",
        "The config that results", "How to repeat it"]  # fmt: skip
    assert "not available" not in page.locator("main").inner_text().lower()
    for link in page.locator("nav a").all():
        assert page.locator(f"section{link.get_attribute('href')}").count() == 1


def test_names_are_shown_and_never_obeyed(opened):
    page = opened()
    assert page.evaluate("window.hacked") is None
    assert page.locator("img, iframe, object, embed, link").count() == 0
    assert page.locator("script").count() == 4, "data, results, uPlot and the page's own"
    shown = page.locator("h1").inner_text()
    assert "<script>hacked=1<\\script>[x]$$\\x1b]52;\\u202e" in shown
    assert not set("\x1b\u202e\u2028") & set(page.content())
    config = page.locator("#config-text").inner_text()
    assert U in config
    assert POSITION in config
    assert f"({UNIT})" in page.locator("figure[data-chart=u] figcaption").inner_text()
    assert page.evaluate("JSON.parse(document.getElementById('results').textContent).log") == [LOG]


def drag(page, chart: str, start: float, end: float) -> None:
    """Over the plotting area of a chart, from one share of its width to another."""
    over = page.locator(f"figure[data-chart={chart}] .u-over")
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + start * box["width"], y)
    page.mouse.down()
    page.mouse.move(box["x"] + (start + end) / 2 * box["width"], y, steps=3)
    page.mouse.move(box["x"] + end * box["width"], y, steps=3)
    page.mouse.up()


def ranges(page) -> set[tuple[float, ...]]:
    return {tuple(round(x, 6) for x in chart["x"]) for chart in page.evaluate(CHARTS) if chart["time"]}


def test_a_zoom_is_one_of_all_charts_over_time(opened):
    page = opened()
    (whole,) = ranges(page)
    clouds = [chart["x"] for chart in page.evaluate(CHARTS) if not chart["time"]]
    drag(page, "u", 0.25, 0.5)
    until(page, "dsd.range()[0] > 0")
    (zoomed,) = ranges(page)
    assert zoomed == pytest.approx((0.25 * whole[1], 0.5 * whole[1]), abs=0.02 * whole[1])
    assert float(page.locator("#range-from").input_value()) == pytest.approx(zoomed[0], abs=0.01)
    assert [chart["x"] for chart in page.evaluate(CHARTS) if not chart["time"]] == clouds
    page.locator("#zoom-in").click()
    (closer,) = ranges(page)
    assert closer[1] - closer[0] == pytest.approx((zoomed[1] - zoomed[0]) / 2, rel=1e-4)
    page.locator("#range-from").fill("0.1")
    page.locator("#range-to").fill("0.2")
    page.locator("#range-to").press("Enter")
    until(page, "dsd.range()[1] === 0.2")
    assert ranges(page) == {(0.1, 0.2)}
    page.locator("figure[data-chart=d_hat-step] .u-over").dblclick()
    assert ranges(page) == {whole}
    drag(page, "force-step", 0.6, 0.9)
    assert ranges(page) != {whole}
    page.locator("#zoom-all").click()
    assert ranges(page) == {whole}


def test_the_pointer_reads_values_in_all_panels(opened):
    page = opened()
    over = page.locator("figure[data-chart=u] .u-over")
    over.hover()
    until(page, "document.querySelector('figure[data-chart=u] .where').textContent")
    assert re.search(r"\d s$", page.locator("figure[data-chart=u] .where").inner_text())
    for chart in ("u", "velocity", "d_hat-given", "d_hat-step"):
        for value in page.locator(f"figure[data-chart={chart}] .key output").all_inner_texts():
            assert re.fullmatch(r"\s*-?\d[\d.e+-]*", value), (chart, value)


def step(page) -> tuple[str, list[float]]:
    """What the buttons say is chosen, and the curve that the model of the step predicts."""
    chosen = page.locator("[role=radio][aria-checked=true]")
    assert chosen.count() == 1
    data = "dsd.charts.find(c => c.figure.dataset.chart === 'd_hat-step').plot.data.at(-1).filter(v => v != null)"
    return chosen.inner_text(), page.evaluate(data)


def height(page, chart: str) -> float:
    low, high = next(one["y"] for one in page.evaluate(CHARTS) if one["name"] == chart)
    return high - low


def test_a_step_of_the_ladder_changes_curves_and_residual(opened):
    page = opened()
    last, predicted = step(page)
    small = height(page, "force-step")
    page.locator("[role=radio]").first.click()
    name, given = step(page)
    assert (name, last) == ("0 as given", "2 viscous_friction")
    assert given != predicted
    assert height(page, "force-step") > 2.0 * small
    assert height(page, "step-velocity") > 2.0 * small
    same = "dsd.charts.find(c => c.figure.dataset.chart === 'd_hat-given').plot.data.at(-1).filter(v => v != null)"
    assert page.evaluate(same) == given
    assert page.locator("details.step:visible summary").all_inner_texts() == ["Values of step 0: as given"]
    page.locator("[role=radio]").first.press("ArrowRight")
    assert step(page)[0] == "1 coulomb_friction"
    page.locator("[role=radio]").last.click()
    assert step(page) == (last, predicted)
    page.locator("#same-scale").check()
    assert height(page, "force-step") > 2.0 * small, "one scale for all steps shows how small the last residual is"


def test_the_config_is_saved_as_it_is(opened, folder):
    page = opened()
    with page.expect_download() as waited:
        page.get_by_text("Save as dsd.toml").click()
    saved = Path(waited.value.path()).read_bytes().decode()
    assert waited.value.suggested_filename == "dsd.toml"
    assert "[model.effects.coulomb_friction]" in saved
    assert saved.splitlines()[0] == "# <!-- <script>hacked=1</script> -->"


@pytest.mark.parametrize("viewport", [WIDE, NARROW], ids=["wide", "narrow"])
def test_nothing_is_wider_than_the_screen(opened, viewport):
    page = opened(viewport)
    assert page.evaluate("document.documentElement.scrollWidth") <= viewport["width"]
    beyond = """w => [...document.querySelectorAll("main *")]
        .filter(e => e.offsetParent && !e.closest(".scroll, pre, .plot") && e.getBoundingClientRect().right > w + 1)
        .map(e => e.outerHTML.slice(0, 80))"""
    assert page.evaluate(beyond, viewport["width"]) == []
    rolled = """[...document.querySelectorAll(".scroll:has(.values, .rungs, .long)")]
        .filter(e => e.scrollWidth > e.clientWidth + 1).map(e => e.querySelector("table").className)"""
    assert page.evaluate(rolled) == []  # ladder, ranking and values fit, too: what is rolled out of view is not read
    widths = page.evaluate("dsd.charts.map(c => c.plot.root.getBoundingClientRect().right)")
    assert max(widths) <= viewport["width"]


def test_it_follows_the_width_of_the_window(opened):
    page = opened()
    page.set_viewport_size(NARROW)
    until(page, "dsd.charts.every(c => c.plot.root.getBoundingClientRect().right <= 400)")


def brightness(page, of: str) -> float:
    rgb = page.evaluate(f"getComputedStyle(document.body).{of}")
    return sum(map(float, re.findall(r"[\d.]+", rgb)[:3])) / 3.0


def test_light_and_dark(opened):
    light, dark = opened(color_scheme="light"), opened(color_scheme="dark")
    assert brightness(light, "backgroundColor") > 240 > 60 > brightness(light, "color")
    assert brightness(dark, "backgroundColor") < 40 < 200 < brightness(dark, "color")
    stroke = "dsd.charts[0].plot.series[1].stroke(dsd.charts[0].plot, 1)"
    before = light.evaluate(stroke)
    assert before != dark.evaluate(stroke)
    light.emulate_media(color_scheme="dark")
    until(light, f"{stroke} !== '{before}'")


def test_it_prints_without_cut_panels(opened, tmp_path):
    """On A4 less its margins, 186 x 269 mm: no panel is wider or higher, and none may be broken."""
    page = opened({"width": 703, "height": 1017}, color_scheme="dark")
    page.emulate_media(media="print", color_scheme="dark")
    until(page, "dsd.charts[0].width === 690")
    panels = page.evaluate("""() => [...document.querySelectorAll(".panel, .strip, .card")].map(e => ({
        box: e.getBoundingClientRect(), break: getComputedStyle(e).breakInside,
        canvas: e.querySelector("canvas")?.getBoundingClientRect() }))""")
    assert len(panels) > 15
    for panel in panels:
        assert panel["break"] == "avoid"
        assert panel["box"]["right"] <= 703
        assert panel["box"]["height"] < 1017
        if panel["canvas"]:
            assert panel["canvas"]["right"] <= panel["box"]["right"] + 1
    assert brightness(page, "backgroundColor") > 240, "paper is white in the dark too"
    assert not page.locator("nav").is_visible()
    pdf = page.pdf(prefer_css_page_size=True)
    assert pdf.startswith(b"%PDF")
    assert len(re.findall(rb"/Type\s*/Page\b", pdf)) > 3


def test_without_script_the_figures_are_there(executable, chromium, folder):
    context = chromium.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto((folder / "page.html").as_uri())
    text = page.locator("main").inner_text()
    assert "coulomb_friction is missing" in text
    assert "Values of step 0" in text
    context.close()
