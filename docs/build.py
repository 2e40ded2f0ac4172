"""The documentation as HTML: python docs/build.py --out DIR.  `site_pages` makes the site, this the API in DIR/api.

Needs no network to build or to read, and comes out with the same bytes on every machine.  Drake's template classes,
which Python knows as `PD_𝓣float𝓤`, appear under their public names with the arguments of their constructors.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib
import inspect
import os
import pkgutil
import re
import sys
import tempfile
import warnings
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest.mock import patch

import pdoc
import pdoc.doc
import pdoc.render
import site_pages as site
from numpy import float64
from numpy.typing import ArrayLike, NDArray
from pydrake.systems.framework import System

import flipdiagram
from flipdiagram.blocks.block import Block
from flipdiagram.scenario.text import Section, explain

PRIVATE = r"!flipdiagram\.(.*\.)?_"
"""What pdoc leaves out: modules with a leading underscore."""

PUBLIC = ("flipdiagram", "flipdiagram.blocks", "flipdiagram.compiled", "flipdiagram.drawing")
"""The package, and the rooms whose modules carry no mark."""

CONVERSIONS = ("ToAutoDiffXd", "ToScalarType", "ToSymbolic")
"""Methods that Drake puts into every template class, without a docstring."""

write_type = inspect.formatannotation

SHORT_TYPES = {
    form: name
    for kind, name in (
        (ArrayLike | None, "ArrayLike | None"),
        (ArrayLike, "ArrayLike"),
        (NDArray[Any], "NDArray"),
        (NDArray[float64], "NDArray[float64]"),
    )
    for form in (write_type(kind), write_type(kind).replace("typing.", ""))
}
"""NumPy's types, which Python writes out in full, as they stand in the source."""


def public_modules() -> list[str]:
    """Names of the package and of every module in it without a leading underscore, in order."""
    found = pkgutil.walk_packages(flipdiagram.__path__, "flipdiagram.")
    names = [module.name for module in found if not any(part.startswith("_") for part in module.name.split("."))]
    return ["flipdiagram", *sorted(names)]


def build(out: Path) -> list[str]:
    """Write the pages of all public modules, the index and the search data into `out`; returns the modules' names."""
    names = public_modules()
    for name in names:
        module = importlib.import_module(name)
        for offered in vars(module).get("__all__", ()):
            getattr(module, offered)  # names that are loaded at their first use
        mark_internal(module)
        show_templates(module)
        show_constructors(module)
        show_units(module)
        show_submodules(module)
    text = f"flipdiagram {flipdiagram.__version__}"
    pdoc.render.configure(
        docformat="markdown", footer_text=text, math=False, mermaid=False, show_source=False, search=False
    )
    with (
        tempfile.TemporaryDirectory() as folder,
        warnings.catch_warnings(),
        patch.object(pdoc.doc, "formatannotation", short_annotation),
        patch.object(inspect, "formatannotation", short_annotation),
    ):
        warnings.simplefilter("error", UserWarning)  # pdoc warns of what it could not read
        pdoc.pdoc("flipdiagram", PRIVATE, output_directory=Path(folder))
        for page in sorted(Path(folder).rglob("*.*")):
            target = out / page.relative_to(folder)
            target.parent.mkdir(parents=True, exist_ok=True)
            text = shared_styles(without_places(page.read_text(encoding="utf-8")), target, out)
            target.write_text(without_indents(text), encoding="utf-8")
    return names


def mark_internal(module: ModuleType) -> None:
    """Say of each module whether its names are for everybody; those of the package itself are."""
    if module.__name__.startswith(PUBLIC[1:]) or module.__name__ == PUBLIC[0]:
        return
    homes = {offered: getattr(flipdiagram, offered) for offered in flipdiagram.__all__}
    public = [name for name, value in homes.items() if getattr(value, "__module__", None) == module.__name__]
    if public:
        names = ", ".join(f"`{name}`" for name in public)
        mark = f"*Public, from `flipdiagram` itself: {names}. The rest is internal and may change in any version.*"
    else:
        mark = "*Internal: may change in any version. What is public is offered by `flipdiagram` itself.*"
    module.__doc__ = f"{(module.__doc__ or '').rstrip()}\n\n{mark}\n"


