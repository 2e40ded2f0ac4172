"""One default plan, shared by all tests of planning."""

import pytest
from ideal import IDEAL

from flipdiagram.planning import Plan, Planner
from flipdiagram.robot.arm import ArmModel
from flipdiagram.robot.parts import arm_of
from flipdiagram.scenario.scenario import Scenario


@pytest.fixture(scope="session")
def scenario() -> Scenario:
    return IDEAL


@pytest.fixture(scope="session")
def arm(scenario: Scenario) -> ArmModel:
    return arm_of(scenario)


@pytest.fixture(scope="session")
def planner(scenario: Scenario) -> Planner:
    return Planner(scenario)


@pytest.fixture(scope="session")
def plan(planner: Planner) -> Plan:
    return planner.plan()
