"""Drawings against the diagrams' own connection maps: boxes, arrows, sample times; equal bytes; no Graphviz."""

import hashlib
import json
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from itertools import pairwise

import pydot
import pytest
from ideal import IDEAL
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import Adder, Gain, Integrator, LogVectorOutput, ZeroOrderHold

from flipdiagram.diagrams.loop import build_loop
from flipdiagram.diagrams.one_dof import build_controller, build_experiment, build_open
from flipdiagram.drawing import draw
from flipdiagram.errors import InputError, MissingProgramError
from flipdiagram.scenario.one_dof import OneDof
from flipdiagram.scenario.scenario import ARCHITECTURES

# pydot calls pyparsing by names that pyparsing is about to drop
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning:pydot.*")

CELL = {"robot", "scene_graph", "joint_friction", "joint_torque", "joint_state", "contact_forces"}
METERS = {"lockin_x", "lockin_a", "peak_x", "peak_a", "peak_force", "rms_error"}


@pytest.fixture(scope="module", params=ARCHITECTURES)
def loop(request):
    return build_loop(IDEAL, request.param, record=True)


@pytest.fixture(scope="module")
def experiment():
    return build_experiment(build_controller("pd+ff+dob", OneDof()), OneDof())


def users_diagram():
    """Two levels: reference -> outer.inner.gain -> outer.integrator -> y, fed back; systems without names; a sink."""
    inner = DiagramBuilder()
    gain = inner.AddNamedSystem("gain", Gain(2.0, 1))
    inner.ExportInput(gain.get_input_port(), "error")
    inner.ExportOutput(gain.get_output_port(), "command")
    outer = DiagramBuilder()
    controller = outer.AddNamedSystem("inner", inner.Build())
    integrator = outer.AddNamedSystem("integrator", Integrator(1))
    outer.Connect(controller.get_output_port(), integrator.get_input_port())
    outer.ExportInput(controller.get_input_port(), "e")
    outer.ExportOutput(integrator.get_output_port(), "y")
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem('outer "end"', outer.Build())
    error, minus, unnamed = (
        builder.AddSystem(Adder(2, 1)),
        builder.AddSystem(Gain(-1.0, 1)),
        builder.AddSystem(Gain(3.0, 1)),
    )
    held = builder.AddNamedSystem("end", ZeroOrderHold(0.01, 1))
    builder.ExportInput(error.get_input_port(0), "reference")
    builder.Connect(plant.get_output_port(), unnamed.get_input_port())
    builder.Connect(unnamed.get_output_port(), minus.get_input_port())
    builder.Connect(minus.get_output_port(), error.get_input_port(1))
    builder.Connect(error.get_output_port(), held.get_input_port())
    builder.Connect(held.get_output_port(), plant.get_input_port())
    LogVectorOutput(plant.get_output_port(), builder)
    builder.ExportOutput(plant.get_output_port(), "x & y")
    return builder.Build()


def pairs_of_map(diagram, box_of):
    """Which boxes the connections of one level join, by the function from a system's name to its box, None if hidden."""
    joined = set()
    for (into, _), (out, _) in diagram.connection_map().items():
        pair = (box_of(out.get_name()), box_of(into.get_name()))
        if None not in pair and pair[0] != pair[1]:
            joined.add(pair)
    return joined


def pairs_of_dot(text):
    """Which boxes the edges of a DOT text join, in the direction of the arrowheads."""
    (graph,) = pydot.graph_from_dot_data(text)
    found = set()
    for edge in graph.get_edges():
        ends = edge.get_source().strip('"'), edge.get_destination().strip('"')
        found.add(ends[::-1] if edge.get("dir") == "back" else ends)
    return found


def pairs_of_mermaid(text):
    names = dict(re.findall(r'^ *(b\d+)[\[({"]+(.*?)["\])}]+$', text, re.M))
    return [(names[a], names[b]) for a, b in re.findall(r"^ *(b\d+) -->(?:\|.*\|)? (b\d+)$", text, re.M)]


def hide_and_group(name):
    return None if name.startswith("log_") else "robot" if name in CELL else name


