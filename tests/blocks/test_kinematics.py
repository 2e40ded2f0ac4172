"""InverseJacobian and ToolKinematics, with planar arms whose kinematics are written out here."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff

from flipdiagram.blocks.inverse_jacobian import InverseJacobian, eliminated, joint_acceleration
from flipdiagram.blocks.tool_kinematics import ToolKinematics
from flipdiagram.errors import InputError, SimulationError

# NumPy reports the floating-point flags that Drake's scalars leave behind.
pytestmark = pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")

LENGTHS = np.array([0.4, 0.3, 0.2, 0.1])


class PlanarArm:
    """n revolute joints in a plane; the task is the tip's (y, z) and, for three joints, its angle."""

    def __init__(self, joints: int, coordinates: int, dtype: type = float) -> None:
        self.lengths, self.coordinates, self.dtype, self.calls = LENGTHS[:joints], coordinates, dtype, 0

    def to_scalar(self, T: type) -> "PlanarArm":
        if T is not AutoDiffXd:
            raise TypeError(f"no arm over {T.__name__}")
        return PlanarArm(self.lengths.size, self.coordinates, object)

    def task_kinematics(self, q: Any, qd: Any) -> Any:
        angle, rate, n = np.cumsum(q), np.cumsum(qd), self.lengths.size
        y, z = self.lengths * np.cos(angle), self.lengths * np.sin(angle)
        x = np.array([y.sum(), z.sum(), angle[-1]])
        jacobian = np.array([[-z[i:].sum() for i in range(n)], [y[i:].sum() for i in range(n)], [1.0] * n])
        bias = np.array([-(y * rate**2).sum(), -(z * rate**2).sum(), 0.0 * rate[-1]])
        m = self.coordinates
        return x[:m], jacobian.dot(qd)[:m], jacobian[:m].astype(self.dtype), bias[:m]

    def task_position_velocity(self, q: Any, qd: Any) -> Any:
        self.calls += 1
        return self.task_kinematics(q, qd)[:2]


Q, QD, A_REF = np.array([0.3, 0.8, -0.5]), np.array([0.4, -1.0, 2.0]), np.array([1.0, -2.0, 3.0])


def tip_acceleration(arm: PlanarArm, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, h: float = 1e-5) -> Any:
    """Second time derivative of the task coordinates, by differences of positions only."""
    x = [arm.task_kinematics(q + s * qd + 0.5 * s**2 * qdd, qd)[0] for s in (-h, 0.0, h)]
    return (x[2] - 2.0 * x[1] + x[0]) / h**2


@pytest.mark.parametrize(("joints", "coordinates"), [(3, 3), (3, 2), (4, 3)])
def test_joint_accelerations_make_the_tip_accelerate_as_asked(context_of: Any, joints: int, coordinates: int) -> None:
    arm = PlanarArm(joints, coordinates)
    q, qd, a_ref = np.append(Q, 0.7)[:joints], np.append(QD, -0.3)[:joints], A_REF[:coordinates]
    block = InverseJacobian(arm, joints, coordinates)
    qdd = block.GetOutputPort("qdd_ref").Eval(context_of(block, a_ref=a_ref, q=q, qd=qd))
    assert qdd.shape == (joints,)
    assert tip_acceleration(arm, q, qd, qdd) == pytest.approx(a_ref, abs=1e-4)


@given(jacobian=arrays(float, (2, 4), elements=st.floats(-1, 1)), a=arrays(float, 2, elements=st.floats(-5, 5)))
def test_redundant_arms_get_the_least_norm_solution(jacobian: np.ndarray, a: np.ndarray) -> None:
    jacobian = jacobian + np.eye(2, 4) * 4.0  # well conditioned
    expected, *_ = np.linalg.lstsq(jacobian, a, rcond=None)
    assert joint_acceleration(jacobian, np.zeros(2), a) == pytest.approx(expected, abs=1e-9)


