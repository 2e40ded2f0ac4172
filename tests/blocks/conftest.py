"""One block alone: build a context, fix its inputs by name, read an output."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import settings

settings.register_profile("deterministic", derandomize=True, deadline=None)
settings.load_profile("deterministic")


def _context(block: Any, **inputs: Any) -> Any:
    context = block.CreateDefaultContext()
    for name, value in inputs.items():
        block.GetInputPort(name).FixValue(context, np.asarray(value))
    return context


def _feedthrough(block: Any) -> set[tuple[str, str]]:
    return {
        (block.get_input_port(i).get_name(), block.get_output_port(j).get_name())
        for i in range(block.num_input_ports())
        for j in range(block.num_output_ports())
        if block.HasDirectFeedthrough(i, j)
    }


@pytest.fixture
def context_of() -> Callable[..., Any]:
    """context_of(block, port=value, ...): a default context with these inputs fixed."""
    return _context


@pytest.fixture
def feedthrough_of() -> Callable[[Any], set[tuple[str, str]]]:
    """feedthrough_of(block): the (input, output) names with direct feed-through."""
    return _feedthrough
