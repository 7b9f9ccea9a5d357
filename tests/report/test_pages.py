"""Pages of reports: their figures are SVG in the page's colours, and a page needs nothing but itself."""

from __future__ import annotations

import re

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure
from tests.panel.pages import opened

from taxel.report.page import render
from taxel.report.svg import INK, STYLE, picture


def axes_of(**how):
    figure = Figure(**how)
    return figure, figure.subplots()


def test_a_figure_takes_the_pages_colours_and_keeps_its_own():
    with mpl.rc_context(STYLE):
        figure, axes = axes_of()
        axes.plot([1, 2, 3], [1, 3, 2], color=INK, label="a line")
        axes.plot([1, 2, 3], [2, 1, 3], color="#b5423c")
        axes.legend()
        axes.set_xlabel("time, s")
        html = picture(figure)
    assert html.startswith('<div class="picture"><svg')
    assert {"--ink", "--card"} == set(re.findall(r"var\((--\w+)\)", html))
    assert "#b5423c" in html
    assert not re.search(f"{INK}|#000000|#ffffff", html)
    assert ">time, s</text>" in html
    assert ">a line</text>" in html


@pytest.mark.parametrize(("draw", "marks"), [("bar", 3000), ("plot", 6000), ("scatter", 6000), ("vlines", 6000)])
def test_a_figure_of_many_marks_stays_small_and_keeps_its_words(draw, marks):
    y = np.random.default_rng(1).normal(size=marks)
    x = np.arange(len(y))
    with mpl.rc_context(STYLE):
        figure, axes = axes_of(figsize=(6.5, 2.2), layout="constrained")
        {
            "bar": lambda: axes.bar(x, y),
            "plot": lambda: axes.plot(x, y, "."),
            "scatter": lambda: axes.scatter(x, y),
            "vlines": lambda: axes.vlines(x, 0.0, y),
        }[draw]()
        axes.set_ylabel("weight, mV")
        html = picture(figure)
    assert html.startswith('<div class="picture light"><svg')
    assert len(html) < 300_000
    assert "<image" in html
    assert ">weight, mV</text>" in html


def page(*figures):
    return detections(drawn={"contact": [picture(figure) for figure in figures]})


def detections(**values):
    """Return the page of some detections."""
    empty = {
        "tables": [],
        "warnings": [],
        "printed": [],
        "nearest": [],
        "worst": [],
        "first": [],
    }
    empty |= {"title": "a page", "judged": "", "readout": "none", "neurons": True, "drawn": {}}
    return render("report/listening.html.j2", **empty | values)


def some():
    figure = Figure()
    left, right = figure.subplots(1, 2)
    left.plot([1, 2, 3], [3, 1, 2], label="a line")
    left.legend()
    right.imshow(np.eye(4))
    figure.subplots_adjust()
    other, axes = axes_of(figsize=(12.0, 3.0))
    axes.bar([1, 2], [3, 4])
    axes.set(yscale="log", ylim=(0.1, 10))
    return figure, other


def test_a_page_needs_nothing_but_itself():
    text = page(*some())
    assert not re.search(r"""(?:src|href)\s*=\s*["'](?!data:|#)""", text)
    assert not re.search(r"@import|url\((?!data:|#)", text)
    assert "<script" not in text
    assert "prefers-color-scheme: dark" in text


#: How wide the window, all that it shows, and each figure are, px.
WIDTHS = """() => [innerWidth, document.documentElement.scrollWidth,
    ...[...document.querySelectorAll(".picture svg")].map(e => Math.round(e.getBoundingClientRect().width))]"""


@pytest.mark.parametrize("width", [1400, 390])
def test_a_browser_shows_figures_as_large_as_they_were_drawn_and_no_page_is_too_wide(chromium, tmp_path, width):
    place = tmp_path / "page.html"
    place.write_text(page(*some()), encoding="utf-8")
    with opened(chromium, place.as_uri(), width=width) as seen:
        inner, wide, *shown = seen.evaluate(WIDTHS)
    assert wide <= inner == width
    # 6.4 and 12 inches of 96 pixels, which a narrow window makes smaller.
    assert shown[0] == min(614, shown[1])
    assert (width < 614) == (shown[0] < 614)
    assert shown[1] <= min(1152, width)
