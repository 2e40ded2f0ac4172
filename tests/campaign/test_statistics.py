"""Intervals and tests against numbers worked by hand and simulated coverage."""

import numpy as np
import pytest

from flipdiagram.campaign.statistics import holm, mcnemar, paired_difference, wilson


def test_wilsons_interval_worked_by_hand():
    # p = 0.8, n = 10, z = 1.96: (0.8 + 0.19208 ± 1.96 √(0.016 + 0.009604)) / 1.38416
    assert wilson(8, 10) == pytest.approx((0.4902, 0.9433), abs=1e-4)
    # p = 0: 0 and 3.8416 / (10 + 3.8416)
    assert wilson(0, 10) == pytest.approx((0.0, 0.27754), abs=1e-5) and wilson(10, 10)[1] == 1.0
    assert wilson(0, 0) == (0.0, 1.0)


def test_mcnemar_worked_by_hand():
    assert mcnemar(1, 6) == pytest.approx(2 * (1 + 7) / 2**7)
    assert mcnemar(0, 0) == 1.0
    assert mcnemar(4, 4) == 1.0


def test_a_paired_difference_is_antisymmetric_and_narrower_where_the_pairs_agree():
    d, low, high = paired_difference(20, 12, 2, 16)
    assert d == pytest.approx(0.2) and low < d < high
    e, other_low, other_high = paired_difference(20, 2, 12, 16)
    assert (e, other_low, other_high) == pytest.approx((-d, -high, -low))
    unpaired_like = paired_difference(15, 17, 7, 11)  # the same rates, pairs independent
    assert high - low < unpaired_like[2] - unpaired_like[1]
    assert paired_difference(0, 0, 0, 0) == (0.0, -1.0, 1.0)
    d, low, high = paired_difference(24, 0, 0, 0)
    assert d == 0 and -0.2 < low < 0 < high < 0.2


@pytest.mark.parametrize("shared", [0.0, 0.6])
def test_the_interval_of_a_paired_difference_covers_the_true_one(shared):
    draw, n, hits = np.random.default_rng(1), 40, 0
    for _ in range(1500):
        u = draw.random(n)
        v = np.where(draw.random(n) < shared, u, draw.random(n))
        a, b = u < 0.7, v < 0.45
        _, low, high = paired_difference(*(int(x.sum()) for x in (a & b, a & ~b, ~a & b, ~a & ~b)))
        hits += low <= 0.25 <= high
    assert 0.93 < hits / 1500 < 0.985


def test_holms_adjustment_worked_by_hand():
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([]) == []
