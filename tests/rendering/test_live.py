"""The live view: a browser that connects sees the flip while it is simulated."""

import pytest
from ideal import IDEAL
from pydrake.geometry import Meshcat

from flipdiagram.errors import SimulationError
from flipdiagram.rendering import live

SHORT = IDEAL.with_overrides({"simulation.hold_time": 0.05, "simulation.settle_time": 0.0})


def test_the_simulation_waits_for_a_browser_and_moves_what_it_sees(monkeypatch):
    seen, servers, polls = [], [], []

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
    live.show_live(
        SHORT, ["pd+ff+dob"], announce=told.append, wait=lambda: seen.append(servers[0].HasPath("visualizer/block"))
    )
    assert len(polls) > 2, "it waited"
    assert "watch at http://localhost" in told[0]
    assert told[1].startswith("pd+ff+dob: ") and "Ctrl-C" in told[2]
    assert seen == [True], "the block is in the viewer, and the server lives until `wait` returns"


def test_a_taken_port_is_said(monkeypatch):
    first = Meshcat()
    port = int(first.web_url().rsplit(":", 1)[1])
    with pytest.raises(SimulationError, match=f"cannot listen on port {port}"):
        live.show_live(SHORT, ["pd"], port=port)
