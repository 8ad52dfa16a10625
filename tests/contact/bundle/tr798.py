"""Test problems 1–20 for nonsmooth unconstrained minimisation, each as an oracle x → (f, g, G).

f is the value, g one subgradient and G the matrix of second derivatives of the piece that is active
at x (the first one where several are). Kinks of |·| and ‖·‖ use the selection sign(0) = 0.

Literature: Lukšan & Vlček, Test problems for nonsmooth unconstrained and linearly constrained
optimization, TR-798, Institute of Computer Science, Prague (2000). Arrays and reference counts:
data/tr798.json.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Piece = tuple[float, Array, Array]
Oracle = Callable[[Array], Piece]

DATA: dict[str, Any] = json.loads(
    (Path(__file__).parent / "data" / "tr798.json").read_text(encoding="utf-8")
)


@dataclass(frozen=True)
class Reference:
    """One problem with its published figures.

    f0, f_star: published values at the start and at the solution, as text (their digits are their accuracy)
    pnew:       published (iterations, evaluations), tuned per problem
    """

    number: int
    name: str
    oracle: Oracle
    x0: Array
    f0: str
    f_star: float
    pnew: tuple[int, int]


def array(key: str) -> Array:
    """An array of the data file."""
    return np.array(DATA["arrays"][key], dtype=float)


def largest(pieces: Sequence[Piece]) -> Piece:
    """max_i f_i with the derivatives of the first piece that attains it."""
    return pieces[int(np.argmax([p[0] for p in pieces]))]


def quadratic(x: Array, Q: Array, q: Array, constant: float = 0.0) -> Piece:
    """½xᵀQx + qᵀx + constant."""
    return float(0.5 * x @ Q @ x + q @ x + constant), Q @ x + q, Q


def combine(*terms: tuple[float, Piece]) -> Piece:
    """Σ w_i (f_i, g_i, G_i)."""
    f = float(sum(w * p[0] for w, p in terms))
    g, G = (np.sum([w * p[i] for w, p in terms], axis=0) for i in (1, 2))
    return f, g, G


def absolute(p: Piece) -> Piece:
    """|p|."""
    return combine((float(np.sign(p[0])), p))


def square(p: Piece) -> Piece:
    """p²."""
    return p[0] ** 2, 2 * p[0] * p[1], 2 * np.outer(p[1], p[1]) + 2 * p[0] * p[2]


def linear(x: Array, q: Sequence[float] | Array, constant: float = 0.0) -> Piece:
    """qᵀx + constant."""
    q = np.asarray(q, dtype=float)
    return float(q @ x + constant), q, np.zeros((len(x), len(x)))


def rosenbrock(x: Array) -> Piece:
    a, r = x[0], x[1] - x[0] ** 2
    g = np.array([-400 * a * r - 2 * (1 - a), 200 * r])
    G = np.array([[800 * a * a - 400 * r + 2, -400 * a], [-400 * a, 200.0]])
    return float(100 * r * r + (1 - a) ** 2), g, G


def crescent(x: Array) -> Piece:
    t = quadratic(x, 2 * np.eye(2), np.array([0.0, -2.0]))
    return largest([combine((sign, t), (1.0, linear(x, (0, 1)))) for sign in (1.0, -1.0)])


def cb(x: Array, powers: tuple[int, int]) -> Piece:
    k, m = powers
    first = (
        x[0] ** k + x[1] ** m,
        np.array([k * x[0] ** (k - 1), m * x[1] ** (m - 1)]),
        np.diag([k * (k - 1) * x[0] ** (k - 2), m * (m - 1) * x[1] ** (m - 2)]),
    )
    e = 2 * np.exp(x[1] - x[0])
    exponential = (float(e), e * np.array([-1.0, 1.0]), e * np.array([[1.0, -1.0], [-1.0, 1.0]]))
    return largest([first, quadratic(x, 2 * np.eye(2), np.array([-4.0, -4.0]), 8.0), exponential])


def dem(x: Array) -> Piece:
    return largest(
        [linear(x, (5, 1)), linear(x, (-5, 1)), quadratic(x, 2 * np.eye(2), np.array([0.0, 4.0]))]
    )


def ql(x: Array) -> Piece:
    cuts = [linear(x, (0, 0)), linear(x, (-40, -10), 40.0), linear(x, (-10, -20), 60.0)]
    return largest(
        [combine((1.0, quadratic(x, 2 * np.eye(2), np.zeros(2))), (1.0, cut)) for cut in cuts]
    )


def lq(x: Array) -> Piece:
    plane = linear(x, (-1, -1))
    return largest([plane, combine((1.0, plane), (1.0, circle(x)))])


def circle(x: Array) -> Piece:
    """x₁² + x₂² − 1."""
    return quadratic(x, 2 * np.eye(2), np.zeros(2), -1.0)


def mifflin1(x: Array) -> Piece:
    plane = linear(x, (-1, 0))
    return largest([plane, combine((1.0, plane), (20.0, circle(x)))])


def mifflin2(x: Array) -> Piece:
    t = circle(x)
    return combine((1.0, linear(x, (-1, 0))), (2.0, t), (1.75, absolute(t)))


def wolfe(x: Array) -> Piece:
    a, b = float(x[0]), float(x[1])
    if a >= abs(b) and a > 0:
        root = np.sqrt(9 * a * a + 16 * b * b)
        g = np.array([9 * a, 16 * b]) / root
        return 5 * root, 5 * g, 5 * (np.diag([9.0, 16.0]) - np.outer(g, g)) / root
    p = linear(x, (9, 16 * np.sign(b)))
    if a > 0:
        return p
    power = (a**9, np.array([9 * a**8, 0.0]), np.diag([72 * a**7, 0.0]))
    return combine((1.0, p), (-1.0, power))


def rosen_suzuki(x: Array) -> Piece:
    def q(diagonal: Sequence[float], slope: Sequence[float], constant: float) -> Piece:
        return quadratic(
            x,
            2 * np.diag(np.asarray(diagonal, dtype=float)),
            np.asarray(slope, dtype=float),
            constant,
        )

    f1 = q((1, 1, 2, 1), (-5, -5, -21, 7), 0.0)
    f2 = q((1, 1, 1, 1), (1, -1, 1, -1), -8.0)
    f3 = q((1, 2, 1, 2), (-1, 0, 0, -1), -10.0)
    f4 = q((1, 1, 1, 0), (2, -1, 0, -1), -5.0)
    return largest([f1, *(combine((1.0, f1), (10.0, f)) for f in (f2, f3, f4))])


def shor(x: Array) -> Piece:
    y, w = array("shor_y"), array("shor_w")
    i = int(np.argmax(w * np.sum((x - y) ** 2, axis=1)))
    r = x - y[i]
    return float(w[i] * r @ r), 2 * w[i] * r, 2 * w[i] * np.eye(5)


def colville1(x: Array) -> Piece:
    A, b, C, d, e = (array(f"colville_{k}") for k in "abcde")
    cubic = (float(d @ x**3), 3 * d * x**2, np.diag(6 * d * x))
    smooth = combine((1.0, cubic), (1.0, quadratic(x, C + C.T, e)))
    cuts = [
        linear(x, np.zeros(5)),
        *(linear(x, -row, constant) for row, constant in zip(A, b, strict=True)),
    ]
    return combine((1.0, smooth), (50.0, largest(cuts)))


def hs78(x: Array) -> Piece:
    n = len(x)
    gradient, hessian = np.zeros(n), np.zeros((n, n))
    for i in range(n):
        gradient[i] = np.prod([x[j] for j in range(n) if j != i])
        for k in range(n):
            hessian[i, k] = np.prod([x[j] for j in range(n) if j not in (i, k)]) if k != i else 0.0
    product = (float(np.prod(x)), gradient, hessian)
    sphere = quadratic(x, 2 * np.eye(n), np.zeros(n), -10.0)
    Q = np.zeros((n, n))
    Q[1, 2] = Q[2, 1] = 1.0
    Q[3, 4] = Q[4, 3] = -5.0
    saddle = quadratic(x, Q, np.zeros(n))
    cubes = np.array([1.0, 1.0, 0.0, 0.0, 0.0])
    cubic = (float(cubes @ x**3 + 1.0), 3 * cubes * x**2, np.diag(6 * cubes * x))
    return combine((1.0, product), *((10.0, absolute(p)) for p in (sphere, saddle, cubic)))


def el_attar(x: Array) -> Piece:
    t = np.arange(51) / 10.0
    y = 0.5 * np.exp(-t) - np.exp(-2 * t) + 0.5 * np.exp(-3 * t)
    y = y + 1.5 * np.exp(-1.5 * t) * np.sin(7 * t) + np.exp(-2.5 * t) * np.sin(5 * t)
    d1, d2 = np.exp(-x[1] * t), np.exp(-x[5] * t)
    c, s = np.cos(x[2] * t + x[3]), np.sin(x[2] * t + x[3])
    r = x[0] * d1 * c + x[4] * d2 - y
    sign, p, q = np.sign(r), d1 * c, d1 * s
    J = np.array([p, -t * x[0] * p, -t * x[0] * q, -x[0] * q, d2, -t * x[4] * d2])
    G = np.zeros((6, 6))
    G[0, 1:4] = sign @ np.transpose([-t * p, -t * q, -q])
    G[1, 1:4] = x[0] * sign @ np.transpose([t * t * p, t * t * q, t * q])
    G[2, 2:4] = -x[0] * sign @ np.transpose([t * t * p, t * p])
    G[3, 3] = -x[0] * sign @ p
    G[4, 5], G[5, 5] = -sign @ (t * d2), x[4] * sign @ (t * t * d2)
    G = G + np.triu(G, 1).T
    return float(np.abs(r).sum()), J @ sign, G


@cache
def maxquad_arrays() -> tuple[Array, Array]:
    """A (5, 10, 10) and b (5, 10)."""
    i = np.arange(1.0, 11.0)
    A, b = np.zeros((5, 10, 10)), np.zeros((5, 10))
    for k in range(1, 6):
        low, high = np.minimum.outer(i, i), np.maximum.outer(i, i)
        M = np.exp(low / high) * np.cos(np.outer(i, i)) * np.sin(k)
        np.fill_diagonal(M, 0.0)
        A[k - 1] = M + np.diag(i / 10 * abs(np.sin(k)) + np.abs(M).sum(axis=1))
        b[k - 1] = np.exp(i / k) * np.sin(i * k)
    return A, b


def maxquad(x: Array) -> Piece:
    A, b = maxquad_arrays()
    k = int(np.argmax(np.einsum("i,kij,j->k", x, A, x) - b @ x))
    return quadratic(x, 2 * A[k], -b[k])


def gill(x: Array) -> Piece:
    n = len(x)
    s = quadratic(x, 2 * np.eye(n), np.zeros(n), -0.25)
    near = quadratic(x, 2 * np.eye(n), np.full(n, -2.0), float(n))
    return largest([combine((1.0, near), (1e-3, square(s))), gill_equation(x), gill_valleys(x)])


def gill_equation(x: Array) -> Piece:
    n, j = len(x), np.arange(10)
    terms: list[tuple[float, Piece]] = [(1.0, square(linear(x, np.eye(n)[0])))]
    bend = np.zeros((n, n))
    bend[0, 0] = -2.0
    terms.append((1.0, square(quadratic(x, bend, np.eye(n)[1], -1.0))))
    for i in range(2, 31):
        tau = (i - 1) / 29
        slope = np.concatenate([[0.0], j[1:] * tau ** (j[1:] - 1.0)])
        residual = combine(
            (1.0, linear(x, slope, -1.0)), (-1.0, square(linear(x, tau ** j.astype(float))))
        )
        terms.append((1.0, square(residual)))
    return combine(*terms)


def gill_valleys(x: Array) -> Piece:
    n = len(x)
    f, g, G = 0.0, np.zeros(n), np.zeros((n, n))
    for i in range(1, n):
        a, r = x[i - 1], x[i] - x[i - 1] ** 2
        f += 100 * r * r + (1 - x[i]) ** 2
        g[i - 1 : i + 1] += np.array([-400 * a * r, 200 * r - 2 * (1 - x[i])])
        G[i - 1 : i + 1, i - 1 : i + 1] += np.array(
            [[800 * a * a - 400 * r, -400 * a], [-400 * a, 202.0]]
        )
    return float(f), g, G


def steiner2(x: Array) -> Piece:
    Y, p, between = array("steiner2_y"), array("steiner2_p"), array("steiner2_ptilde")
    identity = np.eye(12)

    def point(j: int) -> Array:
        return identity[[j, j + 6]]

    norms = [(1.0, point(0), np.zeros(2)), (1.0, point(5), np.array([5.5, -1.0]))]
    norms += [(p[j], point(j), Y[j]) for j in range(6)]
    norms += [(between[j], point(j) - point(j + 1), np.zeros(2)) for j in range(5)]
    return combine(*((float(w), distance(x, B, z)) for w, B, z in norms))


def distance(x: Array, B: Array, z: Array) -> Piece:
    """‖Bx − z‖."""
    r = B @ x - z
    length = float(np.linalg.norm(r))
    if length == 0.0:
        return 0.0, np.zeros(len(x)), np.zeros((len(x), len(x)))
    unit = r / length
    return length, B.T @ unit, B.T @ (np.eye(2) - np.outer(unit, unit)) @ B / length


def maxq(x: Array) -> Piece:
    i = int(np.argmax(x * x))
    e = np.eye(len(x))[i]
    return float(x[i] ** 2), 2 * x[i] * e, 2 * np.outer(e, e)


def maxl(x: Array) -> Piece:
    i = int(np.argmax(np.abs(x)))
    return abs(float(x[i])), np.sign(x[i]) * np.eye(len(x))[i], np.zeros((len(x), len(x)))


ORACLES: tuple[Oracle, ...] = (
    rosenbrock, crescent, lambda x: cb(x, (2, 4)), lambda x: cb(x, (4, 2)), dem, ql, lq, mifflin1, mifflin2, wolfe,
    rosen_suzuki, shor, colville1, hs78, el_attar, maxquad, gill, steiner2, maxq, maxl,
)  # fmt: skip


def problems() -> list[Reference]:
    """The 20 problems in the order of the report."""
    found = []
    for number, (row, oracle) in enumerate(zip(DATA["problems"], ORACLES, strict=True), start=1):
        x0 = array(row["x0"]) if isinstance(row["x0"], str) else np.array(row["x0"], dtype=float)
        found.append(
            Reference(
                number, row["name"], oracle, x0, row["f0"], float(row["f_star"]), tuple(row["pnew"])
            )
        )
    return found
