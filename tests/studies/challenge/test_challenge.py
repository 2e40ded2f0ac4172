"""The challenge as a whole: frozen worlds, the score, the command, the leaderboard."""

import json
import re
from pathlib import Path

import pytest
import recorded

from flipdiagram import InputError
from flipdiagram.cli import main as cli
from flipdiagram.flips.child_process import Limits
from flipdiagram.flips.workers import Workers
from flipdiagram.scenario.scenario import Scenario
from flipdiagram.studies.challenge import run as challenge
from flipdiagram.studies.challenge.entry import load_entry
from flipdiagram.studies.challenge.flying import fly_entry, plan_entry
from flipdiagram.studies.challenge.leaderboard import markdown, rank
from flipdiagram.studies.challenge.score import load_results, paired_with, problems, scores
from flipdiagram.studies.challenge.suites import load_suites, read_secret

SECRET = "0123456789abcdef"
RAISING = "def control(t, x_cmd, v_cmd, a_cmd, q, qd, memory):\n    raise ValueError('not ready')\n"


@pytest.fixture(scope="module")
def suites():
    return load_suites()


# Worlds


def test_version_1_is_frozen(suites):
    """Its digest is that of all numbers of its 52 public worlds: whoever changes one makes another benchmark."""
    assert suites.version == "v1" and suites.names == ("nominal", "uncertain", "disturbed", "hard")
    assert suites.digest.startswith("d72aa72bc9159a88")


def test_every_world_can_be_and_has_a_hash_of_its_own(suites):
    worlds = suites.worlds(suites.names) + suites.worlds(suites.names, SECRET)
    assert len(worlds) == 52 + 44 and len({world.hash for world in worlds}) == len(worlds)
    for world in worlds[::5]:
        world.truth("mujoco", {"controller.k_p": 400.0})


def test_held_out_worlds_are_the_secrets(suites):
    names = ["uncertain"]
    one, same, other = (suites.worlds(names, secret) for secret in (SECRET, SECRET, SECRET + "!"))
    assert [world.hash for world in one] == [world.hash for world in same]
    public = {world.hash for world in suites.worlds(names)}
    assert not {world.hash for world in one} & ({world.hash for world in other} | public)
    assert suites.worlds(["nominal"], SECRET) == []  # the paper's eight starts are what they are


def test_settings_of_an_entry_change_no_world(suites):
    world = suites.worlds(["hard"])[0]
    plain, own = world.truth("drake", {}), world.truth("drake", {"controller.k_p": 700.0, "planner.beta": 1.0})
    assert own.with_overrides({"controller.k_p": plain.controller.k_p, "planner.beta": plain.planner.beta}) == plain


def test_a_secret_must_be_one(tmp_path):
    file = tmp_path / "secret"
    file.write_text("short\n")
    with pytest.raises(InputError, match="holds 5 characters; valid is at least 16"):
        read_secret(file)
    file.write_text(f"{SECRET}\n")
    assert read_secret(file) == SECRET


# Score


def rows(modes, **more):
    base = {"kind": "public", "suite": "hard", "engine": "drake", "failure": None} | more
    return [base | {"index": k, "hash": str(k), "outcome": mode} for k, mode in enumerate(modes)]


def test_every_world_counts():
    """Three of eight, by hand: a crash, a timeout and no plan are failures; Wilson's interval of 3/8."""
    (score,) = scores(rows(["turned over"] * 3 + ["slid later", "crashed", "timeout", "no plan", "memory"]))
    assert (score["flips"], score["turned_over"]) == (8, 3)
    z, n, p = 1.959964, 8, 3 / 8
    middle, half = (p + z * z / 2 / n), z * (p * (1 - p) / n + z * z / 4 / n / n) ** 0.5
    assert score["low"] == pytest.approx((middle - half) / (1 + z * z / n), rel=1e-5)
    assert score["high"] == pytest.approx((middle + half) / (1 + z * z / n), rel=1e-5)
    assert score["landing_cost_J"] is None


def test_medians_are_over_the_flips_that_have_the_number():
    some = [
        row | {"landing_cost_J": J} for row, J in zip(rows(["turned over"] * 4), (1.0, None, 3.0, 8.0), strict=True)
    ]
    assert scores(some)[0]["landing_cost_J"] == 3.0


def test_problems_are_told_once_with_how_often_and_where_first():
    bad = rows(["turned over", "crashed", "crashed"])
    for row in bad[1:]:
        row["failure"] = "crashed: 'a.py', line 3: KeyError: 'x'"
    assert problems(bad) == ["2 of 3 flips: crashed: 'a.py', line 3: KeyError: 'x' (first in public hard 1, drake)"]


