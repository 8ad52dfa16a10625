"""All solutions of a block of points beside the lowest one, which is then proved to be the lowest of all."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tcstudy.contact.active_set import judge
from tcstudy.contact.all_solutions import LAW_ERROR, Equilibria, of_rows
from tcstudy.contact.block import BlockAnswers, Options, solve_block
from tcstudy.contact.boxes import Limits, reach_of
from tcstudy.contact.contact import TIE
from tcstudy.contact.loop import Status
from tcstudy.contact.path.chords import piecewise_linear
from tcstudy.contact.problem import CondensedBody, ContactProblem, kept
from tcstudy.laws.laws import Laws
from tcstudy.scene.study import ESCAPE

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Every:
    """The solutions of P points, and what a block answers.

    solutions: of each point;  polygon: (P,) whether they are those of the polygon of an exponential law
    """

    answers: BlockAnswers
    solutions: tuple[Equilibria, ...]
    polygon: Flags


def solve_every(
    body: CondensedBody, loads: Array, laws: Laws, options: Options, limits: Limits, exact: Array | None = None
) -> Every:
    """Solve P points as `solve_block` does, and find all their solutions.

    Where these are proved to be all, the answer is the one of least energy and certified to be; of exponential laws
    nothing more is said than of their polygon, which is another problem.
    """
    answers = solve_block(body, loads, laws, options, exact=exact)
    straight, polygon = laws, np.zeros(len(loads), dtype=bool)
    if not laws.piecewise_linear:
        polygon[:] = np.asarray(np.any(laws.bent, axis=-1))[laws.index].any(-1)
        far = float(np.max(reach_of(body.c, laws, loads, body.lambda_1), initial=0.0))
        straight = laws.mapped(lambda law: piecewise_linear(law, LAW_ERROR, far))
    found = of_rows(body.A_tilde, body.c, straight, loads, body.lambda_1, limits)
    proved = np.array([one.complete for one in found], dtype=bool) & ~polygon & (kept(body.A_error) == 1.0)
    return Every(_least(ContactProblem.on(body, loads, laws), answers, found, proved, options), tuple(found), polygon)


def _least(
    rows: ContactProblem, answers: BlockAnswers, found: list[Equilibria], proved: Flags, options: Options
) -> BlockAnswers:
    """The answers with the least solution where that is known, and what is proved of them by that."""
    least = np.array([one.energy[0] if len(one) else np.inf for one in found])
    failed = answers.status != Status.CONVERGED
    higher = answers.energy > least + TIE * np.maximum(np.abs(least), np.abs(answers.energy))
    changed = np.flatnonzero(proved & (failed | higher))
    fields = ("v", "v_low", "xi", "inclusion_residual", "rounding", "limited", "energy", "status", "start")
    new = {name: getattr(answers, name).copy() for name in (*fields, "start_energies")}
    reasons = list(answers.reasons)
    if len(changed):
        v = np.array([found[i].v[0] for i in changed])
        judged = judge(rows.take(changed), v, options.acceptance)
        good = judged.accepted
        for name, values in (("v", v), ("v_low", 0.0 * v), ("xi", judged.xi), ("energy", least[changed]),
                             ("inclusion_residual", judged.residual), ("rounding", judged.rounding),
                             ("limited", judged.residual > options.acceptance.aim)):  # fmt: skip
            new[name][changed[good]] = values[good]
        new["status"][changed[good]], new["start"][changed[good]] = Status.CONVERGED, ESCAPE
        new["start_energies"][changed[good], ESCAPE] = least[changed[good]]
        for i in changed[good]:
            reasons[i] = ""
        proved = proved.copy()
        proved[changed[~good]] = False
    proved = proved & (new["status"] == Status.CONVERGED)
    certificates, alone = answers.certificates, np.array([len(one) == 1 for one in found], dtype=bool)
    certificates = replace(
        certificates,
        unique=certificates.unique | (proved & alone),
        strict_minimum=certificates.strict_minimum | proved,
        global_minimum=certificates.global_minimum | proved,
    )
    return replace(answers, **new, reasons=tuple(reasons), certificates=certificates)
