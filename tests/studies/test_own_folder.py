"""A study's folder is its own: another study's results are not removed."""

import json

import pytest

from flipdiagram.errors import InputError
from flipdiagram.studies.registry import STUDIES


def test_the_results_of_another_study_are_refused_in_one_line(tmp_path):
    (tmp_path / "summary.json").write_text(json.dumps({"schema": "flipdiagram/turnover/1"}))
    with pytest.raises(InputError) as caught, STUDIES["place"].replacing(tmp_path):
        raise AssertionError("it must not begin")
    assert str(caught.value) == (
        f"--out = '{tmp_path}' holds results of another study, 'flipdiagram/turnover/1'; valid is another folder"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["summary.json"]


def test_its_own_and_what_is_no_summary_of_ours_are_not(tmp_path):
    for k, text in enumerate(("[]", "no JSON", '{"schema": 3}')):
        folder = tmp_path / str(k)
        folder.mkdir()
        (folder / "summary.json").write_text(text)
        # a file of somebody's in the place of the summary: `renewed` says what it says of any without a list
        with pytest.raises(InputError, match="older flipdiagram"), STUDIES["place"].replacing(folder):
            pass
    with STUDIES["place"].replacing(tmp_path / "new"):
        (tmp_path / "new" / "mine.txt").write_text("begun")
    assert (tmp_path / "new" / "mine.txt").exists()
