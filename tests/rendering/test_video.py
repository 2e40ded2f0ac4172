"""The video: its name is checked first, it is small and the same each time, and says what happened when it has happened."""

import numpy as np
import pytest
from ideal import IDEAL
from PIL import Image
from synthetic import DROP, RELEASE, TOUCHDOWN, recording

from flipdiagram.cli import main as cli
from flipdiagram.errors import InputError
from flipdiagram.rendering import snapshots, video
from flipdiagram.simulation.course import course, decided_at

SHOWN = ("pd", "pd+ff+dob")


@pytest.fixture(scope="module")
def write(tmp_path_factory):
    """Writes a video whose pictures are grey, and counts them."""
    folder, taken = tmp_path_factory.mktemp("video"), []

    def grey(scenario, camera, q, tool, block, surface):
        taken.append(len(q))
        return np.full((len(q), camera.size, camera.size, 3), 128, np.uint8), "only grey"

    def write(name):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(snapshots, "pictures", grey)
            note = video.write_video({a: recording(a) for a in reversed(SHOWN)}, IDEAL, folder / name)
        return folder / name, note, taken

    return write


@pytest.fixture(scope="module")
def gif(write):
    return write("a.gif")


def has(picture, colour, column):
    """Whether the text below a picture, or the bar above it, has pixels of a colour."""
    left = column * (video.SIZE + video.MARGIN)
    cell = np.asarray(picture.convert("RGB")).astype(int)[:, left : left + video.SIZE]
    wanted = [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
    return bool((np.abs(cell - wanted).max(axis=-1) < 12).any())


def at(path, time):
    """The picture that is shown at a time of the motion [s]."""
    with Image.open(path) as film:
        until, wanted, k = -video.BEFORE, time + 1e-6, 0
        while until + film.info["duration"] / 1000 / video.SLOWDOWN <= wanted and k < film.n_frames - 1:
            until += film.info["duration"] / 1000 / video.SLOWDOWN
            k += 1
            film.seek(k)
        return film.copy()


def test_it_is_short_small_endless_and_gives_the_reason_of_drawings(gif):
    path, note, _ = gif
    assert note == "only grey" and path.stat().st_size < 2e6
    with Image.open(path) as film:
        assert film.info["loop"] == 0
        assert film.size[0] == 2 * video.SIZE + video.MARGIN
        durations = []
        for k in range(film.n_frames):
            film.seek(k)
            durations.append(film.info["duration"])
    shown = (video.BEFORE + TOUCHDOWN + video.AFTER) * video.SLOWDOWN
    assert sum(durations) / 1000 == pytest.approx(shown + video.LAST / 1000, abs=0.15)


def test_the_verdict_is_shown_when_it_is_plain_and_not_before(gif):
    path, _, _ = gif
    before, lost, end = at(path, DROP["pd"] - 0.02), at(path, DROP["pd"] + 0.02), at(path, 9.0)
    assert not has(before, video.BAD, 0) and has(lost, video.BAD, 0) and has(end, video.BAD, 0)
    assert not has(lost, video.GOOD, 1) and has(end, video.GOOD, 1) and not has(end, video.BAD, 1)


def test_pictures_of_rest_are_taken_once(gif):
    _, _, taken = gif
    frames = len(np.arange(-video.BEFORE, TOUCHDOWN + video.AFTER, video.FRAME / 1000 / video.SLOWDOWN))
    assert len(SHOWN) * frames * 0.5 < sum(taken) < len(SHOWN) * frames


def test_the_same_recordings_give_the_same_bytes(gif, write):
    assert write("b.gif")[0].read_bytes() == gif[0].read_bytes()


def test_webp_by_the_ending(write):
    with Image.open(write("c.WebP")[0]) as film:
        assert film.format == "WEBP" and film.n_frames > 20


@pytest.mark.parametrize("name", ["flip.mp4", "flip", "nowhere/flip.gif", "", "\0.gif"])
def test_a_bad_name_is_refused_before_anything_is_flown(name, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["flip", "--video", name]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and f"--video = {name!r}; valid is a" in said
    assert list(tmp_path.iterdir()) == []


def test_a_folder_is_no_video(tmp_path):
    (tmp_path / "a.gif").mkdir()
    with pytest.raises(InputError, match="valid is a file in a folder that exists"):
        video.video_file(str(tmp_path / "a.gif"))


def test_the_course_tells_what_happened_in_order():
    happened = course(recording())
    assert [text.rpartition(",")[0] for _, text in happened] == ["block left the blade", "block touched the table"]
    assert happened[0].time_s == pytest.approx(RELEASE, abs=2e-3) and happened[1].time_s == decided_at(recording())
    struck = recording("pd").copy(deep=True)
    struck["contact_force"].loc[{"pair": "table-blade", "time": slice(0.1, 0.12)}] = 5.0
    first, *rest = course(struck)
    assert first == (pytest.approx(0.1), "blade struck the table") and len(rest) == 2
    assert decided_at(struck) == pytest.approx(DROP["pd"], abs=2e-3)


def test_the_course_of_what_is_laid_down_ends_when_the_blade_is_drawn_away():
    laid = recording().copy(deep=True)
    laid["contact_force"].loc[{"pair": "table-block", "time": slice(0.3, None)}] = 1.0
    assert [round(time, 3) for time, _ in course(laid)][0] == 0.3
    assert course(laid)[-1].time_s == pytest.approx(RELEASE, abs=2e-3)
    slid = recording().copy(deep=True)
    slid["block_pose"].loc[{"time": slice(0.2, None), "pose": "y"}] += 0.02
    assert (pytest.approx(0.2, abs=2e-3), "block had slid by 1 cm") in course(slid)