def test_the_arrows_of_an_architecture_are_its_connections(loop):
    drawing = draw(loop)
    expected = pairs_of_map(loop.diagram, hide_and_group)
    assert pairs_of_dot(drawing.dot()) == expected
    assert len(pairs_of_mermaid(drawing.mermaid())) == len(expected)


def test_each_arrow_joins_the_ports_that_the_diagram_joins(loop):
    arrows = {(arrow.source_port, arrow.target_port) for arrow in draw(loop, depth=1).graph.arrows}
    expected = set()
    for (into, i), (out, o) in loop.diagram.connection_map().items():
        if not into.get_name().startswith("log_"):
            names = (f"robot/{s.get_name()}" if s.get_name() in CELL else s.get_name() for s in (out, into))
            source, target = names
            ports = out.get_output_port(o).get_name(), into.get_input_port(i).get_name()
            expected.add((f"{source}.{ports[0]}", f"{target}.{ports[1]}"))
    assert arrows == expected


def test_absent_boxes_and_log_sinks_are_not_drawn(loop):
    parts = loop.architecture.split("+")
    for text in (draw(loop).dot(), draw(loop).mermaid()):
        assert ("feedforward" in text) == ("ff" in parts)
        assert ("disturbance_observer" in text) == ("dob" in parts)
        assert "log_" not in text
        assert "joint_friction" not in text
    assert "log_tau" in draw(loop, taps=True).dot()


def test_the_signals_have_the_papers_names():
    loop = build_loop(IDEAL)
    signals = {(line.source[-1], line.target[-1]): line.signals for line in draw(loop).lines}
    assert signals == {
        ("mpc", "pd"): ("x_cmd", "v_cmd"),
        ("mpc", "feedforward"): ("a_cmd",),
        ("pd", "a_ref_sum"): (),  # a_ref is what leaves the sum
        ("feedforward", "a_ref_sum"): ("a_ff",),
        ("a_ref_sum", "inverse_jacobian"): ("a_ref",),
        ("inverse_jacobian", "nominal_inertia"): ("qdd_ref",),
        ("nominal_inertia", "tau_sum"): ("tau_ref",),
        ("disturbance_observer", "tau_sum"): ("tau_dis",),
        ("tau_sum", "torque_limit"): ("tau_cmd",),
        ("torque_limit", "robot"): ("tau",),
        ("torque_limit", "disturbance_observer"): ("tau",),
        ("robot", "disturbance_observer"): ("qd",),
        ("robot", "inverse_jacobian"): ("q", "qd"),
        ("robot", "tool_kinematics"): ("q", "qd"),
        ("tool_kinematics", "pd"): ("x", "v"),
    }


def test_the_main_path_runs_from_left_to_right_and_feedback_back():
    lines = draw(build_loop(IDEAL)).lines
    main = ["mpc", "pd", "a_ref_sum", "inverse_jacobian", "nominal_inertia", "tau_sum", "torque_limit", "robot"]
    assert {(line.source[-1], line.target[-1]) for line in lines if line.main} == set(pairwise(main))
    back = {(line.source[-1], line.target[-1]) for line in lines if line.backward}
    assert back == {
        ("tool_kinematics", "pd"),
        ("robot", "tool_kinematics"),
        ("robot", "inverse_jacobian"),
        ("robot", "disturbance_observer"),
        ("torque_limit", "disturbance_observer"),
        ("disturbance_observer", "tau_sum"),
    }


def test_the_one_dof_loop_closed_and_open(experiment):
    closed = draw(experiment)
    expected = pairs_of_map(experiment, lambda name: None if name in METERS else name)
    assert pairs_of_dot(closed.dot()) == expected | {("plant", "a")}  # nothing else shows the output a
    opened = pairs_of_dot(draw(experiment, depth=1).dot())
    inner = experiment.GetSubsystemByName("controller")
    within = pairs_of_map(inner, lambda name: f"controller/{name}")
    assert within <= opened
    assert {pair for pair in opened if all(end.startswith("controller/") for end in pair)} == within
    assert ("command", "controller/feedforward") in opened and ("controller/force_sum", "plant") in opened
    assert METERS <= {end for pair in pairs_of_dot(draw(experiment, taps=True).dot()) for end in pair}