def test_a_singular_arm_says_so(context_of: Any) -> None:
    with pytest.raises(SimulationError, match="rank 1, valid is 2"):
        joint_acceleration(np.ones((2, 2)), np.zeros(2), np.ones(2))
    arm = PlanarArm(3, 3)
    block = InverseJacobian(arm, 3, 3)
    context = context_of(block, a_ref=A_REF, q=np.zeros(3), qd=np.zeros(3))  # stretched along y
    with pytest.raises(SimulationError, match="singularity"):
        block.GetOutputPort("qdd_ref").Eval(context)


def test_too_few_joints_are_refused() -> None:
    with pytest.raises(InputError, match="num_joints = 3"):
        InverseJacobian(PlanarArm(3, 3), num_joints=3)


def test_feedthrough(feedthrough_of: Any) -> None:
    inverse = InverseJacobian(PlanarArm(3, 3), 3, 3)
    assert feedthrough_of(inverse) == {(name, "qdd_ref") for name in ("a_ref", "q", "qd")}
    forward = ToolKinematics(PlanarArm(3, 3), 3, 3)
    assert feedthrough_of(forward) == {(i, o) for i in ("q", "qd") for o in ("x", "v")}


def test_tool_kinematics_by_hand(context_of: Any) -> None:
    # arm straight up, turning at 1 rad/s about its base: tip at z = 0.9, moving at -0.9 in y
    arm = PlanarArm(3, 3)
    block = ToolKinematics(arm, 3, 3)
    context = context_of(block, q=[np.pi / 2, 0.0, 0.0], qd=[1.0, 0.0, 0.0])
    assert block.GetOutputPort("x").Eval(context) == pytest.approx([0.0, 0.9, np.pi / 2])
    assert block.GetOutputPort("v").Eval(context) == pytest.approx([-0.9, 0.0, 1.0])
    assert arm.calls == 1  # both outputs share one evaluation
    block.GetInputPort("q").FixValue(context, np.zeros(3))
    assert block.GetOutputPort("x").Eval(context) == pytest.approx([0.9, 0.0, 0.0])
    other = context_of(block, q=Q, qd=QD)
    block.GetOutputPort("x").Eval(other)
    assert block.GetOutputPort("v").Eval(context) == pytest.approx([0.0, 0.9, 1.0])


@pytest.mark.parametrize("joints", [3, 4])
def test_autodiff_gradients_match_differences(context_of: Any, joints: int) -> None:
    arm = PlanarArm(joints, 3)
    q, qd = np.append(Q, 0.7)[:joints], np.append(QD, -0.3)[:joints]
    blocks = [(InverseJacobian(arm, joints, 3), "qdd_ref"), (ToolKinematics(arm, joints, 3), "v")]
    for block, port in blocks:
        inputs = {"q": q, "qd": qd} | ({"a_ref": A_REF} if port == "qdd_ref" else {})

        def value(position: np.ndarray, block: Any = block, port: str = port, inputs: Any = inputs) -> np.ndarray:
            return block.GetOutputPort(port).Eval(context_of(block, **(inputs | {"q": position})))

        converted = block.ToAutoDiffXd()
        dual_inputs = inputs | {"q": InitializeAutoDiff(q).ravel()}
        dual = converted.GetOutputPort(port).Eval(context_of(converted, **dual_inputs))
        assert ExtractValue(dual).ravel() == pytest.approx(value(q))
        columns = [(value(q + h) - value(q - h)) / 2e-6 for h in 1e-6 * np.eye(joints)]
        assert ExtractGradient(dual) == pytest.approx(np.array(columns).T, rel=1e-6, abs=1e-6)


def test_an_arm_without_symbolic_form_says_so() -> None:
    with pytest.raises(TypeError, match="no arm over Expression"):
        InverseJacobian(PlanarArm(3, 3), 3, 3).ToSymbolic()


def test_elimination_solves_as_lapack_does() -> None:
    rng = np.random.default_rng(5)
    for _ in range(50):
        A, b = rng.normal(size=(6, 6)), rng.normal(size=6)
        A[0, 0] = 0.0  # no pivot
        assert eliminated(A, b) == pytest.approx(np.linalg.solve(A, b), rel=1e-13 * np.linalg.cond(A), abs=1e-12)
    with pytest.raises(np.linalg.LinAlgError):
        eliminated(np.array([[1.0, 2.0], [2.0, 4.0]]), np.ones(2))
