"""The live view: a browser that connects sees the flip while it is simulated."""

import pytest
from ideal import IDEAL
from pydrake.geometry import Meshcat

from flipdiagram.errors import SimulationError
from flipdiagram.rendering import live

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
