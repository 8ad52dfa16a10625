"""The live mode in a real browser gives the answers of tcstudy where ω < λ₁, at random places of all sliders."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import tcstudy
from tcstudy.reports.page.write import write_page
from tcstudy.reports.stored_study import file_order
from tcstudy.study.execute import execute
from tests.reports.page.browser import Browser, missing
from tests.reports.page.live_cases import finest, settings, studies

pytestmark = [pytest.mark.browser, pytest.mark.skipif(bool(missing()), reason=missing())]

SETTINGS = 100
AGREEMENT = 1e-10

SOLVE = """
TC.live.setup();
return arguments[0].map(({point, sliders}) => {
  const problem = TC.live.problem(point, sliders);
  if (!TC.live.unique(point, problem.law)) return null;
  const answer = TC.solve(problem);
  return {...answer, v: Array.from(answer.v), xi: null};
});
"""


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    window = Browser(tmp_path_factory.mktemp("profile"))
    yield window
    window.close()


@pytest.mark.parametrize("name", ["bracket", "pad", "plate"])
def test_answers_agree_with_tcstudy(name: str, browser: Browser, tmp_path: Path) -> None:
    study = studies()[name]
    execute(study, tmp_path / "study.nc")
    written = write_page(tmp_path / "study.nc", tmp_path / "study.html")
    assert written.size <= 2_000_000
    browser.open(written.path, "#mode=live")
    cases = list(settings(study, finest(study), SETTINGS, seed=11))
    place = {scene: i for i, scene in enumerate(file_order(study))}
    told = [{"point": place[case.point], "sliders": case.sliders} for case in cases]
    answers = browser.run(SOLVE, told)
    solved = 0
    for case, answer in zip(cases, answers, strict=True):
        p = case.problem
        own = tcstudy.solve(tcstudy.ContactProblem(p.A_tilde, p.l_tilde, p.c, p.law))
        steep = p.law.omega / p.lambda_1
        assert (answer is not None) == (steep < 1.0) or abs(steep - 1.0) < 1e-5
        if answer is None:
            continue
        solved += 1
        assert answer["converged"]
        assert np.max(np.abs(np.array(answer["v"]) - own.v)) <= AGREEMENT * np.max(np.abs(own.v))
        assert answer["residual"] <= AGREEMENT
        assert answer["energy"] == pytest.approx(own.energy, rel=AGREEMENT)
    assert solved >= SETTINGS // 5
    assert browser.complaints() == []
