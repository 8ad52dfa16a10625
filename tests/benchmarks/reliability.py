"""How far the default solver and its certificates can be trusted: `python -m
tests.benchmarks.reliability [N]`.

N random problems (10,000 unless given; laws with up to 41 kinks, jumps both ways, softening up to
100 λ₁; m = 20, 60, 200; three kinds of start), every tenth again in five other systems of units,
judged in extended precision by code that the package does not share; then every solution of 2,600
small problems by enumeration against its certificates, and the least energy of 822 small problems
against what a study finds with branch `lowest`, with and without the search after the plain starts;
and the same of 5,000 small problems with any law (odd or not, opposing the slip or pushing it on)
and any body, with the certificates of what was found. `--any N` makes only the last, with N
problems. Runs of full size put their counts into results/evidence.json.
"""

import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from tcstudy.contact.solve import ACCURACY, nearest_minimum, solve_contact
from tcstudy.scene.solver_plan import ESCAPE
from tests.contact.contact_cases import independent_residual, random_problem, rescaled
from tests.contact.exhaustive import compare, hit_rates, least_energy, search, small_problem
from tests.evidence import record

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

PROBLEMS, ANY = 10_000, 5_000
"""Random problems of a run of full size, and problems with any law."""


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


class Judged(NamedTuple):
    """Certificates of the solutions of problems with m nodes, against enumeration.

    rates: shares of what is true that was certified, by certificate
    """

    m: int
    solutions: int
    contradicted: int
    rates: dict[str, float]

    def __str__(self) -> str:
        rates = ", ".join(f"{name} {rate:.2f}" for name, rate in self.rates.items())
        return (
            f"m = {self.m}: {self.solutions} solutions, {self.contradicted} certificates "
            f"contradicted; hit rates {rates}"
        )


def judged_certificates() -> Iterator[Judged]:
    """Yield contradicted certificates and hit rates by number of nodes."""
    for m, kinks, problems in SMALL:
        found = [c for seed in range(10_000, 10_000 + problems) for c in compare(seed, m, kinks)]
        contradicted = sum(
            (c.certificate.unique and c.solutions > 1)
            or (c.certificate.global_minimum and c.above_least > 1e-12)
            or (c.certificate.strict_minimum and not c.strict)
            for c in found
        )
        yield Judged(m, len(found), contradicted, hit_rates(found))


class Searched(NamedTuple):
    """How often the least energy of all was found.

    before: from the plain starts alone;  searched: problems that the search took on
    """

    problems: int
    found: int
    before: int
    searched: int


def searches(m: int, seeds: Sequence[int]) -> Searched:
    """Return how often the least energy of all was found with m nodes."""
    before = after = searched = 0
    for seed in seeds:
        problem = small_problem(seed, m)
        least = least_energy(problem)
        answer = solve_contact(problem)
        above = least + 1e-10 * (abs(least) + float(problem.c @ np.abs(problem.law.j(answer.v))))
        before += float(np.nanmin(answer.energies[:ESCAPE])) <= above
        after += answer.energy <= above
        searched += bool(np.isfinite(answer.energies[ESCAPE]))
    return Searched(len(seeds), after, before, searched)


def any_law(problems: int) -> tuple[str, int, int, int]:
    """How often the least energy of all was found whatever the law, and what certificates were
    wrong: in words, found, from the plain starts alone, contradicted."""
    results = [search(seed, 1 + seed % 8) for seed in range(problems)]
    found, plain, solved = (
        sum(getattr(r, name) for r in results) for name in ("found", "plain", "solved")
    )
    contradicted = sum(len(r.contradicted) for r in results)
    words = (
        f"any law, m = 1 to 8: of {problems} problems {solved} solved, the least energy found in {found}, "
        f"from the plain starts alone in {plain}; {contradicted} certificates contradicted"
    )
    return words, found, plain, contradicted


def found_of(found: int, problems: int, before: int) -> str:
    """Return how often the least energy was found, as the evidence has it."""
    return f"{found:,} of {problems:,}, without the search {before:,}"


def share_of(judged: Sequence[Judged], name: str) -> str:
    """Return the range of a hit rate in percent."""
    shares = [100.0 * of.rates[name] for of in judged]
    return f"{min(shares):.0f} to {max(shares):.0f} %"


def main(arguments: Sequence[str] | None = None) -> None:
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words[:1] == ["--any"]:
        print(any_law(int(words[1]) if words[1:] else ANY)[0])
        return
    problems = int(words[0]) if words else PROBLEMS
    counts = solver_counts(problems)
    print(
        f"{problems} problems: "
        + ", ".join(f"{name} {count}" for name, count in sorted(counts.items())),
        flush=True,
    )
    judged = list(judged_certificates())
    print("\n".join(map(str, judged)), flush=True)
    parts = []
    for m, seeds in SEARCHED:
        parts.append(part := searches(m, seeds))
        print(
            f"m = {m}: of {part.problems} problems the least energy was found in {part.found}, from "
            f"the plain starts alone in {part.before}; searched further in {part.searched}",
            flush=True,
        )
    any_words, any_found, any_before, any_contradicted = any_law(ANY)
    print(any_words, flush=True)
    if problems != PROBLEMS:
        return
    wrong = f"{counts['wrong']:,} wrongly" if counts["wrong"] else "none wrongly"
    contradicted = sum(of.contradicted for of in judged)
    solutions = sum(of.solutions for of in judged)
    whole = Searched(*map(sum, zip(*parts, strict=True)))
    record("solver.random", f"{counts['solved']:,} of {problems:,} solved, {wrong}")
    record("solver.lowest", found_of(whole.found, whole.problems, whole.before))
    record("solver.any_law", found_of(any_found, ANY, any_before))
    record(
        "certificates.contradicted",
        f"{contradicted or 'none'} contradicted in {solutions:,} solutions, "
        f"{any_contradicted or 'none'} in {ANY:,} more",
    )
    record(
        "certificates.rate",
        f"{share_of(judged, 'global_minimum')} of the global minima, "
        f"{share_of(judged, 'unique')} of the unique solutions",
    )


if __name__ == "__main__":
    main()
