"""roboticstoolbox: resolved-rate motion by its servo and Jacobian, and its inverse kinematics, in a loop."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import roboticstoolbox as rtb
from worker_loop import Arm, Setting, Step, serve


def robot_of(arm: Arm) -> rtb.ETS:
    """The chain of the URDF."""
    return rtb.Robot.URDF(arm.urdf).ets(end=arm.frame)


def servo(gain: float, centred: float = 0.0) -> Callable[[Arm], Step]:
    """A run by `p_servo` and pinv, with a pull to the start in the null space."""

    def start(arm: Arm) -> Step:
        chain = robot_of(arm)

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray:
            v, _ = rtb.p_servo(chain.fkine(q), pose, gain=gain, threshold=0.0)
            J = chain.jacobe(q)
            inverse = np.linalg.pinv(J)
            pull = centred * (arm.start - q)
            return q + h * (inverse @ (v - J @ pull) + pull)

        return step

    return start


def solved(one_seed: bool, **options: float) -> Callable[[Arm], Step]:
    """A run by `ik_LM` from the last answer, or from the start each time."""

    def start(arm: Arm) -> Step:
        chain = robot_of(arm)

        def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray, h: float) -> np.ndarray | None:
            found = chain.ik_LM(pose, q0=arm.start if one_seed else q, **options)
            return found.q if found.success else None

        return step

    return start


def settings(arm: Arm) -> Iterator[Setting]:
    """As its README's example of resolved-rate motion, and its solver."""
    whole = 1.0 / float(arm.runs["circle"]["h"][0])
    yield Setting("resolved rate, gain 1", servo(1.0), True, "README.md of 1.5, the loop of p_servo and pinv")
    yield Setting("resolved rate, gain 1/dt", servo(whole))
    for centred in (1.0, 10.0, whole):
        yield Setting(f"resolved rate, gain 1/dt, pull {centred:.3g}/s", servo(whole, centred))
    yield Setting("ik_LM, last answer", solved(False), source="ik_LM, its defaults")
    yield Setting("ik_LM to 1e-12, last answer", solved(False, tol=1e-12))
    yield Setting("ik_LM to 1e-12, one seed", solved(True, tol=1e-12))


if __name__ == "__main__":
    serve(settings, ("roboticstoolbox-python",))
