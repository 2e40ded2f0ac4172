"""Digests of the code that decides a result: a stored one is used again only where it would come out the same."""

from __future__ import annotations

import hashlib
import json
from functools import cache
from pathlib import Path

from flipdiagram.files import versions
from flipdiagram.robot.model_files import urdf_directory


@cache
def code_version(modules: tuple[str, ...]) -> str:
    """Digest of our modules (files or folders by name), the model files, and the versions of Drake, Python and ours."""
    package = Path(__file__).parents[1]
    files = [path for name in modules for path in (package / f"{name}.py", *sorted((package / name).rglob("*.py")))]
    files += sorted(urdf_directory().glob("*df"))
    digest = hashlib.sha256(json.dumps(versions(), sort_keys=True).encode())
    for path in files:
        if path.is_file():
            digest.update(path.read_bytes())
    return digest.hexdigest()
