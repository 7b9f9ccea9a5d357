"""What a page's charts hold is what matplotlib was told to draw; what they cannot hold stays a picture."""

from __future__ import annotations

import base64
import io
import json
import os
import re
import shutil
import subprocess
from importlib.resources import files

import matplotlib as mpl
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from taxel.report.charts import STYLE, chart, chart_data
from taxel.report.page import render


def axes_of(**how):
    figure = Figure(**how)
    return figure, figure.subplots()


def held(html: str) -> dict:
    """Return the JSON of a chart as a browser would read it."""
    return json.loads(re.search(r'<script type="application/json">(.*?)</script>', html, re.S)[1])


values = st.lists(st.floats(-1e6, 1e6) | st.just(float("nan")), min_size=1, max_size=20)


@given(values)
def test_a_line_keeps_its_numbers_and_gaps(y):
    figure, axes = axes_of()
    axes.plot(y, "--", color="#b5423c", label="a line")
    (line,) = chart_data(figure)["axes"][0]["lines"]
    kept = np.array([np.nan if v is None else v for v in line["y"]])
    assert np.allclose(kept, y, rtol=1e-6, atol=0, equal_nan=True)
    assert line["x"] == list(range(len(y)))
    assert (line["color"], line["dash"], line["name"]) == ("#b5423c", [6, 4], "a line")


def test_bars_bands_marks_segments_and_points_are_told_apart():
    figure, axes = axes_of()
    axes.bar([1, 2], [3, -4], width=0.5, label="bars")
    axes.axvspan(1, 2, color="#e8b04b", alpha=0.5, label="band")
    axes.axhline(7, linestyle=":", label="mark")
    axes.errorbar([1, 2], [5, 6], [0.5, 1.0], fmt="o")
    axes.scatter([1, 2, 3], [1, 1, 1], c=["#ff0000", "#00ff00", "#ff0000"])
    axes.stairs([1, 2], [0, 1, 2], fill=True)
    axes.text(1, 2, "here")
    said = chart_data(figure)["axes"][0]
    assert [(b["x0"], b["x1"], b["y0"], b["y1"], b["name"]) for b in said["bars"]] == [
        (0.75, 1.25, 0, 3, "bars"),
        (1.75, 2.25, 0, -4, "bars"),
    ]
    assert (said["bands"][0]["start"], said["bands"][0]["stop"], said["bands"][0]["color"]) == (1, 2, "#e8b04b80")
    assert [(m["axis"], m["at"], m["dash"]) for m in said["marks"]] == [("y", 7, [2, 3])]
    assert said["segments"][0]["at"] == [1, 4.5, 1, 5.5, 2, 5, 2, 7]
    dots = [line for line in said["lines"] if line["width"] == 0]
    assert sorted((d["color"], d["x"]) for d in dots if d["color"] in {"#ff0000", "#00ff00"}) == [
        ("#00ff00", [2]),
        ("#ff0000", [1, 3]),
    ]
    assert said["areas"][0]["y"] == [0, 1, 1, 2, 2, 0]
    assert said["texts"][0]["text"] == "here"


def test_axes_keep_limits_scales_names_and_what_they_share():
    figure = Figure()
    top, below = figure.subplots(2, 1, sharex=True)
    top.plot([1, 10, 100], [1, 2, 3], label="a")
    top.set(xscale="log", xlabel="Hz", title="how fast", xlim=(1, 100))
    top.set_yticks([1, 3], ["one", "three"])
    top.invert_yaxis()
    top.legend(title="lines")
    below.plot([1, 2], [-5, 5])
    below.set_yscale("symlog", linthresh=0.5)
    first, second = chart_data(figure)["axes"]
    assert (first["x"]["scale"], first["x"]["min"], first["x"]["max"], first["x"]["label"]) == ("log", 1, 100, "Hz")
    assert first["y"]["names"] == [[1, "one"], [3, "three"]]
    assert first["y"]["reversed"] is True
    assert (second["y"]["scale"], second["y"]["around"]) == ("asinh", 0.5)
    assert first["group"] == second["group"] is not None
    assert (first["legend_title"], [e["name"] for e in first["legend"]]) == ("lines", ["a"])
    assert (first["title"], first["place"], second["place"]) == ("how fast", [1, 2, 1, 2], [2, 3, 1, 2])


def test_names_along_an_axis_come_from_categories_too():
    figure, axes = axes_of()
    axes.barh(["before contact", "full"], [1.0, 2.0])
    assert chart_data(figure)["axes"][0]["y"]["names"] == [[0, "before contact"], [1, "full"]]


