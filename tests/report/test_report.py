"""The report from small summaries made by hand: every claim and number is there, and the page needs no other file."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import pytest
import recorded
from matplotlib.figure import Figure

from flipdiagram.files import write_summary
from flipdiagram.grid import Grid
from flipdiagram.report import report
from flipdiagram.report.claims import all_claims, claims_grid
from flipdiagram.report.contents import with_contents
from flipdiagram.report.findings import border_sentences, fragile_sentence, lead_sentence
from flipdiagram.report.html import self_contained
from flipdiagram.report.optional import SECTIONS, optional_sections
from flipdiagram.report.pages import EXPERIMENT_FIGURES, FREQUENCY_FIGURES, PLACE_FIGURES
from flipdiagram.report.sources import NOT_ASSUMED, model_grid, scenario_grid
from flipdiagram.scenario.scenario import ARCHITECTURES, Scenario, field_paths
from flipdiagram.studies.frequency.tables import FIGURES
from flipdiagram.studies.registry import STUDIES
from flipdiagram.studies.replanning.tables import tables as replanning_tables

MEASURED = {
    "C1": {"gain_at_lowest": 1.0, "bandwidth_rad_s": 74.75},
    "C2": {"pd_rad_s": 74.75, "pd+dob_rad_s": 87.77},
    "C14": {"largest_relative_difference": 0.0},
}
OBSERVER = {"nominal_mass_ratio": 0.5, "velocity_cutoff_rad_s": None, "reference_scaled_by_nominal_mass": False}
REALISATIONS = [{"name": "textbook", "unstable": False, "holds": {"C1": True, "C2": False}}]
FAILURES = [[None, "struck the table at 0.2 s, dropped at 0.3 s"], ["no plan: far", "diverged: not finite"]]
DELAY = {"pd": None, "pd+ff": None, "pd+dob": 0.010, "pd+ff+dob": -0.002}


def frequency():
    claims = [
        {
            "id": name,
            "claim": "",
            "holds": name != "C9",
            "measured": MEASURED.get(name, {"unstable": f"loop of {name}"}),
        }
        for name in FIGURES
    ]
    return {"claims": claims, "observer": OBSERVER, "realisations": REALISATIONS}


def experiment():
    claims = [
        {
            "id": f"E{k}",
            "text": f"claim of E{k}",
            "holds": {3: False, 6: None}.get(k, True),
            "measured": f"{k}.25 |cm|",
            "paper": "Fig. 13",
            "difference": "an estimate" if k == 7 else "",
            "numbers": {},
        }
        for k in range(1, 9)
    ]
    runs = [
        {
            "architecture": name,
            "start_y_m": 0.0,
            "success": "dob" in name,
            "failure": None,
            **{kind: 0.0123 for kind in ("position_rmse_m", "position_rmse_meas_m")},
            **{kind: 2.5 for kind in ("acceleration_rmse_m_s2", "acceleration_rmse_meas_m_s2")},
            **{kind: [1, 47.5, 1, 1, 1, 1] for kind in ("max_torque_Nm", "max_torque_cmd_Nm")},
            **{kind: 0.0037 for kind in ("velocity_delay_s", "velocity_delay_meas_s")},
            "endpoint_vibration_meas_m_s": 0.0085,
            "max_slip_m": None,
            "plan": {},
        }
        for name in ARCHITECTURES
    ]
    verdict = {"success": True, "failure": None, "max_slip_m": 0.001}
    engines = [
        {
            "architecture": name,
            "start_y_m": 0.0,
            "agree": name != "pd",
            "drake": verdict,
            "mujoco": verdict | {"success": name != "pd"},
        }
        for name in ARCHITECTURES
    ]
    return {
        "quick": True,
        "starts_y_m": [0.0],
        "architectures": list(ARCHITECTURES),
        "runs": runs,
        "claims": claims,
        "second_engine": engines,
    }


def drawn():
    cells = {
        name: {
            "success": [[True, False], [False, False]],
            "failure": FAILURES,
            "position_rmse_m": [[0.004, 0.1], [None, None]],
            "velocity_delay_s": [[DELAY[name], 0.1], [None, None]],
        }
        for name in ARCHITECTURES
    }
    axis = {"label": "load [kg]", "values": [0.0, 1.0], "overrides": [{}, {}], "logarithmic": False}
    return {
        "name": "payload",
        "title": "Unknown payload",
        "question": "How heavy?",
        "x": axis,
        "y": axis,
        "architectures": cells,
    }


def variation(name, fragile):
    numbers = {
        "position_rmse_m": 0.003,
        "acceleration_rmse_m_s2": 2.0,
        "max_slip_m": 0.001,
        "max_torque_joint_2_Nm": 50.0,
    }
    runs = {architecture: {"success": True, "failure": None, **numbers} for architecture in ARCHITECTURES}
    return {"group": "step", "name": name, "overrides": {}, "fragile": fragile, "runs": runs}


def borders():
    return {"quick": True, "maps": [drawn()], "variations": [variation("as it is", []), variation("0.5 ms", ["pd+ff"])]}


def replanning():
    lost = {"success": False, "failure": "dropped at 0.3 s"}
    kept = {"success": True, "failure": None, "landing_cost_J": 0.61, "position_rmse_m": 0.003, "max_slip_m": 0.0005}
    runs = [
        {"case": "nothing", "way": "planned once", "architecture": n} | (kept if "dob" in n else lost)
        for n in ARCHITECTURES
    ]
    return {"runs": runs, "worlds": worlds()}


def worlds():
    """Ten random worlds in two ways under one controller; 7 are turned over when planned again, 3 when planned once."""
    entry = {"architecture": "pd+ff+dob"}
    once = entry | {"way": "planned once", "turned_over": 3, "rate": 0.3, "low": 0.108, "high": 0.603}
    again = entry | {"way": "every 1 ms", "turned_over": 7, "rate": 0.7, "low": 0.397, "high": 0.892}
    again["against_first"] = {
        "success": {"trials": 10, "first_only": 4, "second_only": 0, "difference": 0.4, "p": 0.125},
        "landing_cost_J": {"pairs": 3, "median_difference": -0.2, "p": 0.04},
        "position_rmse_m": {"pairs": 3, "median_difference": -0.001, "p": 0.5},
    }
    return {"count": 10, "vary": [], "entries": [once, again]}


def place():
    run = {
        "architecture": "pd+dob",
        "success": True,
        "failure": None,
        "distance_m": 0.004,
        "tilt_rad": 0.0,
        "touchdown_speed_m_s": 0.18,
        "slid_m": 0.0189,
        "planned_slide_m": 0.018,
        "strike_time_s": None,
        "strike_duration_s": 0.0,
        "strike_force_N": 0.0,
        "position_rmse_m": 0.0029,
    }
    return {"plan": {"tilt_rad": 1.11, "friction_angle_rad": 1.08}, "target_y_m": 0.1, "runs": [run]}


@pytest.fixture
def written(tmp_path, monkeypatch):
    """write(quick): the report of these summaries, its studies replaced by their files."""
    figure = Figure(figsize=(0.2, 0.2))

    def made_up(name, body, pictures):
        def run(scenario, out, *, progress, **asked):
            assert asked.keys() <= {"quick", "jobs"}
            progress("running")
            write_summary(out / "summary.json", name, scenario, body())

        def draw(summary, out, **asked):
            for picture, _ in pictures:
                figure.savefig(out / f"{picture}.png")

        return replace(STUDIES[name], run=run, figures=draw)

    parts = {
        "frequency": (frequency, FREQUENCY_FIGURES),
        "experiment": (experiment, EXPERIMENT_FIGURES),
        "borders": (borders, [("map_payload", "")]),
        "replanning": (replanning, []),
        "place": (place, PLACE_FIGURES),
    }
    monkeypatch.setattr(report, "STUDIES", {name: made_up(name, *part) for name, part in parts.items()})

    def write(quick=False):
        said = []
        report.run(Scenario(), tmp_path, quick=quick, progress=said.append)
        assert said == [f"{words}: running" for words in report.PARTS.values()] + ["writing the pages"]
        summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
        return SimpleNamespace(summary=summary, markdown=tmp_path / "report.md", html=tmp_path / "report.html")

    return write


def test_every_claim_is_on_the_page_with_its_verdict_and_numbers(written):
    made = written()
    text = made.markdown.read_text()
    table = [
        [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        for line in text.splitlines()
        if re.match(r"\| [CE]\d+ \|", line)
    ]
    assert [row[0] for row in table] == [f"C{k}" for k in range(1, 15)] + [f"E{k}" for k in range(1, 9)]
    verdicts = {row[0]: row[3] for row in table}
    assert {name for name, holds in verdicts.items() if holds == "**no**"} == {"C9", "E3"}
    assert {name for name, holds in verdicts.items() if holds == "not judged"} == {"E6"}
    entries = {entry["id"]: entry for entry in made.summary["claims"]}
    for row in table:
        entry = entries[row[0]]
        assert (
            row[2] == entry["claim"]
            and row[4].replace("\\|", "|").startswith(entry["measured"])
            and row[5] == entry["paper"]
        )
        assert row[6] == f"`flipdiagram {'frequency' if row[0][0] == 'C' else 'experiment'}`"
    assert "87.77" in entries["C2"]["measured"]
    assert "(an estimate)" in table[-2][4]
    assert "19 of 22 claims hold in this physics; C9, E3 do not; E6 could not be judged." in text


def test_the_numbers_of_the_tables_are_the_summarys(written):
    text = written().markdown.read_text()
    assert "| position RMSE [cm] | 1.23 ± 0, last 1.23 |" in text
    assert "| joint 2, max [N m] | 47.5 ± 0, last 47.5 |" in text
    assert "| slip, largest [mm] | – |" in text  # null in the summary
    assert "| Unknown payload | load [kg] × load [kg] | 4 | 1 | 1 | 1 | 1 |" in text
    assert "r = 0.5, exact velocity, reference force with the true mass" in text
    assert "| textbook | 1 | C2 |" in text


def test_the_summary_keeps_its_contract(written):
    summary = written().summary
    assert list(summary)[:3] == ["schema", "versions", "scenario"] and summary["schema"] == "flipdiagram/report/1"
    assert len(summary["claims"]) == 22
    assert summary["borders"]["maps"][0]["name"] == "payload" and summary["observer"] == OBSERVER


def test_the_html_needs_no_other_file_and_no_network(written):
    made = written()
    html = made.html.read_text()
    sources = re.findall(r'\bsrc="([^"]*)"', html)
    assert len(sources) == len(FREQUENCY_FIGURES) + len(EXPERIMENT_FIGURES) + len(PLACE_FIGURES) + 1
    assert all(source.startswith("data:image/png;base64,iVBOR") for source in sources)
    assert not re.findall(r'\bhref="(?!#)', html)
    assert not re.findall(r"<(?:script|link|iframe|object|embed)\b|url\(|@import", html)
    assert html.count("<td>C1</td>") == 1 and html.count("<td>E8</td>") == 1
    assert html.startswith("<!DOCTYPE html>") and "<title>Reproduction report" in html


def test_the_contents_lead_to_every_section(tmp_path):
    page = with_contents("# A report\n\nOf today.\n\n## Is it physics, or E1–E8?\n\ntext\n\n## To reproduce\n")
    links = re.findall(r"^\* \[(.+)\]\(#(.+)\)$", page, re.MULTILINE)
    assert links == [("Is it physics, or E1–E8?", "is-it-physics-or-e1e8"), ("To reproduce", "to-reproduce")]
    assert page.index("Of today.") < page.index("* [Is it") < page.index("## Is it")
    html = self_contained(page, tmp_path)
    assert re.findall(r'<h2 id="(.+?)">', html) == [target for _, target in links]
    assert re.findall(r'href="#(.+?)"', html) == [target.replace("–", "%E2%80%93") for _, target in links]


def test_a_text_of_a_user_is_no_markup(tmp_path):
    html = self_contained("# a <b> & c\n\n<script>alert(1)</script>\n", tmp_path)
    assert "<script>" not in html and "<title>a &lt;b&gt; &amp; c</title>" in html


def test_replanning_and_laying_down_have_their_tables(written):
    text = written().markdown.read_text(encoding="utf-8")
    assert "| nothing | planned once | dropped at 0.3 s | dropped at 0.3 s | **0.61**, 0.30 cm, 0.5 mm |" in text
    assert "| `pd+dob` | laid down | 0.4 | 0.000 | 0.18 | 18.9 | 18.0 | never | 0.29 |" in text


def test_random_worlds_are_compared_with_the_plan_made_once():
    *_, grid = replanning_tables(replanning())
    again, once = grid.rows
    assert again == [
        "`pd+ff+dob`",
        "every 1 ms",
        "70.0 %",
        "39.7–89.2 %",
        "4 : 0",
        "0.12",
        "-0.200",
        "-0.10",
        "0.04, 0.5",
    ]
    assert once == ["`pd+ff+dob`", "planned once", "30.0 %", "10.8–60.3 %", *"–––––"]


def test_a_quick_report_says_so(written):
    quick = written(quick=True)
    assert "A quick report" in quick.markdown.read_text() and "A quick report" in quick.html.read_text()
    assert quick.summary["quick"] is True and "`flipdiagram report --quick`" in quick.markdown.read_text()
    assert "quick" not in written().markdown.read_text()


def test_claims_keep_their_order_and_their_commands():
    found = all_claims(frequency(), experiment())
    assert len(found) == 22 and len({entry["id"] for entry in found}) == 22
    assert {entry["command"] for entry in found} == {"flipdiagram frequency", "flipdiagram experiment"}
    assert len(claims_grid({"claims": found}).rows[0]) == 6


def test_where_an_architecture_works_is_counted():
    text = border_sentences(drawn())
    assert text.count("works in 1 of 4 cells; failures: struck the table 1, ") == 4
    everywhere = drawn()
    everywhere["architectures"]["pd"] |= {"success": [[True] * 2] * 2, "failure": [[None] * 2] * 2}
    everywhere["architectures"]["pd+ff"]["success"] = [[False] * 2] * 2
    text = border_sentences(everywhere)
    assert "works everywhere\n" in text and "works nowhere; failures" in text


def test_leads_are_counted_where_both_turn_the_block_over():
    assert lead_sentence(borders()).endswith("appears in 1 of 1 cells of 'Unknown payload'.")
    lag = borders()
    lag["maps"][0]["architectures"]["pd+ff+dob"]["velocity_delay_s"] = [[0.001, -0.1], [None, None]]
    assert "appears in no cell" in lead_sentence(lag)


def test_fragile_verdicts_are_named():
    text = fragile_sentence(borders(), experiment())
    assert text.startswith("Of 1 variations of contact model, solver, step and inertias, 1 change a verdict")
    assert "* step '0.5 ms': the verdict of PD + FF differs" in text
    assert "3 of 4 verdicts are the same" in text


def test_every_field_that_a_run_assumes_has_an_origin():
    grid = scenario_grid(Scenario())
    paths = [row[0].strip("`") for row in grid.rows]
    assert paths == [path for path in field_paths() if not path.startswith(NOT_ASSUMED)]
    for row in grid.rows:
        assert row[3] and row[4], row
        assert not re.search(r"\([pHMLo]\)|\[", row[3]), row  # the mark has become the origin
    origins = dict(zip(paths, (row[4] for row in grid.rows), strict=True))
    assert origins["object.mass"] == "the paper" and origins["arm.torque_scale"] == "neutral: changes nothing"
    values = dict(zip(paths, (row[1] for row in grid.rows), strict=True))
    assert values["object.friction"] == "1.86"


def test_a_number_of_the_users_own_is_not_ascribed_to_the_paper():
    rows = {row[0]: row for row in scenario_grid(Scenario().with_overrides({"object.mass": 0.5})).rows}
    assert rows["`object.mass`"][1] == "0.5"
    assert rows["`object.mass`"][4] == "set for this run; the default, 0.061, is of: the paper"
    assert rows["`object.friction`"][4] == "the paper"


def test_the_models_numbers_are_listed_with_their_confidence():
    grid = model_grid()
    assert isinstance(grid, Grid) and len(grid.rows) > 5
    assert {row[0] for row in grid.rows} >= {"`urdf/mh3f.urdf`"}
    assert all(re.search(r"\[[HML]", row[1]) for row in grid.rows)


def test_studies_that_take_hours_are_shown_where_they_lie_and_nowhere_else(tmp_path):
    assert optional_sections(tmp_path) == ""
    for name in SECTIONS:
        (tmp_path / name).mkdir()
        recorded.write(STUDIES[name], tmp_path / name)
    text = optional_sections(tmp_path)
    for name, section in SECTIONS.items():
        assert f"## {section.heading}" in text and section.text in text
        for picture, caption in section.pictures:
            shown = f"![{caption}]({name}/{picture}.png)" in text
            assert shown == (tmp_path / name / f"{picture}.png").is_file()
    assert "| `pd` | 4 | 3 | 2 | 3 | 75.0 % |" in text  # the verdicts of two engines
    assert "![The paper's numbers, and those of the worlds before and after](calibrate/predictions.png)" in text
