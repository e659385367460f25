"""PyRoki, as Almond publishes it: least squares over the joints, in JAX on the processor."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import jax
import jax.numpy as jnp
import jax_dataclasses as jdc
import jaxlie
import jaxls
import numpy as np
import pyroki as pk
import yourdfpy
from worker_loop import Arm, Setting, Step, serve

EXAMPLE = "examples/01_basic_ik.py of pyroki, June 2025"


@jdc.jit
def basic(robot: pk.Robot, link: jax.Array, wxyz: jax.Array, position: jax.Array) -> jax.Array:
    """The problem of its basic example: the pose and the joint limits, from its own first guess."""
    joints = robot.joint_var_cls(0)
    wanted = jaxlie.SE3.from_rotation_and_translation(jaxlie.SO3(wxyz), position)
    costs = [
        pk.costs.pose_cost_analytic_jac(robot, joints, wanted, link, pos_weight=50.0, ori_weight=10.0),
        pk.costs.limit_cost(robot, joints, weight=100.0),
    ]
    problem = jaxls.LeastSquaresProblem(costs, [joints]).analyze()
    solved = problem.solve(
        verbose=False, linear_solver="dense_cholesky", trust_region=jaxls.TrustRegionConfig(lambda_initial=1.0)
    )
    return solved[joints]


@jdc.jit
def resting(
    robot: pk.Robot, link: jax.Array, wxyz: jax.Array, position: jax.Array, rest: jax.Array, guess: jax.Array,
    weight: jax.Array,
) -> jax.Array:  # fmt: skip
    """The same with a cost of the distance to a posture, from a guess."""
    joints = robot.joint_var_cls(0)
    wanted = jaxlie.SE3.from_rotation_and_translation(jaxlie.SO3(wxyz), position)
    costs = [
        pk.costs.pose_cost_analytic_jac(robot, joints, wanted, link, pos_weight=50.0, ori_weight=10.0),
        pk.costs.limit_cost(robot, joints, weight=100.0),
        pk.costs.rest_cost(joints, rest, weight),
    ]
    problem = jaxls.LeastSquaresProblem(costs, [joints]).analyze()
    end = jaxls.TerminationConfig(cost_tolerance=1e-9, gradient_tolerance=1e-7, parameter_tolerance=1e-8)
    solved = problem.solve(
        initial_vals=jaxls.VarValues.make([joints.with_value(guess)]), verbose=False,
        linear_solver="dense_cholesky", trust_region=jaxls.TrustRegionConfig(lambda_initial=1e-6), termination=end,
    )  # fmt: skip
    return solved[joints]


def begin(robot: pk.Robot, weight: float | None = None, one_seed: bool = False) -> Callable[[Arm], Step]:
    """A run of its basic example, or with a posture of this weight from the last answer or from the start."""

    def start(arm: Arm) -> Step:
        link = jnp.array(robot.links.names.index(arm.frame), jnp.int32)

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray:
            turned = jnp.array(jaxlie.SO3.from_matrix(pose[:3, :3]).wxyz)
            if weight is None:
                return np.array(basic(robot, link, turned, jnp.array(pose[:3, 3])))
            guess = arm.start if one_seed else q
            more = jnp.array(arm.start), jnp.array(guess), jnp.array(weight)
            return np.array(resting(robot, link, turned, jnp.array(pose[:3, 3]), *more))

        return step

    return start


def settings(arm: Arm) -> Iterator[Setting]:
    """As its basic example, and with a cost of posture. All in 32 bits: its solver does not run in 64."""
    robot = pk.Robot.from_urdf(yourdfpy.URDF.load(arm.urdf, load_meshes=False))  # one: what is compiled is kept for it
    yield Setting("pose and limits, its own guess", begin(robot), True, EXAMPLE)
    yield Setting("posture 0.01, last answer", begin(robot, 1e-2))
    yield Setting("posture 0.1, last answer", begin(robot, 1e-1))
    yield Setting("posture 0.01, one seed", begin(robot, 1e-2, one_seed=True))


if __name__ == "__main__":
    serve(settings, ("almond-pyroki", "almond-jaxls", "jax"))