@pytest.mark.parametrize("origin", ["upper", "lower"])
def test_a_map_keeps_its_values_and_its_colours(origin):
    figure, axes = axes_of()
    shown = axes.imshow([[0.0, 1.0, 2.0], [3.0, 4.0, np.nan]], cmap="magma", vmin=0, vmax=4, origin=origin)
    figure.colorbar(shown, ax=axes, label="ticks")
    said = chart_data(figure)
    (image,) = said["axes"][0]["images"]
    assert (image["rows"], image["columns"], image["values"]) == (2, 3, [0, 1, 2, 3, 4, None])
    painted = mpl.image.imread(io.BytesIO(base64.b64decode(image["png"])))
    assert painted.shape[:2] == (2, 3)
    assert np.allclose(painted[1, 1], mpl.colormaps["magma"](1.0), atol=0.01)
    # Row 0 lies between y0 and the first row's end, wherever 0 is on the screen.
    assert (image["y0"], image["y1"]) == (-0.5, 1.5)
    assert (said["scales"][0]["label"], said["scales"][0]["max"], len(said["axes"])) == ("ticks", 4, 1)


def test_an_inset_that_only_looks_closer_is_left_to_the_reader():
    figure, axes = axes_of()
    axes.plot([1, 2, 3], [1, 4, 9])
    axes.inset_axes((0.1, 0.5, 0.3, 0.3)).plot([1, 2], [1, 4])
    assert len(chart_data(figure)["axes"]) == 1


def three_dimensions(figure):
    figure.add_subplot(projection="3d").plot([1, 2], [1, 2], [1, 2])


def twins(figure):
    axes = figure.subplots()
    axes.plot([1, 2])
    axes.twinx().plot([3, 1])


def arrows(figure):
    figure.subplots().annotate("look", (0, 0), (1, 1), arrowprops={})


def another_inset(figure):
    axes = figure.subplots()
    axes.plot([1, 2])
    axes.inset_axes((0.1, 0.5, 0.3, 0.3)).plot([7, 8, 9])


@pytest.mark.parametrize("draw", [three_dimensions, twins, arrows, another_inset])
def test_what_a_chart_cannot_hold_is_a_picture_in_the_pages_ink(draw):
    with mpl.rc_context(STYLE):
        figure = Figure()
        draw(figure)
        html = chart(figure)
    assert "<svg" in html
    assert "application/json" not in html
    assert "var(--ink)" in html


def test_text_of_a_figure_cannot_end_the_script():
    figure, axes = axes_of()
    axes.plot([1, 2], label="x")
    axes.set_title("</script><script>alert(1)</script>")
    html = str(chart(figure))
    assert html.count("</script>") == 1
    assert held(html.replace("<\\/", "</", 0))["axes"][0]["title"] == "</script><script>alert(1)</script>"


def page(*figures):
    class Row:
        score = None

    charts = {"contact": {"potential": chart(list(figures)), "weights": "", "errors": None, "moved": None}}
    return render(
        "report/listening.html.j2",
        title="a page",
        felt="",
        judged="",
        readout="none",
        labels=["contact"],
        drawn=charts,
        rows=[],
        beside=[],
        begun=[],
        held_out=[],
        outside=[],
        worst=[],
        viewed=["'a walk.mcap'"],
        scored=False,
    )


def some():
    figure = Figure()
    left, right = figure.subplots(1, 2)
    left.plot([1, 2, 3], [3, 1, 2], label="a line")
    left.legend()
    right.imshow(np.eye(4))
    figure.subplots_adjust()
    other, axes = axes_of()
    axes.bar([1, 2], [3, 4])
    axes.set(yscale="log", ylim=(0.1, 10))
    return figure, other


def test_a_page_needs_nothing_but_itself():
    text = page(*some())
    assert not re.search(r"""(?:src|href)\s*=\s*["'](?!data:|#)""", text)
    assert not re.search(r"@import|url\((?!data:)", text)
    assert "Leon Sorokin" in text, "uPlot's licence goes with it"
    assert "export {" not in text
    assert "prefers-color-scheme: dark" in text
    assert "<code>taxel view &#39;a walk.mcap&#39;</code>." in text


def opened(text, tmp_path, width=800):
    """Return a page as a browser of this width, px, holds it after some seconds."""
    place = tmp_path / "page.html"
    place.write_text(text, encoding="utf-8")
    asked = [
        "--headless",
        f"--window-size={width},900",
        "--disable-gpu",
        "--virtual-time-budget=4000",
        f"--user-data-dir={tmp_path / 'profile'}",
    ]
    asked += ["--no-sandbox"] * (os.geteuid() == 0)
    command = [shutil.which("chromium"), *asked, "--dump-dom", place.as_uri()]
    for _ in range(5):
        seen = subprocess.run(command, check=True, capture_output=True, text=True, timeout=120).stdout
        # The browser's virtual seconds do not wait for the thread that decodes pictures.
        if seen.count('class="charts"') == seen.count("data-drawn="):
            break
    return seen


