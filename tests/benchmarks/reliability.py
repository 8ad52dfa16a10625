"""How far the default solver and its certificates can be trusted: `python -m
tests.benchmarks.reliability [N]`.

N random problems (10,000 unless given; laws with up to 41 kinks, jumps both ways, softening up to
100 λ₁; m = 20, 60, 200; three kinds of start), every tenth again in five other systems of units,
judged in extended precision by code that the package does not share; then every solution of 2,600
small problems by enumeration against its certificates, and the least energy of 822 small problems
against what a study finds with branch `lowest`, with and without the search after the plain starts;
and the same of 5,000 small problems with any law (odd or not, opposing the slip or pushing it on)
and any body, with the certificates of what was found. `--any N` makes only the last, with N
problems.
"""

import sys
from collections import Counter
from collections.abc import Sequence

import numpy as np

from tcstudy.contact.solve import ACCURACY, nearest_minimum, solve_contact
from tcstudy.scene.solver_plan import ESCAPE
from tests.contact.contact_cases import independent_residual, random_problem, rescaled
from tests.contact.exhaustive import compare, hit_rates, least_energy, search, small_problem

TOLERANCE = 1e-12
UNITS = ((1e9, 1.0, 1.0), (1e-9, 1.0, 1.0), (1.0, 1e9, 1.0), (1.0, 1e-9, 1.0), (1e-9, 1e9, 1e9))
SMALL = ((1, 9, 1500), (2, 5, 800), (3, 3, 300))
"""(m, most kinks, problems) of the comparison with enumeration."""
SEARCHED = (
    (2, range(200)),
    (3, range(200)),
    (4, range(200)),
    (5, range(150)),
    (6, range(60)),
    (8, range(1, 49, 4)),
)
"""(m, seeds) of the problems whose least energy is enumerated; with m = 8 only those with few
places a node."""

ANY = 5_000
"""Problems with any law."""


def solver_counts(problems: int) -> Counter[str]:
    """Solved, flagged and wrong answers of the default method, in given and in other units."""
    counts: Counter[str] = Counter()
    for n in range(problems):
        rng = np.random.default_rng([n, 2010])
        m = (20, 60, 200)[n % 3]
        problem = random_problem(rng, m, smooth=(n // 3) % 2 == 1)
        frictionless = problem.frictionless()
        anywhere = rng.normal(size=m) * np.abs(frictionless).max()
        start = (np.zeros(m), frictionless, anywhere)[(n // 6) % 3]
        v, _ = nearest_minimum(problem, start, ACCURACY)
        solved = problem.inclusion_residual(v) <= TOLERANCE
        wrong = solved and not independent_residual(problem, v) <= TOLERANCE
        counts["wrong" if wrong else "solved" if solved else "flagged"] += 1
        for units in UNITS if n % 10 == 0 and solved else ():
            other, _ = nearest_minimum(rescaled(problem, *units), start / units[0], ACCURACY)
            same = np.max(np.abs(other * units[0] - v)) <= 1e-6 * np.max(np.abs(v))
            counts["same in other units" if same else "another answer in other units"] += 1
    return counts


def certificate_lines() -> list[str]:
    """Contradicted certificates and hit rates against enumeration."""
    lines = []
    for m, kinks, problems in SMALL:
        found = [c for seed in range(10_000, 10_000 + problems) for c in compare(seed, m, kinks)]
        contradicted = sum(
            (c.certificate.unique and c.solutions > 1)
            or (c.certificate.global_minimum and c.above_least > 1e-12)
            or (c.certificate.strict_minimum and not c.strict)
            for c in found
        )
        rates = ", ".join(f"{name} {rate:.2f}" for name, rate in hit_rates(found).items())
        lines.append(
            f"m = {m}: {len(found)} solutions, {contradicted} certificates contradicted; hit rates {rates}"
        )
    return lines


def search_line(m: int, seeds: Sequence[int]) -> str:
    """How often the least energy of all was found."""
    before = after = searched = 0
    for seed in seeds:
        problem = small_problem(seed, m)
        least = least_energy(problem)
        answer = solve_contact(problem)
        above = least + 1e-10 * (abs(least) + float(problem.c @ np.abs(problem.law.j(answer.v))))
        before += float(np.nanmin(answer.energies[:ESCAPE])) <= above
        after += answer.energy <= above
        searched += bool(np.isfinite(answer.energies[ESCAPE]))
    return (
        f"m = {m}: of {len(seeds)} problems the least energy was found in {after}, "
        f"from the plain starts alone in {before}; searched further in {searched}"
    )


def any_line(problems: int) -> str:
    """How often the least energy of all was found whatever the law, and what certificates were
    wrong."""
    results = [search(seed, 1 + seed % 8) for seed in range(problems)]
    found, plain, solved = (
        sum(getattr(r, name) for r in results) for name in ("found", "plain", "solved")
    )
    contradicted = sum(len(r.contradicted) for r in results)
    return (
        f"any law, m = 1 to 8: of {problems} problems {solved} solved, the least energy found in {found}, "
        f"from the plain starts alone in {plain}; {contradicted} certificates contradicted"
    )


def main(arguments: Sequence[str] | None = None) -> None:
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words[:1] == ["--any"]:
        print(any_line(int(words[1]) if words[1:] else ANY))
        return
    problems = int(words[0]) if words else 10_000
    counts = solver_counts(problems)
    print(
        f"{problems} problems: "
        + ", ".join(f"{name} {count}" for name, count in sorted(counts.items())),
        flush=True,
    )
    print("\n".join(certificate_lines()), flush=True)
    for m, seeds in SEARCHED:
        print(search_line(m, seeds), flush=True)
    print(any_line(ANY), flush=True)


if __name__ == "__main__":
    main()
