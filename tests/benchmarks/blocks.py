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

import numpy as np
from threadpoolctl import threadpool_limits

from tcstudy.online import BlockAnswers, CondensedBody, LawTables, RowLaws, solve_block
from tcstudy.solvers.certificates import certify
from tcstudy.solvers.contact import TIE, solve_contact
from tcstudy.solvers.loop import Status
from tcstudy.solvers.problem import ContactProblem
from tests.benchmarks.stability_chain import ChainGrid, chain
from tests.benchmarks.stability_maps import Grid, down_jumps, synthetic, waves
from tests.solvers.contact_cases import half_laplacian, random_problem

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


def compare(groups: Iterable[Group]) -> Counter[str]:
    """What blocks find beside the single solve."""
    counts: Counter[str] = Counter()
    for group in groups:
        body = CondensedBody.of(group[0].A_tilde, group[0].c)
        laws = RowLaws(LawTables.of([group[0].law]), np.zeros((len(group), 1), dtype=np.intp))
        answers = solve_block(body, np.stack([problem.l_tilde for problem in group]), laws)
        for p, problem in enumerate(group):
            counts["problems"] += 1
            counts.update(_differences(body, answers, p, problem))
    return counts


def _differences(body: CondensedBody, answers: BlockAnswers, p: int, problem: ContactProblem) -> Iterator[str]:
    single = solve_contact(problem)
    solved = answers.status[p] == Status.CONVERGED
    if not solved or single.status != Status.CONVERGED:
        if solved or single.status == Status.CONVERGED:
            yield "only the single solve" if not solved else "only the block"
        return
    terms = np.abs(single.v) @ np.abs(problem.A_tilde) @ np.abs(single.v)
    rounding = 8.0 * np.finfo(float).eps * (float(terms) + float(np.abs(problem.l_tilde) @ np.abs(single.v)))
    slack = TIE * (abs(single.energy) + float(problem.c @ np.abs(problem.law.j(single.v)))) + rounding
    if abs(answers.energy[p] - single.energy) > slack:
        yield "energy higher" if answers.energy[p] > single.energy else "energy lower"
    proved = certify(problem, single.v, body.lambda_1, inverse=body.inverse, residual=single.inclusion_residual)
    for flag in FLAGS:
        own, expected = bool(getattr(answers.certificates, flag)[p]), bool(getattr(proved, flag))
        if own != expected:
            yield f"{flag} {'lost' if expected else 'gained'}"


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
            counts = compare(groups)
            print(f"{name}: " + ", ".join(f"{count} {what}" for what, count in counts.most_common()), flush=True)


if __name__ == "__main__":
    main()
