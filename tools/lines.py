"""Count the lines of code of the product's parts: `python tools/lines.py`.

A line counts where it holds code: no comment, no docstring, no blank line, no test. Code that a tool
writes counts too; stubs, declarations and tables (`.pyi`, `.d.ts`, `.toml`) do not.
"""

import re
from pathlib import Path

from pygments.lexers import get_lexer_for_filename
from pygments.token import Comment, String

ROOT = Path(__file__).parent.parent
PARTS = {
    "taxel-core": "crates/taxel-core/src",
    "taxel-live": "crates/taxel-live/src",
    "taxel-panel": "crates/taxel-panel/src",
    "page": "crates/taxel-panel/web",
    "border": "crates/taxel-python/src",
    "border, base": "crates/taxel-border/src",
    "python/taxel": "python/taxel",
}
BESIDE = {
    "rules": "rules",
    "studies": "studies/taxel_studies",
    "benchmarks": "benchmarks/taxel_benchmarks",
    "viewers": "viewers/taxel_viewers",
    "bridge": "bridge",
}
TEST_MODULE = re.compile(r"#\[cfg\(test\)\]\s*(?:pub(?:\(\w+\))?\s+)?mod\s+\w+\s*(;|\{)")


def without_tests(rust: str) -> str:
    """Remove `#[cfg(test)] mod NAME { ... }`; the text has no comments and no strings left."""
    while found := TEST_MODULE.search(rust):
        end, depth = found.end(), int(found[1] == "{")
        while depth:
            depth += {"{": 1, "}": -1}.get(rust[end], 0)
            end += 1
        rust = rust[: found.start()] + rust[end:]
    return rust


def code_lines(file: Path) -> int:
    """Return the number of lines of one file that hold code."""
    rust = file.suffix == ".rs"
    kept = []
    for kind, text in get_lexer_for_filename(file.name, stripnl=False).get_tokens(file.read_text(encoding="utf-8")):
        comment = (kind in Comment and kind not in Comment.Preproc) or kind in String.Doc
        literal = rust and (kind in String or kind in String.Char)
        kept.append(re.sub(r"[^\n]", "" if comment else "x", text) if comment or literal else text)
    text = "".join(kept)
    return sum(bool(line.strip()) for line in (without_tests(text) if rust else text).splitlines())


def part_lines(folder: Path) -> int:
    """Return the lines of code below a folder, without tests and libraries of others."""
    files = (file for file in folder.rglob("*") if file.suffix in {".rs", ".py", ".js", ".css", ".html"})
    left_out = {"tests.rs", "tests", "vendor", "results"}
    return sum(code_lines(file) for file in files if not left_out & set(file.relative_to(folder).parts))


def main() -> None:
    """Print a line for each part, the sum of the product, and what stands beside it."""
    product = {name: part_lines(ROOT / folder) for name, folder in PARTS.items()}
    beside = {name: part_lines(ROOT / folder) for name, folder in BESIDE.items()}
    for name, lines in [*product.items(), ("product", sum(product.values())), *beside.items()]:
        print(f"{name:13} {lines:7}")


if __name__ == "__main__":
    main()
