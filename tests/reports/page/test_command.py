"""`tcstudy report` on the command line."""

from pathlib import Path

import pytest

from tcstudy.cli import main


def test_the_page_lies_beside_its_file(result: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", str(result)]) == 0
    assert result.with_suffix(".html").is_file()
    assert capsys.readouterr().out.startswith(f"{result.with_suffix('.html')}: ")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["-o", "{dir}"], "a page's name ends in .html"),
        (["-o", "{dir}/folder.html"], "is a directory"),
        (["-o", "{nc}"], "a page's name ends in .html"),
    ],
)
def test_bad_usage_is_one_line_and_exit_code_2(
    result: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], told: str
) -> None:
    (tmp_path / "folder.html").mkdir()
    given = [word.format(dir=tmp_path, nc=result) for word in words]
    with pytest.raises(SystemExit) as stop:
        main(["report", str(result), *given])
    assert stop.value.code == 2
    said = capsys.readouterr().err
    assert told in said
    assert said.count("\n") == 1
