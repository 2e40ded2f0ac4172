"""Model files with faults drawn at random: each is read, or refused in one line, and soon."""

import pytest
from hostile.models import FAULTS, MODELS, TEXTS, spoiled
from hostile.table import patience
from hypothesis import given, settings
from hypothesis import strategies as st
from ideal import IDEAL
from patience import loaded
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from flipdiagram.errors import InputError, PlanningError
from flipdiagram.robot.parts import add_parts, arm_of

SECONDS = 10
"""For one file on a free machine."""
DRAWN = st.tuples(st.sampled_from(FAULTS), st.integers(0, 10**6), st.integers(0, 10**6), st.sampled_from(TEXTS))


def read(folder, name, text, field, fields):
    """Make controller's arm and cell of a file with this text."""
    (folder / name).write_text(text, encoding="utf-8")
    scenario = IDEAL.with_overrides(fields | {field: str(folder / name)})
    arm = arm_of(scenario)
    arm.task_jacobian(arm.home)
    arm.mass_matrix(arm.home)
    plant, _ = AddMultibodyPlantSceneGraph(DiagramBuilder(), 0.001)
    add_parts(plant, scenario)
    plant.Finalize()


@pytest.mark.parametrize("model", MODELS)
def test_a_model_with_faults_is_read_or_refused(model, tmp_path_factory):
    folder = tmp_path_factory.mktemp("models")
    name, text, field, fields = MODELS[model]

    @settings(max_examples=17, deadline=None)
    @given(st.lists(DRAWN, min_size=1, max_size=3))
    def check(faults):
        with patience(loaded(SECONDS)):
            try:
                read(folder, name, spoiled(text, faults), field, fields)
            except (InputError, PlanningError) as error:
                assert "\n" not in str(error)

    check()
