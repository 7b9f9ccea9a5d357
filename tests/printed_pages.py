"""Pages of the documentation and the commands that they print."""

import re
from pathlib import Path

ROOT = Path(__file__).parent.parent


README = ROOT / "README.md"
#: What `make` can be asked for.
_RULES = re.findall(r"^([a-z][\w -]*):", (ROOT / "Makefile").read_text(), re.MULTILINE)
TARGETS = {target for rule in _RULES for target in rule.split()}


def shell_lines(page: Path) -> list[str]:
    """Return the shell commands of a page, without comments."""
    fenced = re.findall(r"^```(\S*)[^\n]*\n(.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL)
    blocks = [block for language, block in fenced if language in ("", "bash", "console", "powershell", "sh", "shell")]
    lines = [re.sub(r"\s+#.*", "", line).strip() for block in blocks for line in block.splitlines()]
    return [line for line in lines if re.match(r"(taxel|make|source|pip|cargo|\.venv/bin/taxel) ", line)]
