"""Our rerun of a published method, global redundancy resolution, for planar arms; it is not the authors' code.

Hauser and Emmons (2018, and Hauser 2016) give each node of a grid of tool positions many sampled postures. Two
postures of neighbouring nodes are joined when the straight line between them, moved onto the straight line of the
tool, makes no large step. One posture a node is then chosen so that the most pairs stay joined: first the nodes with
the fewest postures left that fit all neighbours, then by turns each node in conflict takes the posture with the fewest
conflicts. Here that is done in short form: postures are sampled at all nodes at once and then from their neighbours',
and each posture is tried with the nearest few of a neighbour's. Their code is public under GPL-3.0.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .grid_resolution import Free, Limits, forward

NEAREST = 5
"""Postures of the neighbour that each posture is tried with."""
PARTS = 8
"""Parts of the straight line between two postures."""
GUESSES, ROUNDS = 4, 30
"""Random choices that the descent begins with, beside the heuristic one; its rounds."""


@dataclass(frozen=True, eq=False)
class Roadmap:
    """One posture for each node of a grid, and which pairs it joins."""

    points: np.ndarray
    """(k, 2) [m]"""
    q: np.ndarray
    """(k, n) [rad], NaN where no posture was found"""
    pairs: np.ndarray
    """(e, 2) neighbours, both with a posture"""
    joined: np.ndarray
    """(e,)"""
    step: float
    seconds: float


def moved_to(links: Sequence[float], limits: Limits, q: np.ndarray, points: np.ndarray, rounds: int) -> np.ndarray:
    """Postures (..., n) near q with the tool at points (..., 2), by Newton steps of least norm within the limits."""
    low, high = np.transpose(limits)
    for _ in range(rounds):
        turned = np.cumsum(q, -1)
        bars = np.stack([-np.sin(turned) * links, np.cos(turned) * links], -2)
        J = np.flip(np.cumsum(np.flip(bars, -1), -1), -1)
        a, b, c = (J[..., 0, :] ** 2).sum(-1), (J[..., 0, :] * J[..., 1, :]).sum(-1), (J[..., 1, :] ** 2).sum(-1)
        off = points - forward(links, q)
        scale = np.maximum(a * c - b * b, 1e-9)
        u, v = (c * off[..., 0] - b * off[..., 1]) / scale, (a * off[..., 1] - b * off[..., 0]) / scale
        q = np.clip(q + np.clip(J[..., 0, :] * u[..., None] + J[..., 1, :] * v[..., None], -0.5, 0.5), low, high)
    return q


def _samples(
    links: Sequence[float], limits: Limits, points: np.ndarray, beside: np.ndarray, count: int,
    rng: np.random.Generator, free: Free | None,
) -> np.ndarray:  # fmt: skip
    """(k, count, n) postures, NaN where the search failed: half from random ones, half from those of the neighbours."""
    low, high = np.transpose(limits)
    goal = points[:, None]
    q = moved_to(links, limits, rng.uniform(low, high, (len(points), count, len(links))), goal, 25)
    half, k = count // 2, np.arange(len(points))[:, None]
    other = beside[k, rng.integers(0, 4, (len(points), half))]
    other = np.where(other >= 0, other, k)
    q[:, half : 2 * half] = moved_to(links, limits, q[other, rng.integers(0, half, other.shape)], goal, 15)
    q[np.abs(forward(links, q) - goal).max(-1) > 1e-6] = np.nan
    if free is not None:
        known = np.isfinite(q[..., 0])
        q[known] = np.where(free(q[known])[:, None], q[known], np.nan)
    return q


def _joined(
    links: Sequence[float], limits: Limits, ends: np.ndarray, points: np.ndarray, free: Free | None
) -> np.ndarray:
    """(c,) whether straight lines between postures (2, c, n), moved onto those of points (2, c, 2), stay whole."""
    share = np.arange(1, PARTS)[:, None, None] / PARTS
    line = (1 - share) * ends[0] + share * ends[1]
    goal = (1 - share) * points[0] + share * points[1]
    on = moved_to(links, limits, line, goal, 3)
    exact = np.abs(forward(links, on) - goal).max((0, 2)) < 1e-3
    if free is not None:
        exact &= free(on.reshape(-1, on.shape[-1])).reshape(on.shape[:2]).all(0)
    steps = np.diff(np.concatenate([ends[:1], on, ends[1:]]), axis=0)
    far = np.linalg.norm(ends[1] - ends[0], axis=-1)
    return exact & (np.linalg.norm(steps, axis=-1).max(0) <= len(links) * far / PARTS + 1e-3)


def _network(
    links: Sequence[float], limits: Limits, points: np.ndarray, pairs: np.ndarray, q: np.ndarray, free: Free | None
) -> np.ndarray:
    """(e, count, count) which posture of the first node is joined with which of the second."""
    network = np.zeros((len(pairs), q.shape[1], q.shape[1]), bool)
    for part in np.array_split(np.arange(len(pairs)), 1 + len(pairs) // 256):
        i, j = pairs[part].T
        far = np.sqrt(sum((q[i][:, :, None, k] - q[j][:, None, :, k]) ** 2 for k in range(q.shape[2])))
        far[~np.isfinite(far)] = np.inf
        near = np.argpartition(far, NEAREST, axis=2)[:, :, :NEAREST]
        e, a, _ = (places.ravel() for places in np.indices(near.shape))
        b = near.ravel()
        there = np.isfinite(far[e, a, b])
        e, a, b = e[there], a[there], b[there]
        ends, places = np.stack([q[i[e], a], q[j[e], b]]), np.stack([points[i[e]], points[j[e]]])
        whole = _joined(links, limits, ends, places, free)
        network[part[e[whole]], a[whole], b[whole]] = True
    return network


class _Choice:
    """One posture a node so that the most pairs are joined."""

    def __init__(self, network: np.ndarray, pairs: np.ndarray, known: np.ndarray) -> None:
        self.known, self.count = known, known.shape[1]
        self.pairs, self.network = pairs, network
        self.around: list[list[tuple[int, np.ndarray]]] = [[] for _ in known]
        for e, (i, j) in enumerate(pairs):
            self.around[i].append((int(j), network[e].T))
            self.around[j].append((int(i), network[e]))

    def votes(self, node: int, chosen: np.ndarray) -> np.ndarray:
        """(count,) with how many of its neighbours each posture of a node is joined."""
        found = np.zeros(self.count)
        for other, joins in self.around[node]:
            if chosen[other] >= 0:
                found += joins[chosen[other]]
        return np.where(self.known[node], found, -1)

    def heuristic(self) -> np.ndarray:
        """By turns the node with the fewest postures left that fit; of these, the one that leaves others most."""
        chosen = np.full(len(self.known), -1)
        left = self.known.sum(1).astype(float)
        left[left == 0] = np.inf
        offers = [sum((joins.sum(0) for _, joins in near), np.zeros(self.count)) for near in self.around]
        while np.isfinite(left).any():
            node = int(left.argmin())
            left[node] = np.inf
            chosen[node] = int((self.votes(node, chosen) + 1e-4 * offers[node]).argmax())
            for other, _ in self.around[node]:
                if np.isfinite(left[other]):
                    votes = self.votes(other, chosen)
                    left[other] = (votes == votes.max()).sum() - 0.01 * votes.max()
        return chosen

    def joined(self, chosen: np.ndarray) -> np.ndarray:
        """(e,) which pairs are joined."""
        i, j = self.pairs.T
        return self.network[np.arange(len(self.pairs)), chosen[i], chosen[j]]

    def descended(self, chosen: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Nodes in conflict take by turns a posture with the fewest conflicts, until nothing gets better."""
        chosen, best = chosen.copy(), -1
        for _ in range(ROUNDS):
            joined = self.joined(chosen)
            if joined.sum() <= best:
                break
            best = int(joined.sum())
            for node in rng.permutation(np.unique(self.pairs[~joined])):
                votes = self.votes(node, chosen)
                chosen[node] = rng.choice(np.flatnonzero(votes == votes.max()))
        return chosen


