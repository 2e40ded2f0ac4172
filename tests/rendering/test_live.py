"""The live view: a browser that connects sees the flip while it is simulated."""

import numpy as np
import pytest
from bending import PANCAKE
from ideal import IDEAL
from pydrake.geometry import Meshcat

from flipdiagram.diagrams.loop import build_loop
from flipdiagram.errors import SimulationError
from flipdiagram.rendering import live
from flipdiagram.rendering.scene import TOP_COLOUR

SHORT = IDEAL.with_overrides({"simulation.hold_time": 0.05, "simulation.settle_time": 0.0})


def test_the_simulation_waits_for_a_browser_and_moves_what_it_sees(monkeypatch):
    servers, polls = [], []

    class Watched(Meshcat):
        def __init__(self, parameters):
            super().__init__(parameters)
            servers.append(self)

        def GetNumActiveConnections(self):
            polls.append(1)
            return int(len(polls) > 2)

    monkeypatch.setattr(live, "Meshcat", Watched)
    monkeypatch.setattr(live, "SPEED", 50.0)
    told = []
    live.show_live(SHORT, ["pd+ff+dob"], announce=told.append)
    assert len(polls) > 2, "it waited"
    assert "watch at http://localhost" in told[0]
    assert told[1].startswith("pd+ff+dob: ") and len(told) == 2, "and it ends by itself"
    assert servers[0].HasPath("visualizer/block"), "the block is in the viewer"


def test_a_pancake_is_shown_as_it_lies_on_the_blade_by_meshes_of_our_own():
    meshcat, sent = Meshcat(), {}

    class Viewer:
        def SetTriangleMesh(self, path, vertices, faces, rgba):
            sent[path] = vertices.T.copy(), faces.T.copy(), rgba.rgba

    loop = build_loop(PANCAKE, "pd", meshcat=meshcat)
    show, context = live._bending(loop, Viewer()), loop.context()
    show(context)
    assert list(sent) == ["/pancake/upper", "/pancake/lower", "/pancake/rim"]
    vertices, upper, colour = sent["/pancake/upper"]
    np.testing.assert_allclose(colour, TOP_COLOUR)
    at_rest = loop.cell.robot.deformable_model().GetPositions(
        loop.cell.robot.GetMyContextFromRoot(context), loop.cell.pancake
    )
    assert vertices[:, 2].max() == pytest.approx(at_rest[2].max())
    above = vertices[np.unique(upper), 2].mean() - vertices[np.unique(sent["/pancake/lower"][1]), 2].mean()
    assert above == pytest.approx(PANCAKE.object.thickness, rel=0.1)
    inspector = loop.cell.scene_graph.model_inspector()
    deformable = [g for g in inspector.GetAllGeometryIds() if inspector.IsDeformableGeometry(g)]
    assert deformable and all(inspector.GetIllustrationProperties(g) is None for g in deformable), "not shown twice"
    loop.diagram.ForcedPublish(context)
    assert not meshcat.HasPath("visualizer/pancake")


def test_without_a_browser_it_says_so_and_ends(monkeypatch, capsys):
    monkeypatch.setattr(live, "PATIENCE", 0.05)
    monkeypatch.setattr(live, "plan_motion", lambda scenario: None)
    monkeypatch.setattr(live, "simulate_loop", None)  # nothing is simulated
    live.show_live(SHORT, ["pd+ff+dob"])
    out, err = capsys.readouterr()
    assert out == "" and "no browser came within 0.05 s; going on without" in err


def test_a_taken_port_is_said(monkeypatch):
    first = Meshcat()
    port = int(first.web_url().rsplit(":", 1)[1])
    with pytest.raises(SimulationError, match=f"cannot listen on port {port}"):
        live.show_live(SHORT, ["pd"], port=port)
