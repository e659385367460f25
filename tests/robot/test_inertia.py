"""Mass matrices and gravity, against Pinocchio."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import holokin as hk
from conftest import sampled, urdf
from holokin.base.errors import MassError
from holokin.robot import mass_matrix_expression, potential_expression
from holokin.symbolic import Function, symbol

ARMS = [
    ("panda.urdf", "panda_hand_tcp"),
    ("xarm7.urdf", None),
    ("talos_left_arm.urdf", None),
    ("tiago.urdf", "wrist_ft_tool_link"),
    ("baxter.urdf", "left_gripper"),
]


def reduced(path, robot: hk.Robot) -> pin.Model:
    """Pinocchio's model with every other joint held at zero."""
    model = pin.buildModelFromUrdf(str(path))
    others = [i for i, name in enumerate(model.names) if name != "universe" and name not in robot.joint_names]
    return pin.buildReducedModel(model, others, pin.neutral(model))


@sampled(2, ("name", "tip"), ARMS)
def test_the_mass_matrix_and_the_potential_are_pinocchios(name: str, tip: str | None) -> None:
    path = urdf(name)
    chains = hk.robot.model_tips(path)
    tip = tip or max(chains, key=lambda link: len(chains[link]))
    robot = hk.from_urdf(path, tip=tip)
    model = reduced(path, robot)
    data = model.createData()
    s = symbol("q", robot.n)
    mass_matrix = Function("M", {"q": s}, {"M": mass_matrix_expression(robot, s)})
    potential = Function("U", {"q": s}, {"U": potential_expression(robot, s, np.array([0, 0, -9.81]))})
    offsets = []
    for seed in range(3):
        q = np.random.default_rng(seed).uniform(-1, 1, robot.n)
        posture, order = pin.neutral(model), []
        for i, joint in enumerate(robot.joint_names):
            theirs = model.joints[model.getJointId(joint)]
            posture[theirs.idx_q : theirs.idx_q + theirs.nq] = (
                [q[i]] if theirs.nq == 1 else [np.cos(q[i]), np.sin(q[i])]
            )
            order.append(theirs.idx_v)
        M = pin.crba(model, data, posture)
        M = np.triu(M) + np.triu(M, 1).T
        assert np.abs(mass_matrix(q) - M[np.ix_(order, order)]).max() < 1e-12 * np.abs(M).max()
        offsets.append(potential(q) - pin.computePotentialEnergy(model, data, posture))
    assert np.ptp(offsets) < 1e-10  # the base's own weight is a constant


def test_a_table_of_lengths_has_no_masses(irb140: hk.Robot) -> None:
    with pytest.raises(MassError, match="has no masses"):
        mass_matrix_expression(irb140, symbol("q", 6))
