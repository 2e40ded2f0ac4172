"""The Python snippets of README and docs/ under `mypy --strict`, as a user who types calls us: for `make lint`.

Not a test: the types that Drake or a library published last night say nothing of whether the package works here.
"""

import re
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from mypy import api

ROOT = Path(__file__).parents[1]
UNTYPED = {"embed.md", "linearise.md", "challenge.md"}
"""Pages whose calls Drake's own stubs refuse: a port's Eval is an `object` there, and arrays have shape and dtype swapped;
and what enters the challenge, which asks for no types."""
PAGES = (ROOT / "README.md", *(page for page in sorted((ROOT / "docs").rglob("*.md")) if page.name not in UNTYPED))
SETTINGS = ("--strict", "--follow-imports=silent", "--config-file=", f"--cache-dir={ROOT / '.mypy_cache' / 'snippets'}")
"""silent: what is wrong inside the packages that a snippet imports is told elsewhere, or by nobody."""


def programs(page: Path) -> list[str]:
    """The Python snippets of a page: each alone in the README, one after another on a page of docs/, as they are run."""
    text = page.read_text(encoding="utf-8")
    found = re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    return found if page.name == "README.md" else ["\n".join(found)] if found else []


def main() -> int:
    """Check all of them at once; mypy's report names the page."""
    with TemporaryDirectory() as folder:
        files = []
        for page in PAGES:
            for number, program in enumerate(programs(page), 1):
                name = re.sub(r"\W", "_", str(page.relative_to(ROOT).with_suffix("")))
                files.append(Path(folder) / f"{name}_{number}.py")
                files[-1].write_text(program, encoding="utf-8")
        report, errors, status = api.run([*SETTINGS, *map(str, files)])
        print(report.replace(f"{folder}/", "").rstrip(), errors, sep="", flush=True)
        return status


if __name__ == "__main__":
    sys.exit(main())
