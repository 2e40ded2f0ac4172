"""Numbers beyond sense: each is refused in one line that names the field and its range."""

import pytest
from hostile.table import Case, check

CASES = [Case("a negative mass", ["plan", "--object.mass", "-1"], 2, ("'object.mass' = -1", "above 0 [kg]"))]


@pytest.mark.parametrize("case", CASES, ids=str)
def test_a_number_beyond_sense_is_one_line(case, tmp_path, monkeypatch, capfd):
    check(case, tmp_path, monkeypatch, capfd)
