"""Arms of other people's packages, as files for the tests."""

from importlib.metadata import files
from pathlib import Path


def package_file(ending):
    """Path of the file of example-robot-data whose name ends so."""
    (found,) = [file for file in files("example-robot-data") if str(file).endswith(ending)]
    return str(Path(str(found.locate())).resolve())