def show_templates(module: ModuleType) -> None:
    """Let a box, which is Drake's template over float, look like the class that is written in the module."""
    for name, box in list(vars(module).items()):
        if not (isinstance(box, type) and "_construct" in vars(box) and box.__module__ == module.__name__):
            continue
        if not name.isascii():  # Drake enters it by the name that only Python knows
            del vars(module)[name]
            continue
        box.__name__ = box.__qualname__ = name
        box.__init__ = constructor(box)  # type: ignore[misc]
        for attribute, value in list(vars(box).items()):
            if attribute == "scalar" or attribute.startswith(CONVERSIONS) or value is vars(Block).get(attribute):
                delattr(box, attribute)


def constructor(box: type) -> Any:
    """A method `__init__` with the arguments of the box."""

    def __init__(self: Any) -> None:
        raise NotImplementedError  # it is looked at, never called

    signature = inspect.signature(box)
    own = [inspect.Parameter("self", inspect.Parameter.POSITIONAL_OR_KEYWORD), *signature.parameters.values()]
    described: Any = __init__
    described.__signature__ = signature.replace(parameters=own, return_annotation=inspect.Signature.empty)
    described.__qualname__ = f"{box.__qualname__}.__init__"
    return described


def show_constructors(module: ModuleType) -> None:
    """Keep pdoc from describing our constructors with the docstring of Drake's."""
    for value in vars(module).values():
        if isinstance(value, type) and issubclass(value, System) and value.__module__ == module.__name__:
            own = vars(value).get("__init__")
            if own is not None and not own.__doc__:
                own.__doc__ = "The arguments are described with the class."


def show_units(module: ModuleType) -> None:
    """Put the unit of a scenario's field behind its description."""
    for value in vars(module).values():
        if isinstance(value, type) and issubclass(value, Section) and value.__module__ == module.__name__:
            for field in value.model_fields.values():
                field.description = explain(field)


def show_submodules(module: ModuleType) -> None:
    """A package that names what it offers still has modules, and they have pages."""
    if hasattr(module, "__all__") and hasattr(module, "__path__"):
        inside = [found.name for found in pkgutil.iter_modules(module.__path__) if not found.name.startswith("_")]
        offered: list[str] = vars(module)["__all__"]
        vars(module)["__all__"] = [*offered, *(name for name in inside if name not in offered)]


def short_annotation(annotation: Any, *base_module: Any) -> str:
    """A type as text, NumPy's by their short names, a check of pydantic's without the place of its function."""
    text = re.sub(r"<function (\w+) at 0x\w+>", r"\1", write_type(annotation, *base_module))
    for long, short in SHORT_TYPES.items():
        text = text.replace(long, short)
    return text


def shared_styles(page: str, target: Path, out: Path) -> str:
    """A page whose style sheets are files in `out`: they are the same on every page, and most of its bytes."""

    def link(style: re.Match[str]) -> str:
        name = f"style-{hashlib.sha256(style[1].encode()).hexdigest()[:8]}.css"
        (out / name).write_text(style[1], encoding="utf-8")
        up = "../" * (len(target.relative_to(out).parts) - 1)
        return f'<link rel="stylesheet" href="{up}{name}">'

    return re.sub(r"<style>(.*?)</style>", link, page, flags=re.DOTALL)


def without_indents(page: str) -> str:
    """A page without the blanks that begin its lines, save in <pre>: a sixth of its bytes."""
    parts = re.split(r"(<pre>.*?</pre>)", page, flags=re.DOTALL)
    return "".join(part if part.startswith("<pre>") else re.sub(r"\n\s+", "\n", part) for part in parts)


def without_places(text: str) -> str:
    """The text without the folders of this machine, which default values may name."""
    root = Path(flipdiagram.__file__).parents[1]
    places = {sys.executable, sys.prefix, sys.base_prefix, str(root), str(Path.home())} - {"/", "/usr"}
    for place in sorted(places, key=len, reverse=True):
        text = text.replace(place, "…")
    return text


def main() -> None:
    """Build into --out and say where."""
    options = argparse.ArgumentParser(description="Build the site and the API reference.")
    options.add_argument("--out", type=Path, default=Path("out/docs"), metavar="DIR", help="folder (out/docs)")
    out = options.parse_args().out
    if os.environ.get("PYTHONHASHSEED") != "0":  # sets are printed in the order of their hashes
        os.execve(sys.executable, [sys.executable, *sys.argv], {**os.environ, "PYTHONHASHSEED": "0"})
    site.build(out)
    names = build(out / "api")
    print(f"the site, and {len(names)} modules; open {out / 'index.html'}")


if __name__ == "__main__":
    main()
