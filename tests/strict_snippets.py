"""Every Python snippet of the README and of docs/ under `mypy --strict`, as a user who types calls us: for `make lint`.

Not a test: the types that Drake or a library published last night say nothing of whether the package works here.
"""

import re
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from mypy import api

ROOT = Path(__file__).parents[1]
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
SETTINGS = ("--strict", "--follow-imports=silent", "--config-file=", f"--cache-dir={ROOT / '.mypy_cache' / 'snippets'}")
"""silent: what is wrong inside the packages that a snippet imports is told elsewhere, or by nobody."""


def snippets(page: Path) -> list[str]:
    """The Python snippets of a page."""
    return re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


def main() -> int:
    """Check all of them at once; mypy's report names page and snippet."""
    with TemporaryDirectory() as folder:
        files = []
        for page in PAGES:
            for number, snippet in enumerate(snippets(page), 1):
                name = re.sub(r"\W", "_", str(page.relative_to(ROOT).with_suffix("")))
                files.append(Path(folder) / f"{name}_snippet_{number}.py")
                files[-1].write_text(snippet, encoding="utf-8")
        report, errors, status = api.run([*SETTINGS, *map(str, files)])
        print(report.replace(f"{folder}/", "").rstrip(), errors, sep="", flush=True)
        return status


if __name__ == "__main__":
    sys.exit(main())
