"""The panel's page: what the extension hands out, and what its documentation says of it."""

from __future__ import annotations

import http.client
import re
import shutil
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest
from panel.protocol import SOON

from taxel.panel import Panel
from taxel.panel.requests import Requests

ROOT = Path(__file__).resolve().parents[2]
WEB = ROOT / "python/taxel/panel/web"
PAGE = (ROOT / "docs/panel.md").read_text()
SERVED = sorted(
    str(file.relative_to(WEB))
    for file in WEB.rglob("*")
    if file.is_file() and not file.name.endswith((".d.ts", "README.md", "tsconfig.json"))
)
#: Paths of no file of the page.
OUTSIDE = ("../Cargo.toml", "%2e%2e/Cargo.toml", "/etc/passwd", "index.html/")


def test_each_file_is_served_as_it_lies_in_the_folder_and_nothing_else(panel: Panel) -> None:
    line = http.client.HTTPConnection(*panel.address, timeout=SOON)
    for name in (*SERVED, "uPlot.js", "vendor", "BOARD.JS", "vendor/../board.js", *OUTSIDE):
        line.request("GET", f"/{name}")
        answer = line.getresponse()
        found = answer.read()
        assert (answer.status, found) == ((200, (WEB / name).read_bytes()) if name in SERVED else (404, b"")), name
    line.close()


def test_every_part_that_the_program_looks_for_is_in_the_page() -> None:
    html = (WEB / "index.html").read_text()
    ids = re.findall(r'\bid="([^"]+)"', html)
    assert len(ids) == len(set(ids))
    said = {name for file in WEB.glob("*.js") for name in re.findall(r'\bpart\("([^"]+)"', file.read_text())}
    assert said
    assert said <= set(ids)
    for attribute in ("for", "aria-labelledby", "aria-describedby", "aria-controls", "list"):
        for names in re.findall(rf'\b{attribute}="([^"]+)"', html):
            assert set(names.split()) <= set(ids), f"{attribute}={names}"


def test_the_page_asks_nobody_else_for_anything() -> None:
    for name in SERVED:
        if not name.endswith("LICENSE") and name != "vendor/uPlot.js":
            text = (WEB / name).read_text().replace("http://www.w3.org/2000/svg", "")
            assert not re.search(r"https?://", text), name
    html = (WEB / "index.html").read_text()
    # The content security policy must not allow these.
    assert not re.search(r"\bstyle=|\bon[a-z]+=|<style|<script(?![^>]*\bsrc=)", html)


def test_the_documentation_lists_every_key() -> None:
    """Its directive finds the keys by a pattern, one for each action."""
    source = (WEB / "keys.js").read_text()
    [pattern] = re.findall(r"^KEY = r'(.*)'$", (ROOT / "docs/from_program.py").read_text(), re.MULTILINE)
    assert len(re.findall(pattern, source)) == source.count('action: "')
    assert ".. keys::" in PAGE.split("## Keys")[1]


def test_what_the_page_computes_without_a_browser() -> None:
    node = shutil.which("node") or shutil.which("node", path=str(Path(sys.executable).parent))
    if node is None:
        pytest.skip("no node")
    command = [node, "--test", Path(__file__).with_name("page.test.mjs")]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_the_page_knows_each_request_by_the_keys_that_its_method_declares() -> None:
    """The types of the page are written by hand."""
    text = (WEB / "messages.d.ts").read_text()
    known = {}
    for body in re.findall(r"export interface \w+Request \{(.*?)^\}", text, re.MULTILINE | re.DOTALL):
        (kind,) = re.findall(r'^  type: "(\w+)";', body, re.MULTILINE)
        keys = re.findall(r"^  (\w+)(\??):", body, re.MULTILINE)
        known[kind] = {key: bool(may_lack) for key, may_lack in keys if key not in ("type", "id")}
    assert known == {
        name: {one.name: not one.required for one in msgspec.structs.fields(request.keys)}
        for name, request in Requests.requests.items()
    }