def test_pairs_are_those_of_the_same_world_and_engine():
    """Five pairs: four won by the first alone, none by the second alone: McNemar's exact p is 2 / 2^4."""
    first = rows(["turned over"] * 5)
    other = {"entry": {"name": "b"}, "flips": [*rows(["turned over"] + ["slid later"] * 4), *rows(["crashed"] * 9)[5:]]}
    (entry,) = paired_with(first, other)["suites"]
    assert (entry["trials"], entry["first_only"], entry["second_only"]) == (5, 4, 0)
    assert entry["p"] == pytest.approx(0.125) and entry["difference"] == pytest.approx(0.8)


# The command


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """An entry that raises, flown in the nominal suite."""
    folder = tmp_path_factory.mktemp("challenge")
    (folder / "mine.py").write_text(RAISING)
    words = ["challenge", str(folder / "mine.py"), "--suites", "nominal", "--engines", "mujoco", "--jobs", "1"]
    assert cli.main([*words, "--out", str(folder / "out")]) == 0
    return folder


def test_an_entry_that_raises_gets_a_score_and_a_line_that_says_where(flown, capsys):
    summary = json.loads((flown / "out" / "summary.json").read_text())
    assert summary["scores"][0]["turned_over"] == 0 and summary["scores"][0]["flips"] == 8
    assert summary["problems"] == [
        "8 of 8 flips: crashed: 'mine.py', line 2: ValueError: not ready (first in public nominal 0, mujoco)"
    ]
    assert summary["entry"]["kinds"] == ["control"] and (flown / "out" / "score.png").is_file()
    assert summary["held_out"] is None and summary["suite"]["digest"] == load_suites().digest


def test_what_was_flown_is_not_flown_again(flown, monkeypatch):
    seen = []
    monkeypatch.setattr(challenge, "fly_all", lambda orders, count, flying: seen.append(count))
    file = str(flown / "mine.py")
    challenge.run(Scenario(), flown / "out", file=file, suites=["nominal"], engines=["mujoco"], jobs=1)
    assert seen == [0]


def test_the_template_is_an_entry(capsys, tmp_path):
    assert cli.main(["challenge", "--template"]) == 0
    (tmp_path / "mine.py").write_text(capsys.readouterr().out)
    entry = load_entry(tmp_path / "mine.py")
    assert entry.kinds == ("control",) and entry.name == "computed torque"