def test_inputs_and_outputs_of_a_diagram_are_drawn():
    drawing = draw(build_open(build_controller("pd", OneDof()), OneDof()))
    assert [box.name for box in drawing.graph.boxes if box.kind == "input"] == ["v_noise", "f_d", "x_cmd", "v_cmd"]
    assert [box.name for box in drawing.graph.boxes if box.kind == "output"] == ["x", "a", "force"]


def test_a_users_nested_diagram_opens_level_by_level():
    diagram = users_diagram()
    name = 'outer "end"'
    rest = {("reference", "Adder"), ("Gain", "Adder"), ("Gain_2", "Gain"), ("Adder", "end")}

    def pairs(depth):
        return {("/".join(line.source), "/".join(line.target)) for line in draw(diagram, depth=depth).lines}

    assert pairs(0) == rest | {("end", name), (name, "Gain_2"), (name, "x & y")}
    integrator = f"{name}/integrator"
    after = rest | {(integrator, "Gain_2"), (integrator, "x & y")}
    assert pairs(1) == after | {("end", f"{name}/inner"), (f"{name}/inner", integrator)}
    gain = f"{name}/inner/gain"
    assert pairs(2) == pairs(9) == after | {("end", gain), (gain, integrator)}


def test_an_open_diagram_keeps_its_clusters_in_dot_and_mermaid():
    drawing = draw(users_diagram(), depth=2, title='a "title"')
    (graph,) = pydot.graph_from_dot_data(drawing.dot())
    (outer,) = graph.get_subgraphs()
    assert [inner.get_name() for inner in outer.get_subgraphs()] == [r'"cluster_outer \"end\"/inner"']
    text = drawing.mermaid()
    assert text.startswith("---\ntitle: 'a \"title\"'\n---\nflowchart LR\n")
    assert text.count("subgraph") == 2 == len(re.findall(r"^ *end$", text, re.M))
    assert '["outer #quot;end#quot;"]' in text
    assert not re.search(r"@[0-9a-f]{6}", text + drawing.dot()), "Drake's addresses differ from run to run"


def test_rates_ports_and_feedthrough(loop):
    rows = {row.name: row for row in draw(loop).rates()}
    names = {s.get_name() for s in loop.diagram.GetSystems() if not s.get_name().startswith("log_")}
    assert {name.split("/")[-1] for name in rows} == names
    assert rows["robot/robot"].timing.period == 0.001
    assert (rows["mpc"].timing.kind, rows["mpc"].feedthrough) == ("events", ())
    assert rows["pd"].timing.kind == "direct"
    assert [str(port) for port in rows["pd"].inputs] == ["x_cmd (6)", "v_cmd (6)", "x (6)", "v (6)"]
    assert rows["inverse_jacobian"].feedthrough == (("a_ref", "qdd_ref"), ("q", "qdd_ref"), ("qd", "qdd_ref"))
    if "dob" in loop.architecture:
        observer = rows["disturbance_observer"]
        assert (observer.system_class, observer.timing.text) == ("DisturbanceObserver", "every 0.001 s")
        assert observer.feedthrough == (("qd", "tau_dis"),)
    unconnected = {row.name: row for row in draw(loop).rates(unconnected=True)}
    assert len(unconnected["robot/robot"].outputs) == loop.cell.plant.num_output_ports() > 5
    assert {"status", "solve_time"} <= {port.name for port in unconnected["mpc"].outputs}


def test_rates_in_markdown_and_on_the_boxes():
    drawing = draw(users_diagram(), rates=True, depth=9)
    assert [row.timing.text for row in drawing.rates()] == [
        "direct (no state)",
        "continuous",
        "direct (no state)",
        "direct (no state)",
        "direct (no state)",
        "every 0.01 s",
    ]
    lines = drawing.rates().to_markdown().splitlines()
    assert lines[-1] == "| end | ZeroOrderHold | every 0.01 s | u (1) | y (1) | none |"
    assert len({line.count("|") for line in lines}) == 1
    assert "10 ms" in drawing.dot() and "every 0.01 s" in drawing.dot() and "<br/>10 ms" in drawing.mermaid()
    assert "legend" not in draw(users_diagram()).dot()


