"""Openings of contact edges: against elements and a descent written here, closed forms, symmetries."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.problem import Status
from tcstudy.contact.solve import solve_contact
from tcstudy.fem.meshes import Meshes, PlaneMesh
from tcstudy.offline.level import Level
from tcstudy.read.study import read_study_text
from tcstudy.scene.records import Scene

Array = NDArray[np.float64]


def level_of(text: str, *overrides: str) -> tuple[Level, Scene]:
    """The first level of a study, and its first scene."""
    study = read_study_text(text, "study", list(overrides))
    return Level(Meshes(study).next(0), study.scenes[0]), study.scenes[0]


def solution(text: str, *overrides: str) -> tuple[Level, Scene, Array]:
    """A level, its scene, and the accepted solution with the lowest energy found."""
    level, scene = level_of(text, *overrides)
    answer = solve_contact(level.condensed(scene).problem, branch="lowest")
    assert answer.status == Status.CONVERGED, answer.reason
    return level, scene, answer.v


# -- a second program: elements by hand, then every unknown in its turn


class Graph(NamedTuple):
    """A law by the vertices of its graph and the slopes at both ends; s below the domain is −∞."""

    s: tuple[float, ...]
    b: tuple[float, ...]
    left: float
    right: float

    def side(self, s: float, side: int) -> float:
        """The limit of b from the left (−1) or the right (1)."""
        k = np.searchsorted(self.s, s, side="left" if side < 0 else "right")
        if k == 0:
            return -np.inf if self.left == np.inf else self.b[0] + self.left * (s - self.s[0])
        if k == len(self.s):
            return self.b[-1] + self.right * (s - self.s[-1])
        share = (s - self.s[k - 1]) / (self.s[k] - self.s[k - 1])
        return self.b[k - 1] + share * (self.b[k] - self.b[k - 1])


def tresca(tau: float) -> Graph:
    return Graph((0.0, 0.0), (-tau, tau), 0.0, 0.0)


def bilinear(tau: float, s0: float, sf: float) -> Graph:
    return Graph((-sf, -s0, s0, sf), (0.0, -tau, tau, 0.0), 0.0, 0.0)


def adhesive(sigma: float, s0: float, sf: float, closing: float) -> Graph:
    return Graph((0.0, s0, sf), (0.0, sigma, 0.0), closing, 0.0)


NO_FRICTION = Graph((0.0,), (0.0,), 0.0, 0.0)
UNILATERAL = Graph((0.0,), (0.0,), np.inf, 0.0)


@dataclass
class Assembly:
    """Linear elements on the triangles of a mesh, with conditions by direction at nodes."""

    mesh: PlaneMesh
    lam: float
    mu: float
    held: dict[int, list[Array]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = self.mesh.n_points
        self.K = np.zeros((n, 2, n, 2))
        self.F = np.zeros((n, 2))
        D = np.array(
            [
                [self.lam + 2 * self.mu, self.lam, 0],
                [self.lam, self.lam + 2 * self.mu, 0],
                [0, 0, self.mu],
            ]
        )
        for corners in self.mesh.triangles:
            gradients, area = self.gradients(corners)
            B = np.zeros((3, 3, 2))
            B[0, :, 0], B[1, :, 1] = gradients.T
            B[2] = gradients[:, ::-1]
            B = B.reshape(3, 6)
            nodes = np.ix_(corners, (0, 1), corners, (0, 1))
            self.K[nodes] += area * (B.T @ D @ B).reshape(3, 2, 3, 2)

    def gradients(self, corners: NDArray[np.intp]) -> tuple[Array, float]:
        """Gradients of the three hat functions, and the area."""
        values = np.column_stack([np.ones(3), self.mesh.points[corners]])
        return np.linalg.inv(values)[1:].T, 0.5 * abs(np.linalg.det(values))

    def weigh(self, f: Array, beta: float, theta: float) -> None:
        """Add ∫f·v + β∫θ div v of constants."""
        for corners in self.mesh.triangles:
            gradients, area = self.gradients(corners)
            self.F[corners] += area * (f / 3.0 + beta * theta * gradients)

    def pull(self, name: str, traction: Array) -> None:
        """Add ∫g·v of a constant traction on an edge."""
        for a, b in self.mesh.segments[self.mesh.on(name)]:
            length = np.linalg.norm(self.mesh.points[b] - self.mesh.points[a])
            self.F[[a, b]] += 0.5 * length * traction

    def hold(self, name: str, *directions: Array) -> None:
        """Hold u·d = 0 at the nodes of an edge."""
        for node in np.unique(self.mesh.segments[self.mesh.on(name)]):
            self.held.setdefault(int(node), []).extend(directions)

    def free(self, node: int, direction: Array) -> bool:
        """Whether nothing holds a direction that is along or across what is held there."""
        return all(abs(d @ direction) < 0.5 for d in self.held.get(node, []))

    def condensed(self, unknowns: list[tuple[int, Array]]) -> tuple[Array, Array]:
        """Ã and l̃ on unknowns u·d at nodes, all that is free besides eliminated."""
        n = self.mesh.n_points
        columns = []
        for node in range(n):
            kept = [d for i, d in unknowns if i == node]
            for d in (np.array([1.0, 0.0]), np.array([0.0, 1.0])):
                # what neither is held nor among the unknowns of the node
                for e in [*self.held.get(node, []), *kept]:
                    d = d - (d @ e) * e
                for c in columns:
                    if c[0] == node:
                        d = d - (d @ c[1]) * c[1]
                if np.linalg.norm(d) > 1e-6:
                    columns.append((node, d / np.linalg.norm(d)))
        R = np.zeros((n, 2, len(columns) + len(unknowns)))
        for k, (node, d) in enumerate([*columns, *unknowns]):
            R[node, :, k] = d
        R = R.reshape(2 * n, -1)
        A = R.T @ self.K.reshape(2 * n, 2 * n) @ R
        F = R.T @ self.F.ravel()
        i = len(columns)
        solved = np.linalg.solve(A[:i, :i], np.column_stack([A[:i, i:], F[:i]]))
        reduced = A[i:, :i] @ solved
        return A[i:, i:] - reduced[:, :-1], F[i:] - reduced[:, -1]


Terms = list[tuple[float, Graph]]
"""Lengths and laws of an unknown."""


def settled(A: Array, load: Array, terms: list[Terms]) -> Array:
    """The solution of 0 ∈ Av − load + Σ c b̂(v): every unknown in turn, then exactly on its piece."""
    v = np.zeros(len(load))
    for _ in range(400):
        for _ in range(20):
            for i, term in enumerate(terms):
                v[i] = least(A[i, i], load[i] - A[i] @ v + A[i, i] * v[i], term)
        exact = on_pieces(A, load, v, terms)
        if exact is not None:
            return exact
    raise AssertionError("not settled")


def least(a: float, force: float, terms: Terms) -> float:
    """The s with force − a s ∈ Σ c b̂(s)."""
    kinks = sorted({s for _, law in terms for s in law.s})
    for k, s in enumerate(kinks):
        low, high = (sum(c * law.side(s, side) for c, law in terms) for side in (-1, 1))
        if force - a * s < low:  # left of this kink
            anchor = kinks[k - 1] if k else s
            side = 1 if k else -1
            slope = sum(c * slope_at(law, anchor, side) for c, law in terms)
            at = sum(c * law.side(anchor, side) for c, law in terms)
            return anchor + (force - a * anchor - at) / (a + slope)
        if force - a * s <= high:
            return s
    slope = sum(c * law.right for c, law in terms)
    at = sum(c * law.side(kinks[-1], 1) for c, law in terms)
    return kinks[-1] + (force - a * kinks[-1] - at) / (a + slope)


def slope_at(law: Graph, s: float, side: int) -> float:
    """The slope of b beside s."""
    k = int(np.searchsorted(law.s, s, side="left" if side < 0 else "right"))
    if k == 0:
        return law.left
    if k == len(law.s):
        return law.right
    return (law.b[k] - law.b[k - 1]) / (law.s[k] - law.s[k - 1])


def on_pieces(A: Array, load: Array, v: Array, terms: list[Terms]) -> Array | None:
    """The solution on the pieces of v; None if these are not its own."""
    on_kink = np.array(
        [any(s in law.s for _, law in term) for s, term in zip(v, terms, strict=True)]
    )
    free = np.flatnonzero(~on_kink)
    slope = np.array(
        [sum(c * slope_at(law, s, 1) for c, law in t) for s, t in zip(v, terms, strict=True)]
    )
    value = np.array(
        [sum(c * law.side(s, 1) for c, law in t) for s, t in zip(v, terms, strict=True)]
    )
    right = (load - A @ v - value)[free]
    exact = v.copy()
    exact[free] += np.linalg.solve(A[np.ix_(free, free)] + np.diag(slope[free]), right)
    force = load - A @ exact
    scale = 1e-12 * np.max(np.abs(load) + np.abs(A) @ np.abs(exact))
    for s, f, term in zip(exact, force, terms, strict=True):
        low, high = (sum(c * law.side(s, side) for c, law in term) for side in (-1, 1))
        if not low - scale <= f <= high + scale:
            return None
    return exact


KINDS = ("held", "free", "unilateral", "adhesive", "compliant")


@dataclass
class Sketch:
    """A random block on two films, turned by an angle; the same for a study and for `Assembly`."""

    seed: int

    def __post_init__(self) -> None:
        self.rng = rng = np.random.default_rng(self.seed)
        angle = rng.uniform(0.0, 2.0 * np.pi)
        self.t = np.array([np.cos(angle), np.sin(angle)])
        self.n = np.array([self.t[1], -self.t[0]])
        self.kinds = [str(kind) for kind in rng.choice(KINDS, 3)]
        if self.kinds[0] == self.kinds[1] == "held":
            self.kinds[1] = "unilateral"
        self.left = str(rng.choice(["symmetry", "clamped", "free", *3 * ["contact"]]))
        self.right = (
            "clamped" if self.left != "clamped" else str(rng.choice(["clamped", "traction"]))
        )
        self.E, self.nu, self.alpha = rng.uniform(0.5, 2.0), rng.uniform(0.0, 0.4), 0.05
        self.f, self.g, self.p = (rng.normal(0.0, scale, 2) for scale in (0.05, 0.1, 0.1))
        self.theta = float(rng.normal())
        self.tau = rng.uniform(0.01, 0.05, 3)
        self.sigma = rng.uniform(0.01, 0.1, 3)
        self.s0, self.sf = rng.uniform(0.01, 0.05, 3), rng.uniform(0.8, 1.5, 3)
        self.closing = rng.uniform(0.5, 5.0, 3)
        self.tresca = rng.integers(0, 2, 3).astype(bool)

    @property
    def films(self) -> tuple[str, ...]:
        """The contact edges; `left` meets `film` at right angles."""
        return ("film", "shoe", "left") if self.left == "contact" else ("film", "shoe")

    def frame(self, name: str) -> tuple[Array, Array]:
        """The tangent and the normal of a film."""
        return (self.n, -self.t) if name == "left" else (self.t, self.n)

    @property
    def study(self) -> str:
        cut, width, tilt, height = self.rng.uniform([0.4, 1.2, -0.3, 0.5], [0.8, 1.6, 0.3, 1.0])
        flat = [(0, 0), (cut, 0), (width, 0), (width + tilt, height), (0, height)]
        corners = [x * self.t - y * self.n for x, y in flat]
        names = ("film", "shoe", "right", "top", "left")
        outline = ", ".join(
            f"{{from: [{x!r}, {y!r}], edge: {name}}}"
            for (x, y), name in zip(np.array(corners).tolist(), names, strict=True)
        )
        g, p, f = (np.array(load).tolist() for load in (self.g, self.p, self.f))
        normals = {k: k if k in ("held", "free", "unilateral") else "" for k in KINDS}
        films, friction, adhesion = [], [], []
        for k, name in enumerate(self.films):
            kind = normals[self.kinds[k]]
            films.append(f"{name}: {{role: contact{', normal: ' + kind if kind else ''}}}")
            law = f"law: bilinear, tau: {self.tau[k]}, s0: {self.s0[k]}, sf: {self.sf[k]}"
            if self.tresca[k]:
                law = f"law: tresca, tau: {self.tau[k]}"
            if kind != "unilateral":  # where friction knows the pressure
                friction.append(f"{name}: {{{law}}}")
            if not kind:
                closing = "" if self.kinds[k] == "adhesive" else f", closing: {self.closing[k]}"
                law = f"sigma: {self.sigma[k]}, s0: {self.s0[k]}, sf: {self.sf[k]}{closing}"
                adhesion.append(f"{name}: {{law: bilinear, {law}}}")
        right = f"{{role: traction, g: {p}}}" if self.right == "traction" else self.right
        left = "" if self.left == "contact" else f", left: {self.left}"
        shear = f"friction: {{{', '.join(friction)}}}" if friction else ""
        section = f"adhesion: {{{', '.join(adhesion)}}}" if adhesion else ""
        return f"""