def grid_roadmap(
    links: Sequence[float], limits: Limits, cells: int = 50, count: int = 50, seed: int = 0, free: Free | None = None
) -> Roadmap:
    """A resolution of the disc of reach of a planar arm by the published method.

    Args:
        links: lengths of the links [m].
        limits: (lower, upper) of each joint [rad].
        cells: nodes along a side of the square round the disc.
        count: postures sampled at each node.
        seed: of the random numbers.
        free: postures (k, n) -> (k,) True where an obstacle leaves them.
    """
    began, rng = time.process_time(), np.random.default_rng(seed)
    reach = float(sum(links))
    step = 2 * reach / cells
    axis = -reach + step * (np.arange(cells) + 0.5)
    points = np.stack(np.meshgrid(axis, axis, indexing="ij"), -1).reshape(-1, 2)
    points = points[np.hypot(*points.T) <= reach]
    number = {tuple(place): k for k, place in enumerate(np.rint(points / step - 0.5).astype(int).tolist())}
    beside = np.array(
        [[number.get((i + a, j + b), -1) for a, b in ((-1, 0), (1, 0), (0, -1), (0, 1))] for i, j in number]
    )
    q = _samples(links, limits, points, beside, count, rng, free)
    known: np.ndarray = np.isfinite(q[..., 0])
    some: np.ndarray = np.asarray(known.any(axis=1))
    first = np.repeat(np.arange(len(points)), 4)
    pairs = np.stack([first, beside.ravel()], 1)
    pairs = pairs[(pairs[:, 0] < pairs[:, 1]) & some[pairs].all(1)]
    choice = _Choice(_network(links, limits, points, pairs, q, free), pairs, known)
    begin = [choice.heuristic()]
    begin += [np.array([rng.choice(np.flatnonzero(row)) if row.any() else -1 for row in known]) for _ in range(GUESSES)]
    answers = [choice.descended(one, rng) for one in begin]
    best = max(answers, key=lambda one: int(choice.joined(one).sum()))
    found = np.where(some[:, None], q[np.arange(len(q)), best], np.nan)
    return Roadmap(points, found, pairs, choice.joined(best), step, time.process_time() - began)
