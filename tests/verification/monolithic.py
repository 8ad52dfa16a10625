"""The whole body in one sparse system, by scipy alone: nothing of the package's forms, frames,
factors or solvers.

P1 from barycentric gradients, loads by Gauss's rule, held components as equations on nodes,
friction at the nodes by Newton's method on the pieces that a solution names. Scenes are mappings of
SI numbers (texts vary in x and y) as `test_rich_scenes` draws them: a polygon with straight edges,
a circular hole, a region, laws that are odd.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

Array = NDArray[np.float64]
Data = dict[str, Any]
GAUSS = np.polynomial.legendre.leggauss(4)


def at(data: Any, x: Array) -> Array:
    """A number, or a text in x and y, at points (n, 2)."""
    if not isinstance(data, str):
        return np.full(len(x), float(data))
    names = {"x": x[:, 0], "y": x[:, 1], "max": np.maximum, "min": np.minimum}
    return np.broadcast_to(eval(data, {"__builtins__": {}}, names), len(x))


def plane(material: Data, stress: bool) -> tuple[float, float, float]:
    """λ and μ of the plane problem, β."""
    E, nu, alpha_T = material["E"], material["nu"], material["alpha_T"]
    mu = E / (2 * (1 + nu))
    if stress:
        return E * nu / (1 - nu**2), mu, E * alpha_T / (1 - nu)
    return E * nu / ((1 + nu) * (1 - 2 * nu)), mu, E * alpha_T / (1 - 2 * nu)


def friction(law: Data, s: Array) -> tuple[Array, Array]:
    """b and b′ for slips s > 0."""
    if law["law"] == "tresca":
        return np.full(len(s), law["tau"]), np.zeros(len(s))
    if law["law"] == "exponential":
        fall = (law["a"] - law["b"]) * np.exp(-s / law["delta"])
        return law["b"] + fall, -fall / law["delta"]
    slope = np.where(s < law["delta"], (law["tau_k"] - law["tau_s"]) / law["delta"], 0.0)
    return np.where(s < law["delta"], law["tau_s"] + slope * s, law["tau_k"]), slope


@dataclass
class Whole:
    """A scene on a mesh: points (n, 2), triangles (t, 3), those in the region (t,); unknowns are x,
    y of every node."""

    scene: Data
    points: Array
    triangles: NDArray[np.intp]
    inside: NDArray[np.bool_]
    theta: Array = field(init=False)
    A: sp.csr_array = field(init=False)
    F: Array = field(init=False)
    held: NDArray[np.intp] = field(init=False)

    def __post_init__(self) -> None:
        corners = self.points[self.triangles]
        sides = np.roll(corners, 1, axis=1) - np.roll(corners, -1, axis=1)
        self.area = 0.5 * (sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0])
        assert np.all(self.area > 0)
        self.slopes = np.stack([-sides[..., 1], sides[..., 0]], axis=2) / (
            2 * self.area[:, None, None]
        )
        every = np.concatenate([self.triangles[:, [i, (i + 1) % 3]] for i in range(3)])
        count = sp.csr_array((np.ones(len(every)), every.T), shape=(len(self.points),) * 2)
        self.sides = every[np.asarray(count[every[:, 1], every[:, 0]]).ravel() == 0]
        a, b = self.points[self.sides[:, 0]], self.points[self.sides[:, 1]]
        self.length = np.hypot(*(b - a).T)
        self.t = (b - a) / self.length[:, None]
        self.n = np.column_stack([self.t[:, 1], -self.t[:, 0]])
        P = np.array(self.scene["corners"])
        along, middle = np.roll(P, -1, axis=0) - P, 0.5 * (a + b)
        lines = np.stack(
            [
                np.abs((middle - p) @ [-d[1], d[0]]) / np.hypot(*d)
                for p, d in zip(P, along, strict=True)
            ]
        )
        names = np.array([f"e{i}" for i in range(len(P))])[lines.argmin(axis=0)]
        self.edge = np.where(lines.min(axis=0) < 1e-9 * np.ptp(P), names, "hole")
        self.theta = self._heat()
        self._elastic()

    def over_edge(self, name: str, data: Any) -> Array:
        """(s, 2) ∫ data φ over the sides of an edge at either end, 0 on other sides."""
        found, on = np.zeros((len(self.sides), 2)), np.flatnonzero(self.edge == name)
        a, b = (self.points[self.sides[on, i]] for i in (0, 1))
        for xi, weight in zip(*GAUSS, strict=True):
            r = 0.5 * (1 + xi)
            value = 0.5 * weight * self.length[on] * at(data, a + r * (b - a))
            found[on] += np.column_stack([(1 - r) * value, r * value])
        return found

    def nodal(self, sides: Array) -> Array:
        """(n,) what sides give to nodes."""
        return np.bincount(self.sides.ravel(), sides.ravel(), len(self.points))

    def over_body(self, data: Any, where: NDArray[np.bool_]) -> Array:
        """(n,) ∫ data φ over triangles, by Gauss's rule on collapsed squares."""
        found = np.zeros(len(self.points))
        for one, u in zip(*GAUSS, strict=True):
            for two, v in zip(*GAUSS, strict=True):
                r, s = 0.5 * (1 + one), 0.5 * (1 + two)
                weights = np.array([1 - r, r * (1 - s), r * s])
                x = np.einsum("k,tkd->td", weights, self.points[self.triangles])
                value = 0.5 * u * v * r * self.area * where * at(data, x)
                np.add.at(found, self.triangles, value[:, None] * weights)
        return found

    def mass(self, name: str) -> sp.csr_array:
        """∫ φ_i φ_j over an edge."""
        on = self.edge == name
        (i, j), third = self.sides[on].T, self.length[on] / 6
        rows, columns = np.concatenate([i, j, i, j]), np.concatenate([i, j, j, i])
        entries = np.concatenate([2 * third, 2 * third, third, third])
        return sp.csr_array((entries, (rows, columns)), shape=(len(self.points),) * 2)

    def _heat(self) -> Array:
        scene, n, heat = self.scene, len(self.points), self.scene["heat"]
        k = np.where(self.inside, scene["core"]["k"], scene["material"]["k"])
        entries = np.einsum("tid,tjd,t->tij", self.slopes, self.slopes, self.area * k)
        i, j = np.repeat(self.triangles, 3, axis=1), np.tile(self.triangles, (1, 3))
        K = sp.csr_array((entries.ravel(), (i.ravel(), j.ravel())), shape=(n, n))
        load, theta = (
            self.over_body(heat["q"], self.inside if heat["omega"] else np.ones(len(k), bool)),
            np.zeros(n),
        )
        for name, role in scene["boundary"].items():
            own = role if role["role"] == "convection" else role.get("heat", {})
            if role["role"] == "convection" or "alpha" in own:
                alpha = own.get("alpha", heat["alpha"])
                K = K + alpha * self.mass(name)
                load += alpha * self.nodal(
                    self.over_edge(name, own.get("theta_bar", heat["theta_bar"]))
                )
            load += self.nodal(self.over_edge(name, own.get("flux", 0.0)))
            if "theta" in own:
                nodes = np.unique(self.sides[self.edge == name])
                theta[nodes] = at(own["theta"], self.points[nodes])
                load[nodes] = np.inf
        free = np.isfinite(load)
        theta[free] = spla.spsolve(K[free][:, free].tocsc(), load[free] - K[free] @ theta)
        return theta

    def _elastic(self) -> None:
        scene, n = self.scene, len(self.points)
        both = [plane(scene[name], scene["stress"]) for name in ("material", "core")]
        lam, mu, beta = (np.where(self.inside, one, rest) for rest, one in zip(*both, strict=True))
        g = self.slopes
        entries = np.einsum("t,tia,tjb->tiajb", self.area * lam, g, g)
        entries += np.einsum("t,tib,tja->tiajb", self.area * mu, g, g)
        entries += np.einsum("t,tic,tjc,ab->tiajb", self.area * mu, g, g, np.eye(2))
        unknowns = 2 * self.triangles[:, :, None] + np.arange(2)
        rows = np.broadcast_to(unknowns[:, :, :, None, None], entries.shape).ravel()
        columns = np.broadcast_to(unknowns[:, None, None], entries.shape).ravel()
        A = sp.csr_array((entries.ravel(), (rows, columns)), shape=(2 * n, 2 * n))
        F = np.zeros((n, 2))
        np.add.at(
            F,
            self.triangles,
            (self.area * beta * self.theta[self.triangles].mean(axis=1))[:, None, None] * g,
        )
        F += np.column_stack([self.over_body(one, np.ones(len(lam), bool)) for one in scene["f"]])
        for name, role in scene["boundary"].items():
            push = self.over_edge(name, role.get("pressure", 0.0))
            whole = self.length[self.edge == name].sum()
            for c in (0, 1):
                force = (
                    role["force"][c] / whole if "force" in role and role["role"] != "rigid" else 0.0
                )
                F[:, c] += self.nodal(
                    self.over_edge(name, role.get("g", (0.0, 0.0))[c]) - push * self.n[:, [c]]
                )
                F[:, c] += self.nodal(self.over_edge(name, force))
            if role["role"] == "rigid":
                F[self.sides[self.edge == name][0, 0]] += role["force"]
            if "spring" in role:
                axes = (
                    (self.n[self.edge == name][0], "normal"),
                    (self.t[self.edge == name][0], "tangential"),
                )
                block = sum(role["spring"][word] * np.outer(axis, axis) for axis, word in axes)
                A = A + sp.kron(self.mass(name), block, format="csr")
        self.A, self.F = sp.csr_array(A), F.ravel()

    def constraints(self) -> tuple[sp.csr_array, Array]:
        """(B, d) with B u = d: components that edges hold, at every node those that are
        independent, and rigid ties."""
        lines: dict[int, list[tuple[Array, float]]] = {}
        ties = []
        for name, role in self.scene["boundary"].items():
            nodes, normal = np.unique(self.sides[self.edge == name]), self.n[self.edge == name][0]
            given = [(normal, 0.0)] if role["role"] in ("contact", "symmetry") else []
            given += [
                (axis, role[f"u_{c}"])
                for axis, c in zip(np.eye(2), "xy", strict=True)
                if f"u_{c}" in role
            ]
            for direction, value in given:
                for i, u in zip(nodes.tolist(), at(value, self.points[nodes]), strict=True):
                    lines.setdefault(i, []).append((direction, float(u)))
            if role["role"] == "rigid":
                ties += [
                    (2 * i + c, 2 * nodes[0] + c)
                    for c in (0, 1)
                    if f"u_{'xy'[c]}" not in role
                    for i in nodes[1:]
                ]
        rows: list[tuple[Array, Array, float]] = []
        for i, own in lines.items():
            a, b = own[0][0]
            other = [one for one in own if abs(a * one[0][1] - b * one[0][0]) > 1e-6]
            rows += [
                (2 * i + np.arange(2), direction, value)
                for direction, value in (own[0], *other[:1])
            ]
        self.held = np.bincount(
            [int(place[0]) // 2 for place, *_ in rows], minlength=len(self.points)
        )
        rows += [(np.array(pair), np.array([1.0, -1.0]), 0.0) for pair in ties]
        place, factor = (np.concatenate([row[k] for row in rows]) for k in (0, 1))
        B = sp.csr_array(
            (factor, (np.repeat(np.arange(len(rows)), 2), place)),
            shape=(len(rows), self.A.shape[0]),
        )
        return B, np.array([row[2] for row in rows])

    def contact(self) -> tuple[NDArray[np.intp], Array, Array, list[str]]:
        """The nodes (m,) of Γ_C that are free along t, t there (m, 2), c (m,), and the edge whose
        law each has."""
        on = [
            k
            for k, name in enumerate(self.edge)
            if self.scene["boundary"][name]["role"] == "contact"
        ]
        c, after = np.zeros(len(self.points)), {}
        for k in on:
            loose = self.held[self.sides[k]] < 2
            c[self.sides[k]] += self.length[k] * (loose if loose.sum() == 1 else 0.5 * loose)
            after.setdefault(int(self.sides[k, 1]), k)
        after |= {int(self.sides[k, 0]): k for k in on}
        nodes = np.array([i for i in after if self.held[i] < 2])
        own = [after[i] for i in nodes.tolist()]
        return nodes, self.t[own], c[nodes], [str(name) for name in self.edge[own]]

    def solve(self, near: dict[int, float]) -> tuple[Array, Array, Array, Array]:
        """u (n, 2), forces on the supports (n, 2), ξ/c (m,), and the defect of the inclusion there,
        relative to b.

        near: slips of the contact nodes: which of them rest (0), and to which side the others slide
        """
        B, d = self.constraints()
        nodes, t, c, edges = self.contact()
        laws = [
            (law, np.array([e == edge for e in edges]))
            for edge, law in self.scene["friction"].items()
        ]
        for law, own in laws:
            c = c * np.where(own, at(law.get("strength", 1.0), self.points[nodes]), 1.0)
        along = sp.csr_array((t.ravel(), (np.repeat(np.arange(len(nodes)), 2), (2 * nodes[:, None] + [0, 1]).ravel())),
                             shape=(len(nodes), self.A.shape[0]))  # fmt: skip
        s = np.array([near[i] for i in nodes.tolist()])
        side, b, slope = np.sign(s), np.zeros(len(s)), np.zeros(len(s))
        size = self.A.diagonal().max()
        held = size * sp.vstack([B, along[side == 0]])
        given, last = size * np.append(d, np.zeros(int((side == 0).sum()))), np.inf
        for _ in range(30):
            for law, own in laws:
                b[own], slope[own] = friction(law, np.abs(s[own]))
            stiff = self.A + along.T @ sp.diags_array(np.abs(side) * c * slope) @ along
            pull = along.T @ (c * np.where(side == 0, 0.0, side * b - slope * s))
            whole = sp.block_array([[stiff, held.T], [held, None]], format="csc")
            u = spla.spsolve(whole, np.append(self.F - pull, given))[: len(self.F)]
            moved, s = np.max(np.abs(along @ u - s)), np.where(side == 0, 0.0, along @ u)
            if not moved < 0.5 * last:
                break
            last = moved
        force = self.A @ u - self.F
        xi, most = -(along @ force), c * b
        defect = np.where(
            side == 0, np.maximum(np.abs(xi) - most, 0.0), np.abs(xi - np.sign(s) * most)
        )
        return (
            u.reshape(-1, 2),
            force.reshape(-1, 2),
            xi / self.contact()[2],
            defect / np.max(np.abs(xi)),
        )
