"""Whether blocks of points find what the single solve finds: `python -m tests.benchmarks.blocks [N]`, half an hour.

N problems of the reliability benchmark (10,000 unless given), those of the failure map on synthetic lines and on real
bodies, and N/5 saw-tooth problems, the last in blocks of twenty. Counted: energies above that of the single solve by
more than 1e-12 of it and than rounding of vᵀÃv, below it by more, certificates lost and gained, answers missing on
either side.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from tcstudy.contact.block import TIE, Answer, solve_block
from tcstudy.contact.certificates import Certificate, certify
from tcstudy.contact.contact import solve_contact
from tcstudy.contact.problem import CondensedBody, ContactProblem
from tcstudy.contact.status import Status
from tcstudy.laws.laws import Laws
from tests.benchmarks.stability_chain import ChainGrid, chain
from tests.benchmarks.stability_maps import Grid, down_jumps, synthetic, waves
from tests.contact.contact_cases import half_laplacian, random_problem

FLAGS = ("convex", "unique", "strict_minimum", "global_minimum")
SIZES = (20, 60, 200)
LOADS = 20
"""Points of a block of saw-tooth problems."""

Group = list[ContactProblem]
"""Problems on one body that are solved as one block."""


def reliability(problems: int) -> Iterator[Group]:
    """The problems of tests.benchmarks.reliability, each on a body of its own."""
    for n in range(problems):
        yield [random_problem(np.random.default_rng([n, 2010]), SIZES[n % 3], smooth=(n // 3) % 2 == 1)]


def failure_map() -> Iterator[Group]:
    """The problems of tests.benchmarks.stability."""
    for case in (*chain(ChainGrid()), *synthetic(Grid())):
        yield [case.problem]


def saw_teeth(problems: int) -> Iterator[Group]:
    """Laws with 1 to 30 down-jumps of random height on each side, a law a block, on lines of 5 to 44 nodes."""
    for n in range(problems // LOADS):
        rng = np.random.default_rng([n, 2026])
        A_tilde, c = half_laplacian(int(rng.choice((5, 11, 22, 44))))
        law = down_jumps(rng.uniform(0.05, 0.9), int(rng.integers(1, 31)), rng.uniform(0.1, 1.0))
        x, group = (np.arange(len(c)) + 0.5) / len(c), []
        for _ in range(LOADS):
            mean, parts = waves(rng)
            shape = mean + sum(a * np.sin(k * np.pi * x + phase) for k, a, phase in parts)
            group.append(ContactProblem(A_tilde, c * shape * rng.uniform(0.5, 3.0) / np.max(np.abs(shape)), c, law))
        yield group


@dataclass(frozen=True)
class Single:
    """What the single solve and its certificates say of a problem."""

    answer: Answer
    proved: Certificate


def solved_alone(body: CondensedBody, problem: ContactProblem) -> Single:
    """A problem by the single solve."""
    answer = solve_contact(problem)
    known = {"inverse": body.inverse, "residual": answer.inclusion_residual}
    return Single(answer, certify(problem, answer.v, body.lambda_1, **known))


def compare(groups: Iterable[Group]) -> Counter[str]:
    """What blocks find beside the single solve."""
    counts: Counter[str] = Counter()
    for group in groups:
        body = CondensedBody.of(group[0].A_tilde, group[0].c)
        laws = Laws.of([group[0].law], np.zeros((len(group), 1)))
        answers = solve_block(body, np.stack([problem.l_tilde for problem in group]), laws)
        for p, problem in enumerate(group):
            counts.update(("points", *differences(answers, p, problem, solved_alone(body, problem))))
    return counts


def differences(answers: Answer, p: int, problem: ContactProblem, single: Single) -> Iterator[str]:
    """In what a point of a block differs from the same problem solved alone."""
    own, alone = single.answer, single.answer.status == Status.CONVERGED
    solved = answers.status[p] == Status.CONVERGED
    if solved != alone:
        yield "solved alone only" if alone else "solved in blocks only"
    if not solved or not alone:
        return
    size = np.abs(own.v)
    rounding = 8.0 * np.finfo(float).eps * float((size @ np.abs(problem.A_tilde) + np.abs(problem.l_tilde)) @ size)
    slack = TIE * (abs(own.energy) + float(problem.c @ np.abs(problem.law.j(own.v)))) + rounding
    if abs(answers.energy[p] - own.energy) > slack:
        yield "energy higher" if answers.energy[p] > own.energy else "energy lower"
    for flag in FLAGS:
        found, expected = bool(getattr(answers.certificate, flag)[p]), bool(getattr(single.proved, flag))
        if found != expected:
            yield f"{flag} {'lost' if expected else 'gained'}"


def said(counts: Counter[str]) -> str:
    """The counts in words, the number of points first."""
    ends = [f"{count} {what}" for what, count in counts.most_common() if what != "points"]
    return f"{counts['points']} points: " + (", ".join(ends) or "energies equal and certificates the same in all")


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the counts."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    problems = int(words[0]) if words else 10_000
    with threadpool_limits(1, user_api="blas"):
        for name, groups in (
            ("reliability", reliability(problems)),
            ("saw teeth", saw_teeth(problems // 5)),
            ("failure map", failure_map()),
        ):
            print(f"{name}, {said(compare(groups))}", flush=True)


if __name__ == "__main__":
    main()
