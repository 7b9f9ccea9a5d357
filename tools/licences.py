"""Write the licences of the crates that a compiled part contains to the `LICENSES-OF-CRATES.txt` of its wheel.

Usage: python tools/licences.py [--check], after a change of Cargo.lock. Of a crate that may be used under Apache-2.0 the text is that of
`LICENSE`, so it has its name there, and its notice if there is one; of any other the texts that its package has, or MIT's with the authors
that it names, or its repository.
"""

import json
import re
import subprocess
import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
#: Crates with a compiled part, and the text beside the pyproject.toml of each.
PAGES = {"taxel-python": ROOT / "LICENSES-OF-CRATES.txt", "taxel-rules": ROOT / "rules" / "LICENSES-OF-CRATES.txt"}
#: Where crates with a C library have its licence.
OF_LIBRARIES = {"lz4-sys": "liblz4/lib/LICENSE", "zstd-sys": "zstd/LICENSE"}
TEXTS = re.compile(r"(licen[cs]e|copying|unlicense|copyright|notice)", re.IGNORECASE)
MIT = """MIT License

Copyright (c) {authors}

Permission is hereby granted, free of charge, to any person obtaining a copy of this software and associated documentation files (the
"Software"), to deal in the Software without restriction, including without limitation the rights to use, copy, modify, merge, publish,
distribute, sublicense, and/or sell copies of the Software, and to permit persons to whom the Software is furnished to do so, subject to
the following conditions:

The above copyright notice and this permission notice shall be included in all copies or substantial portions of the Software.

THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING BUT NOT LIMITED TO THE WARRANTIES OF
MERCHANTABILITY, FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS OR COPYRIGHT HOLDERS BE LIABLE FOR
ANY CLAIM, DAMAGES OR OTHER LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM, OUT OF OR IN CONNECTION WITH
THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE SOFTWARE."""


def cargo(*arguments: str) -> str:
    """Return what cargo prints."""
    command = ["cargo", *arguments, "--locked"]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout


def linked(crate: str) -> list[dict[str, Any]]:
    """Return what cargo knows of each crate of others that a crate is compiled with."""
    tree = cargo(
        "tree", "--package", crate, "--edges", "normal", "--target", "all", "--prefix", "none", "--format", "{p}"
    )
    names = {tuple(line.split()[:2]) for line in tree.splitlines() if line}
    packages = json.loads(cargo("metadata", "--format-version", "1"))["packages"]
    found = [p for p in packages if p["source"] and (p["name"], f"v{p['version']}") in names]
    return sorted(found, key=lambda package: (package["name"], package["version"]))


def page(crate: str) -> str:
    """Return the text for a crate with a compiled part."""
    apache, texts = [], defaultdict(list)
    for package in linked(crate):
        name, licence = f"{package['name']} {package['version']}", package["license"]
        told = f"{name} ({licence}, {package['repository']})"
        inside = sorted(Path(package["manifest_path"]).parent.iterdir())
        # Where there is a choice it is not the GPL.
        files = [file for file in inside if file.is_file() and TEXTS.match(file.name) and "GPL" not in file.name]
        if package["name"] in OF_LIBRARIES:
            files.append(Path(package["manifest_path"]).parent / OF_LIBRARIES[package["name"]])
        if " AND " not in licence and "Apache-2.0" in re.split(r" OR | ?/ ?", licence):
            apache.append(name)
            files = [file for file in files if file.name.lower().startswith("notice")]
        elif not files and licence == "MIT":
            authors = ", ".join(package["authors"]) or f"the authors of {package['repository']}"
            texts[MIT.format(authors=authors)].append(told)
        elif not files:
            raise SystemExit(f"{name} is under {licence}, and its package has no text of that")
        for file in files:
            texts[file.read_text(encoding="utf-8").strip()].append(told)
    parts = [
        f"The compiled part of {crate} contains these crates under the Apache License, Version 2.0:\n"
        + "\n".join(apache)
    ]
    parts += [f"These contain the text below: {', '.join(names)}\n\n{text}" for text, names in texts.items()]
    return f"\n\n{'-' * 80}\n".join(parts) + "\n"


def main() -> int:
    """Write the texts, or say which is not as made."""
    made = {file: page(crate) for crate, file in PAGES.items()}
    other = [file for file, text in made.items() if not file.exists() or file.read_text(encoding="utf-8") != text]
    if "--check" in sys.argv:
        for file in other:
            print(f"{file.relative_to(ROOT)} is not as made: python tools/licences.py")
        return 1 if other else 0
    for file in other:
        file.write_text(made[file], encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
