from typing import Any

import numpy as np
import pytest
from pydrake.symbolic import Variable

from flipdiagram.blocks._checks import channels, nominal_inertia, same_form, sampling, times_inertia
from flipdiagram.errors import InputError


def test_one_number_stands_for_all_channels() -> None:
    assert channels("k", 2.0, 3).tolist() == [2.0, 2.0, 2.0]
    assert channels("k", [1, 2]).tolist() == [1.0, 2.0]


def test_channels_copies_its_argument() -> None:
    mine = np.ones(2)
    channels("k", mine)[0] = 5.0
    assert mine.tolist() == [1.0, 1.0]


@pytest.mark.parametrize("bad", [[1.0, 2.0], [[1.0, 2.0, 3.0]], [], [1.0, -1.0, 1.0], [1.0, np.nan, 1.0], np.inf])
def test_bad_channels_are_named(bad: Any) -> None:
    with pytest.raises(InputError, match="my_gain"):
        channels("my_gain", bad, 3)


def test_strict_excludes_the_bound() -> None:
    assert channels("k", [0.0])[0] == 0.0
    with pytest.raises(InputError, match="> 0"):
        channels("k", [0.0], strict=True)


def test_symbols_are_accepted_unchecked() -> None:
    k = Variable("k")
    assert channels("k", [k, k]).dtype == object


@pytest.mark.parametrize(
    "bad", [[1.0, 0.0], [[1.0, 2.0], [2.0, 1.0]], [[1.0, 1.0], [0.0, 1.0]], np.ones((2, 3)), np.ones((1, 1, 1))]
)
def test_nominal_inertia_must_be_positive_definite(bad: Any) -> None:
    with pytest.raises(InputError, match="nominal inertia"):
        nominal_inertia("nominal inertia", bad)


def test_times_inertia_diagonal_and_matrix() -> None:
    v = np.array([1.0, -1.0])
    assert times_inertia(np.array([2.0, 3.0]), v).tolist() == [2.0, -3.0]
    assert times_inertia(np.array([[2.0, 1.0], [1.0, 3.0]]), v).tolist() == [1.0, -2.0]


def test_same_form_spreads_a_diagonal_and_refuses_the_rest() -> None:
    assert same_form("inertia", np.array([2.0, 3.0]), np.eye(2)).tolist() == [[2.0, 0.0], [0.0, 3.0]]
    with pytest.raises(InputError, match=r"\(2, 2\).*\(2,\)"):
        same_form("inertia", np.eye(2), np.ones(2))


@pytest.mark.parametrize(("period", "offset"), [(0.0, 0.0), (-1.0, 0.0), (np.nan, 0.0), (1.0, -1.0), (1.0, np.inf)])
def test_sampling_is_checked(period: float, offset: float) -> None:
    with pytest.raises(InputError, match="period|offset"):
        sampling(period, offset)