@pytest.mark.skipif(shutil.which("chromium") is None, reason="no chromium here to open the page")
def test_a_browser_draws_every_chart(tmp_path):
    seen = opened(page(*some()), tmp_path)
    assert re.findall(r'class="charts" data-drawn="(\d+)"', seen) == ["2", "1"]
    assert seen.count("<canvas") == 3
    assert "a line" in seen


@pytest.mark.skipif(shutil.which("chromium") is None, reason="no chromium here to open the page")
def test_a_logarithmic_axis_has_round_numbers_wherever_it_begins(tmp_path):
    own = files("taxel.report").joinpath("charts.js").read_text(encoding="utf-8")
    function = re.search(r"^function logSplits\(.*?^}$", own, re.MULTILINE | re.DOTALL)[0]
    stretches = [(1e4, 1e9), (9.2, 870.0), (3e-7, 0.02), (1.0, 10.0), (2.2, 2.9), (97.3, 115.0), (0.4, 1.2)]
    asked = f"<p id=said></p><script>{function}; document.getElementById('said').textContent = JSON.stringify("
    seen = opened(f"{asked}{json.dumps(stretches)}.map(([a, b]) => logSplits(a, b)))</script>", tmp_path)
    said = json.loads(re.search(r'<p id="said">(.*?)</p>', seen)[1])
    for (low, high), splits in zip(stretches, said, strict=True):
        decades = [m * 10.0**e for e in range(-9, 10) for m in range(1, 10)]
        wanted = [v for v in decades if low * (1 - 1e-12) <= v <= high * (1 + 1e-12)]
        if len(wanted) > 2:
            assert np.allclose(splits, wanted, rtol=1e-12, atol=0)
        else:
            assert 2 <= len(splits) <= 6, splits
            assert len(set(np.round(np.diff(splits), 12))) == 1
        assert low <= splits[0] < splits[-1] <= high


@pytest.mark.skipif(shutil.which("chromium") is None, reason="no chromium here to open the page")
def test_a_window_that_is_dragged_wider_leaves_one_drawing(tmp_path):
    """Its next width comes while pictures of the last one still load."""
    figure = Figure()
    axes = figure.subplots()
    figure.colorbar(axes.imshow(np.eye(4)), label="mV")
    text = page(figure)
    dragged = (
        "<script>{ let width = 900; Object.defineProperty(window, 'innerWidth', { get: () => (width += 7) });"
        "addEventListener('load', () => { for (let k = 0; k < 5; k++) dispatchEvent(new Event('resize')); }); }"
        "</script>"
    )
    seen = opened(text.replace("<body>", f"<body>{dragged}", 1), tmp_path)
    assert dragged in seen
    assert re.findall(r'class="charts" data-drawn="(\d+)"', seen) == ["1"]
    assert (seen.count('class="strip"'), seen.count("<canvas")) == (1, 1)


@pytest.mark.skipif(shutil.which("chromium") is None, reason="no chromium here to open the page")
@pytest.mark.parametrize("name", ["pick_test gripper_left_tactile", "a" * 60 + ".mcap", "s.mcap"])
@pytest.mark.parametrize("width", [1400, 1100])
def test_no_table_of_a_report_is_cut(tmp_path, name, width):
    score = {"events": 1500, "found": 1400, "missed": 100, "false": 100}
    score["error"] = score["delay"] = "-11.55 ± 105.4 (median -11.92, 95 % in -103.46 to 120.62)"
    row = {"recording": name, "label": "contact", "detections": 1500, "score": score}
    moment = {"label": "contact", "t": 123_456_789.0, "what": "missed"}
    text = render(
        "report/listening.html.j2",
        title="t",
        felt="",
        readout="r",
        judged="",
        scored=True,
        labels=[],
        drawn={},
        aligned={},
        rows=[row],
        held_out=[row],
        worst=[(name, moment, 123.456789)],
        begun=[(name, "2026-01-02 03:04:05 UTC")],
        viewed=[],
        outside=[],
        beside=[("contact", "neuron", score), ("contact", "the area above 12 taxels for 3 ms", score)],
    )
    measured = (
        "<p id=said></p><script>document.getElementById('said').textContent = JSON.stringify([innerWidth, "
        "...[...document.querySelectorAll('.scroll')].map((e) => e.scrollWidth - e.clientWidth)])</script></body>"
    )
    seen = opened(text.replace("</body>", measured), tmp_path, width)
    assert json.loads(re.search(r'<p id="said">(.*?)</p>', seen)[1]) == [width, 0, 0, 0, 0]
