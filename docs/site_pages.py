"""The documentation as a site: the pages of docs/ with what can be generated, by MkDocs with Material's theme.

    python docs/build.py --out DIR      the site, and in DIR/api the API reference

Every file how-to/*.md and explanation/*.md appears under its first heading.  Nothing is loaded from elsewhere.
"""

from __future__ import annotations

import json
import logging
import re
import shutil
import tempfile
from pathlib import Path
from typing import Any, get_args

from mkdocs.commands.build import build as run_mkdocs
from mkdocs.config import load_config
from PIL import Image

from flipdiagram.cli.options import parser
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.scenario.text import explain, fields_of

DOCS = Path(__file__).resolve().parent
FIRST = {"how-to": ("own-block", "own-arm", "own-object", "embed", "python", "campaign", "cluster"), "explanation": ()}
"""Pages that come first in their part, in this order; the others follow by name."""
CONFIG: dict[str, Any] = {
    "site_name": "flipdiagram",
    "use_directory_urls": False,  # so that it can be read without a server
    "theme": {
        "name": "material",
        "font": False,
        "features": ["navigation.tabs", "navigation.sections", "navigation.footer", "content.code.copy"],
        "palette": [
            {"scheme": "default", "primary": "blue grey", "media": "(prefers-color-scheme: light)"},
            {"scheme": "slate", "primary": "blue grey", "media": "(prefers-color-scheme: dark)"},
        ],
    },
    "plugins": ["search"],
    "markdown_extensions": ["tables", "fenced_code", "pymdownx.highlight", {"toc": {"permalink": True}}],
    "validation": {"links": {"not_found": "warn"}},
    "extra": {"generator": False},
    "extra_css": ["site.css"],
}
CSS = ".md-typeset table:not([class]){font-size:.65rem}.md-grid{max-width:70rem}.md-typeset h1{color:inherit}\n"


def build(out: Path) -> None:
    """Write the site into `out`; raises SystemExit where a page links to what is not there."""
    with tempfile.TemporaryDirectory() as folder:
        pages = Path(folder) / "pages"
        shutil.copytree(DOCS, pages, ignore=shutil.ignore_patterns("*.py", "*.json", "__pycache__"))
        (pages / "reference" / "cli.md").write_text(command_page(), encoding="utf-8")
        (pages / "reference" / "scenario.md").write_text(scenario_page(), encoding="utf-8")
        (pages / "site.css").write_text(CSS, encoding="utf-8")
        changes = (DOCS.parent / "CHANGELOG.md").read_text(encoding="utf-8")
        (pages / "changelog.md").write_text(changes.replace("](docs/", "]("), encoding="utf-8")
        fewer_colours(pages)
        logging.basicConfig(level=logging.WARNING, format="%(message)s")
        places = {"docs_dir": str(pages), "site_dir": str(out.resolve()), "nav": navigation(pages)}
        file = Path(folder) / "mkdocs.yml"  # which MkDocs must have
        file.write_text(json.dumps(CONFIG | places), encoding="utf-8")
        run_mkdocs(load_config(str(file), strict=True))
    # maps of scripts, other languages, and what is for a site that has an address, with the day of the build
    for unused in ("**/*.map", "assets/javascripts/lunr", "sitemap.xml*"):
        for path in out.glob(unused):
            shutil.rmtree(path) if path.is_dir() else path.unlink()


def fewer_colours(folder: Path) -> None:
    """Pictures with a palette of 256 colours: of figures it shows no difference, at a fraction of the bytes."""
    for path in sorted(folder.rglob("*.png")):
        with Image.open(path) as picture:
            palette = picture.convert("RGB").quantize(256)
        palette.save(path, optimize=True)


def navigation(pages: Path) -> list[dict[str, Any]]:
    """The parts of the site, each with its pages."""

    def part(folder: str) -> list[str]:
        names = {path.stem: path for path in (pages / folder).glob("*.md")}
        first = [name for name in FIRST[folder] if name in names]
        return [f"{folder}/{name}.md" for name in [*first, *sorted(names.keys() - set(first))]]

    reference = [
        {"Command line": "reference/cli.md"},
        {"Fields of the scenario": "reference/scenario.md"},
        {"Files": "reference/files.md"},
        {"Python": "reference/python.md"},
        {"Changes": "changelog.md"},
    ]
    results = [{"Report": "report/report.md"}, {"Two engines": "engines.md"}, {"Speed": "bench.md"}]
    return [
        {"Home": "index.md"},
        {"Tutorial": "tutorial.md"},
        {"How to": part("how-to")},
        {"Explanation": part("explanation")},
        {"Results": results},
        {"Reference": reference},
    ]


def command_page() -> str:
    """Every command with its help, as the command line prints it."""
    whole = parser()
    (commands,) = (action for action in whole._actions if hasattr(action, "choices") and action.dest == "command")
    text = "# Command line\n\nExit codes: 0 done, 2 bad input, 3 the physics or the planner said no, 130 interrupted.\n"
    for name, command in dict(commands.choices or {}).items():
        text += f"\n## {name}\n\n```text\n{command.format_help().rstrip()}\n```\n"
    return text


def scenario_page() -> str:
    """Every field with default, meaning, unit and bounds, a table for each section."""
    text = (
        "# Fields of the scenario\n\nEach is an option of all commands that take a scenario: `--controller.k_p 400`.\n"
    )
    sources = "(p) the paper, (H) (M) (L) confidence in published data, (o) our choice, (c) what calibration left."
    text += f"\nSources: {sources}\n"
    section = ""
    for path, field in fields_of(Scenario).items():
        if path.partition(".")[0] != section:
            section = path.partition(".")[0]
            text += f"\n## {section}\n\n| field | default | meaning [unit, bounds] |\n| --- | --- | --- |\n"
        choices = [str(value) for value in get_args(field.annotation) if isinstance(value, str)]
        meaning = explain(field) + (f"; one of {', '.join(choices)}" if choices else "")
        default = "null" if field.default is None else re.sub(r"^\((.*?),?\)$", r"[\1]", str(field.default))
        text += f"| `{path}` | `{default}` | {meaning.replace('|', chr(92) + '|')} |\n"
    return text