def test_offsets_of_samples_are_told():
    loop = build_loop(IDEAL.with_overrides({"simulation.step": 0.0005}))
    hold = next(row for row in draw(loop).rates() if row.name == "hold")
    assert (hold.timing.period, hold.timing.offset, hold.timing.text) == (
        0.001,
        0.00075,
        "every 0.001 s, offset 0.00075 s",
    )


TEXTS = """
import json, sys
sys.path.insert(0, "tests")
from drawing.test_drawing import digests
print(json.dumps(digests()))
"""


def digests():
    """Hashes of all texts of some drawings."""
    drawings = [draw(build_loop(IDEAL, record=True), rates=True), draw(users_diagram(), depth=1)]
    texts = [text for d in drawings for text in (d.dot(), d.mermaid(), d.rates().to_markdown(), d._repr_svg_() or "")]
    return [hashlib.sha256(text.encode()).hexdigest() for text in texts]


def test_two_processes_write_the_same_bytes(pytestconfig):
    command = [sys.executable, "-c", TEXTS]
    other = subprocess.run(command, cwd=pytestconfig.rootpath, capture_output=True, text=True, check=True).stdout
    assert json.loads(other) == digests()


def test_without_graphviz_texts_work_and_pictures_say_how_to_install_it(monkeypatch, tmp_path, experiment):
    monkeypatch.setenv("PATH", str(tmp_path))
    drawing = draw(experiment)
    for picture in (drawing.svg, drawing.png, lambda: drawing.save(tmp_path / "a.svg")):
        with pytest.raises(MissingProgramError, match="apt-get install graphviz.*brew install graphviz") as caught:
            picture()
        assert caught.value.exit_code == 2 and "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())
    assert drawing._repr_svg_() is None
    assert drawing._repr_markdown_().startswith("```mermaid\nflowchart LR\n")
    assert drawing.save(tmp_path / "a.dot").read_text() == drawing.dot()
    assert drawing.save(tmp_path / "a.mmd").read_text() == drawing.mermaid()
    assert "| plant | OneDofPlant | every 0.0001 s |" in drawing.save(tmp_path / "a.md").read_text()


@pytest.mark.needs("dot")
def test_the_picture_shows_every_box_and_line(loop, tmp_path):
    drawing = draw(loop, title=loop.architecture)
    text = drawing.svg()
    root = ElementTree.fromstring(text)
    space = "{http://www.w3.org/2000/svg}"
    ids = {g.get("id") for g in root.iter(f"{space}g") if g.get("class") == "node"}
    assert {box.name for box in drawing.graph.boxes} <= ids
    assert sum(g.get("class") == "edge" for g in root.iter(f"{space}g")) == len(drawing.lines)
    assert loop.architecture in "".join(root.itertext())
    assert drawing._repr_svg_() == text and drawing._repr_markdown_() is None
    picture = drawing.save(tmp_path / "a.png").read_bytes()
    assert picture.startswith(b"\x89PNG")
    width, height = (int.from_bytes(picture[i : i + 4], "big") for i in (16, 20))
    assert 1000 < width <= 1600 and 2 < width / height < 8


@pytest.mark.needs("dot")
@pytest.mark.parametrize("depth", [0, 1])
def test_nothing_overlaps_in_a_picture(loop, depth):
    boxes, pieces = areas_of_svg(draw(loop, depth=depth, rates=depth == 1).svg())
    for name, box in boxes.items():
        assert not [other for other in boxes if other != name and overlap(box, boxes[other])]
        assert not [edge for edge, piece in pieces if overlap(box, piece)], f"an arrow runs over {name}"
    assert all(min(x2 - x1, y2 - y1) < 0.1 for _, (x1, y1, x2, y2) in pieces), "arrows are level or upright"
    order = [boxes[name][0] for name in ("mpc", "pd", "inverse_jacobian", "nominal_inertia", "torque_limit")]
    assert order == sorted(order)
    assert boxes["tool_kinematics"][1] > boxes["pd"][3], "feedback runs below"