BAD = {
    "no file": ([], "challenge needs the FILE of an entry; see flipdiagram challenge --template"),
    "absent": (["none.py"], "none.py"),
    "suite": (["mine.py", "--suites", "easy"], "--suites = 'easy'; choose from nominal, uncertain, disturbed, hard"),
    "engine": (["mine.py", "--engines", "bullet"], "--engines = 'bullet'; choose from drake, mujoco"),
    "world": (["mine.py", "--object.mass", "0.1"], "object.mass: the worlds of the challenge are frozen; valid is"),
    "against": (["mine.py", "--against", "."], "folder '.' holds no results; valid is one that holds summaries"),
    "leaderboard": (["--leaderboard", "."], "folder 'results' holds no results"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_ends_with_2_and_one_line(case, tmp_path, monkeypatch, capsys):
    words, said = BAD[case]
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(RAISING)
    assert cli.main(["challenge", *words, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1


def test_a_file_that_never_ends_is_given_up(tmp_path, monkeypatch):
    monkeypatch.setattr(challenge, "LIMITS", Limits(1.0, 2.0))
    (tmp_path / "mine.py").write_text("while True:\n    pass\n")
    with Workers(1) as workers, pytest.raises(InputError, match="cannot be loaded: took longer than 1 s"):
        challenge.described(workers, tmp_path / "mine.py")


# The leaderboard


def entered(name, drake, mujoco):
    """The result of an entry that turned over so many of ten blocks under each referee."""
    body = recorded.challenge()
    flips = []
    for engine, won in (("drake", drake), ("mujoco", mujoco)):
        flips += rows(["turned over"] * won + ["slid later"] * (10 - won), engine=engine)
    return body | {"entry": body["entry"] | {"name": name}, "flips": flips, "scores": scores(flips)}


def test_ranks_are_shared_by_equals_and_marked_where_the_referees_differ():
    entries = [entered("a", 9, 7), entered("b", 9, 8), entered("c", 2, 1)]
    assert rank(entries, "hard", "public", "drake") == {"a": 1, "b": 1, "c": 3}
    rows = [line for line in markdown(entries, {}).splitlines() if re.match(r"\| [abc] \|", line)][:3]
    assert [row.split(" | ")[0] for row in rows] == [
        "| b",
        "| a",
        "| c",
    ]  # of equals under one referee the other decides
    assert "1. ≠ 90 % (60–98) | 2. ≠ 70 % (40–89)" in rows[1] and "3. 20 %" in rows[2]


def test_who_flew_under_one_referee_alone_is_no_reason_for_a_mark_and_has_dashes():
    """`c` beats both under MuJoCo and has not flown under Drake: the ranks of the two others are compared alone."""
    alone = entered("c", 0, 10)
    alone["scores"] = [score for score in alone["scores"] if score["engine"] == "mujoco"]
    text = markdown([entered("a", 9, 8), entered("b", 8, 7), alone], {})
    rows = {line[2]: line for line in text.splitlines() if re.match(r"\| [abc] \| \d", line)}
    assert rows["a"].startswith("| a | 2. 80 % (49–94) | 1. 90 % (60–98)") and rows["c"].endswith("| – |")
    assert "medians in the public worlds of hard, mujoco" in text


def test_the_page_is_made_of_stored_results(tmp_path):
    folder = tmp_path / "entries" / "results"
    folder.mkdir(parents=True)
    for result in (entered("a", 9, 7), entered("b <i>", 1, 8)):
        head = {"schema": "flipdiagram/challenge/1", "versions": {}, "scenario": {}}
        (folder / f"{result['entry']['name'][0]}.json").write_text(json.dumps(head | result))
    out = tmp_path / "out"
    assert cli.main(["challenge", "--leaderboard", str(folder.parent), "--out", str(out), "--no-replay"]) == 0
    page = (out / "index.html").read_text(encoding="utf-8")
    assert "<table>" in page and "b &lt;i&gt;" in page and (out / "leaderboard.png").is_file()
    assert (out / "leaderboard.md").read_text(encoding="utf-8").startswith("# Leaderboard of the challenge")


def test_results_of_other_worlds_or_of_something_else_are_refused(tmp_path):
    folder = tmp_path / "results"
    folder.mkdir()
    (folder / "a.json").write_text('{"schema": "flipdiagram/campaign/1"}')
    with pytest.raises(InputError, match=re.escape("a.json' is no result of an entry")):
        load_results(folder)
    head = {"schema": "flipdiagram/challenge/1"}
    for name, digest in (("a", "1"), ("b", "2")):
        (folder / f"{name}.json").write_text(
            json.dumps(head | entered(name, 1, 1) | {"suite": {"version": "v1", "digest": digest * 64}})
        )
    assert cli.main(["challenge", "--leaderboard", str(tmp_path), "--out", str(tmp_path / "out")]) == 2


RESULTS = Path(__file__).parents[3] / "examples" / "challenge" / "results"


def test_a_stored_score_comes_out_again():
    """The paper's controller: four of its public worlds flown anew under MuJoCo end as its result tells."""
    result = json.loads((RESULTS / "pd_ff_dob.json").read_text(encoding="utf-8"))
    entry = load_entry(RESULTS.parent / "pd_ff_dob.py")
    assert result["entry"]["digest"] == entry.digest and result["suite"]["digest"] == load_suites().digest
    stored = {(row["hash"], row["engine"]): row for row in result["flips"]}
    for world in load_suites().worlds(["nominal", "uncertain"])[6:10]:
        flight = challenge.flight_of(entry, world, "mujoco")
        plan, _ = plan_entry(flight.believed, entry.path)
        outcome = fly_entry(flight, plan).outcome
        row = stored[world.hash[:16], "mujoco"]
        assert outcome.mode == row["outcome"]
        assert outcome.metrics.position_rmse_m == pytest.approx(row["position_rmse_m"], rel=0.02)


def test_every_entry_has_its_result_and_every_result_its_entry():
    """Of the files as they are: a changed entry must be flown again."""
    files = {path.stem: load_entry(path).digest for path in RESULTS.parent.glob("*.py") if enters(path)}
    stored = {summary["entry"]["file"].removesuffix(".py"): summary for summary in load_results(RESULTS)}
    assert files == {name: summary["entry"]["digest"] for name, summary in stored.items()}
    suites = load_suites()
    for summary in stored.values():
        assert summary["suite"]["digest"] == suites.digest and summary["held_out"]
        referees = {row["engine"] for row in summary["flips"]}
        assert "mujoco" in referees and len(summary["flips"]) == len(referees) * (52 + 44)


def test_the_published_leaderboard_is_that_of_the_results():
    published = json.loads((RESULTS.parents[2] / "docs" / "challenge" / "leaderboard.json").read_text(encoding="utf-8"))
    assert published["entries"] == [
        {name: summary[name] for name in ("entry", "suite", "held_out", "of", "scores")}
        for summary in load_results(RESULTS)
    ]


def enters(path):
    """Whether a file is an entry, no script beside them."""
    return "\nNAME = " in path.read_text(encoding="utf-8")