units: none
body: {{outline: [{outline}]}}
boundary: {{{", ".join(films)}, right: {right}, top: {{role: traction, g: {g}}}{left}}}
material: {{E: {self.E}, nu: {self.nu}, plane: stress, alpha_T: {self.alpha}}}
heat: {{theta: {self.theta}}}
loads: {{f: {f}}}
{shear}
{section}
mesh: {{maxh: 0.25, levels: 1}}
"""

    def laws(self, k: int) -> tuple[Graph, Graph | None]:
        """The laws of a film in both directions."""
        tau, sigma, s0, sf = self.tau[k], self.sigma[k], self.s0[k], self.sf[k]
        friction = tresca(tau) if self.tresca[k] else bilinear(tau, s0, sf)
        if self.kinds[k] == "unilateral":
            friction = NO_FRICTION
        adhesion = {
            "unilateral": UNILATERAL,
            "adhesive": adhesive(sigma, s0, sf, np.inf),
            "compliant": adhesive(sigma, s0, sf, self.closing[k]),
        }
        return friction, adhesion.get(self.kinds[k])

    def solved(self, mesh: PlaneMesh) -> dict[tuple[int, str], float]:
        """The slips and openings by node."""
        E, nu = self.E, self.nu
        body = Assembly(mesh, E * nu / (1 - nu**2), E / 2 / (1 + nu))
        body.weigh(self.f, E * self.alpha / (1 - nu), self.theta)
        body.pull("top", self.g)
        if self.right == "traction":
            body.pull("right", self.p)
        supports = {"clamped": (self.t, self.n), "symmetry": (self.t,)}
        body.hold("right", *supports.get(self.right, ()))
        body.hold("left", *supports.get(self.left, ()))
        for k, name in enumerate(self.films):
            if self.kinds[k] == "held":
                body.hold(name, self.frame(name)[1])
        corner = None
        if self.left == "contact":
            ends = [np.unique(mesh.segments[mesh.on(name)]) for name in ("film", "left")]
            (corner,) = np.intersect1d(*ends).tolist()
        terms: dict[tuple[int, str], Terms] = {}
        directions: dict[tuple[int, str], Array] = {}
        for k, name in enumerate(self.films):
            t, n = self.frame(name)
            for ends in mesh.segments[mesh.on(name)].tolist():
                length = float(np.linalg.norm(np.diff(mesh.points[ends], axis=0)))
                for law, way, d in zip(self.laws(k), "TN", (t, -n), strict=True):
                    # a corner has no slip, and the openings of both edges
                    free = [i for i in ends if body.free(i, d) and (way == "N" or i != corner)]
                    for node in free if law is not None else ():
                        key = node, "M" if (node, way, name) == (corner, "N", "left") else way
                        terms.setdefault(key, []).append((length / len(free), law))
                        directions[key] = d
        A, load = body.condensed([(i, directions[i, way]) for i, way in terms])
        return dict(zip(terms, settled(A, load, list(terms.values())), strict=True))


def test_random_blocks_are_those_of_elements_by_hand() -> None:
    """100 scenes with one solution: films of all kinds, joints, corners, guides, heat, any angle."""
    compared = 0
    seed = 0
    opened = closed = in_corners = 0
    while compared < 100:
        seed += 1
        sketch = Sketch(seed)
        level, scene = level_of(sketch.study)
        problem = level.condensed(scene).problem
        if problem.law.omega > 0.8 * level.lambda_1(scene):
            continue
        answer = solve_contact(problem, branch="lowest")
        assert answer.status == Status.CONVERGED, (seed, answer.reason)
        by_hand = sketch.solved(level.mesh)
        _, s_N = level.split(answer.v)
        keys = [(int(node), "T") for node in level.line.nodes]
        if level.opening is not None:
            names = np.array(level.opening.edge_names)[level.opening.edge]
            is_shared = np.isin(level.opening.nodes, level.mesh.nodes_on("film"))
            ways = np.where((names == "left") & is_shared, "M", "N").tolist()
            keys += zip(level.opening.nodes.tolist(), ways, strict=True)
            in_corners += len(level.frames.corners) > 0
            opened += np.count_nonzero(s_N > 1e-3)
            closed += np.count_nonzero(s_N == 0.0)
        assert set(keys) == set(by_hand), seed
        expected = np.array([by_hand[key] for key in keys])
        scale = np.max(np.abs(expected))
        np.testing.assert_allclose(answer.v, expected, rtol=0, atol=1e-8 * scale, err_msg=str(seed))
        compared += 1
    assert min(opened, closed) > 100
    assert in_corners > 10
