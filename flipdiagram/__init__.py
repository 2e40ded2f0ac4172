"""A robot arm turns a block over on a spatula: acceleration control as a block diagram in Drake."""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("flipdiagram")
except PackageNotFoundError:  # run from a checkout that was never installed
    __version__ = "0+unknown"
