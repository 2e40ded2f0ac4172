"""The figure of a pancake's deformation: what is drawn, where it is marked, and who is refused."""

import numpy as np
import pytest
import synthetic
from bending import DEPTH, PANCAKE, recording
from matplotlib.colors import to_hex

import flipdiagram.results  # noqa: F401  # registers the accessor
from flipdiagram.errors import InputError
from flipdiagram.figures.deformation import INSTANTS, plot_deformation
from flipdiagram.figures.style import MARK, STYLES
from flipdiagram.simulation.events import touchdown

ALLOWED = {to_hex(STYLES["pd+ff+dob"].color).upper(), to_hex(MARK["color"]).upper()}


@pytest.fixture(scope="module")
def panels():
    return plot_deformation({"pd+ff+dob": recording()})


def test_signals_over_time_have_units_and_colours_of_the_other_figures(panels):
    data = recording()
    energy, blade, table, overhang = (panel.lines[0] for panel in panels[:4])
    inside = (data["frame_time"].values >= -0.05) & (data["frame_time"].values <= energy.get_xdata()[-1])
    np.testing.assert_allclose(energy.get_ydata(), 1e3 * data["deformation_energy"].values[inside])
    np.testing.assert_allclose(overhang.get_ydata(), 100 * data["overhang"].values[inside])
    area = 1e4 * np.pi * PANCAKE.object.length**2 / 4
    assert blade.get_ydata().max() == table.get_ydata().max() == pytest.approx(area)
    units = [panel.get_ylabel().split("[")[1] for panel in panels]
    assert units == ["mJ]", "cm²]", "cm²]", "%]", "m]", "mm]"]
    assert {to_hex(line.get_color()).upper() for panel in panels[:4] for line in panel.lines} <= ALLOWED


def test_release_and_touch_down_are_marked(panels):
    for panel in panels[:4]:
        marks = [(line.get_marker(), *line.get_xdata()) for line in panel.lines if len(line.get_xdata()) == 1]
        assert marks == [("o", pytest.approx(synthetic.RELEASE, abs=2e-3)), ("v", touchdown(recording()).time_s)]
    (legend,) = panels[0].figure.legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert texts == ["PD + FF + DOB", "release", "pancake dropped", "touch-down"]


def test_the_section_is_drawn_from_release_to_landing(panels):
    outline, deflection = panels[4:]
    assert len(outline.patches) == INSTANTS and outline.get_aspect() == 1.0
    lines = deflection.lines[:INSTANTS]
    for line in lines:
        assert len(line.get_xdata()) == 2 * PANCAKE.object.refinement + 1
        assert np.ptp(line.get_xdata()) == pytest.approx(1e3 * PANCAKE.object.length, rel=0.03)
    deepest = max(np.ptp(line.get_ydata()) for line in lines)
    assert 0.5e3 * DEPTH < deepest < 1.1e3 * DEPTH
    colours = np.array([line.get_color() for line in lines])
    assert (np.diff(colours.sum(axis=1)) > 0).all()  # from dark to pale


def test_a_recording_draws_it_and_a_rigid_block_is_refused():
    assert len(recording().flip.deformation()) == 6
    with pytest.raises(InputError, match="rigid"):
        synthetic.recording().flip.deformation()
    with pytest.raises(InputError, match="2 axes given; valid are 6"):
        recording().flip.deformation(plot_deformation({"mine": recording()})[:2])