def areas_of_svg(svg):
    """Areas (left, top, right, bottom) of the boxes, a little smaller than drawn, and of the pieces of the arrows."""
    space = "{http://www.w3.org/2000/svg}"
    boxes, pieces = {}, []
    for group in ElementTree.fromstring(svg).iter(f"{space}g"):
        polygon, ellipse, path = (group.find(f".//{space}{kind}") for kind in ("polygon", "ellipse", "path"))
        name = group.get("id")
        if group.get("class") == "edge":
            points = [tuple(map(float, p)) for p in re.findall(r"(-?[\d.]+),(-?[\d.]+)", path.get("d"))]
            corners = points[::3]
            pieces += [(name, (*map(min, a, b), *map(max, a, b))) for a, b in pairwise(corners)]
        elif group.get("class") == "node" and not name.startswith("node"):  # those are the legend and the branches
            if ellipse is not None:
                x, y, r = (float(ellipse.get(key)) for key in ("cx", "cy", "rx"))
                boxes[name] = (x - r + 1, y - r + 1, x + r - 1, y + r - 1)
            else:
                xs, ys = zip(*(map(float, p.split(",")) for p in polygon.get("points").split()), strict=True)
                boxes[name] = (min(xs) + 1, min(ys) + 1, max(xs) - 1, max(ys) - 1)
    return boxes, pieces


def overlap(a, b):
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


@pytest.mark.needs("dot")
@pytest.mark.parametrize("depth", [0, 2])
def test_any_diagram_becomes_a_picture(depth, experiment):
    circle = DiagramBuilder()
    integrator = circle.AddSystem(Integrator(1))
    circle.Connect(integrator.get_output_port(), integrator.get_input_port())
    strange = DiagramBuilder()
    strange.AddNamedSystem('a\\b\n<c> "d" /%', Gain(1.0, 1))
    for diagram in (users_diagram(), experiment, circle.Build(), strange.Build()):
        assert "<svg" in draw(diagram, depth=depth, rates=True, taps=True, title="<&>").svg()


@pytest.mark.needs("dot")
def test_a_large_diagram_is_left_to_graphviz():
    builder = DiagramBuilder()
    port = builder.AddSystem(Integrator(1)).get_output_port()
    for _ in range(90):
        gain = builder.AddSystem(Gain(1.0, 1))
        builder.Connect(port, gain.get_input_port())
        port = gain.get_output_port()
    assert draw(builder.Build()).svg().count('class="edge"') == 90


@pytest.mark.parametrize("depth", [-1, 1.5, True, "1", None])
def test_a_bad_depth_is_refused(depth, experiment):
    with pytest.raises(InputError, match=r"depth = .*; valid is a whole number >= 0"):
        draw(experiment, depth=depth)


def test_bad_groups_suffixes_and_objects_are_refused(experiment, tmp_path):
    with pytest.raises(InputError, match="group 'g' names system 'nobody'; choose from plant, command"):
        draw(experiment, groups={"g": ["nobody"]})
    with pytest.raises(InputError, match="system 'plant' is in groups 'a' and 'b'; one is valid"):
        draw(experiment, groups={"a": ["plant"], "b": ["plant"]})
    with pytest.raises(InputError, match="group 'noise' has the name of a system outside it"):
        draw(experiment, groups={"noise": ["plant"]})
    with pytest.raises(InputError, match=r"has the suffix '.pdf'; choose from .dot, .svg, .png, .mmd, .md"):
        draw(experiment).save(tmp_path / "a.pdf")
    with pytest.raises(InputError, match="cannot draw a Gain; valid is a Drake Diagram or a Loop"):
        draw(Gain(1.0, 1))
    assert isinstance(experiment, Diagram)


def test_groups_of_ones_own():
    drawing = draw(users_diagram(), groups={"feedback": ["Gain", "Gain_2"]})
    assert ("feedback",) in {line.source for line in drawing.lines}
    assert ("Gain",) not in {box.path for box in drawing.graph.boxes}
