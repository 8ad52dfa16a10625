"""Tables and words that fit."""

from tcstudy.reports.text import Table, TextColumn, columns_table, fitting, render, wrapped

TABLE = Table.of_rows(
    "Error of u_T",
    ("level", "u_T in L²(Γ_C)", "verdict"),
    (("0", "1.250e-02", "too few"), ("10", "(3.1e-03)", "100 % & more")),
)


def test_text_aligns_numbers_right():
    lines = render([TABLE]).splitlines()
    assert (lines[2], lines[4]) == (
        "  level  u_T in L²(Γ_C)  verdict",
        "      0       1.250e-02  too few",
    )
    assert lines[5] == "     10       (3.1e-03)  100 % & more"


def test_columns_go_by_importance_and_are_named():
    header, rows = ("point", "less", "most", "least"), [("1" * 10, "2" * 10, "3" * 10, "4" * 10)]
    ranks = (0, 2, 1, 3)
    columns = Table.of_rows("", header, rows, ranks).columns
    whole = columns_table(columns)
    for width, gone in (
        (48, []),
        (47, ["least"]),
        (30, ["least", "less"]),
        (5, ["least", "less", "most"]),
    ):
        with fitting(width):
            lines = columns_table(columns).splitlines()
        assert ("\n".join(lines) == whole) == (not gone)
        assert [name for name in header if name not in lines[0].split()] == sorted(
            gone, key=header.index
        )
        if gone and width > 20:
            assert f"hidden columns: {', '.join(gone)} (show with -v)" in " ".join(
                line.strip() for line in lines[3:]
            )
            assert max(map(len, lines)) <= width


def test_words_are_filled_and_tables_are_not():
    table = "  a" + "  1" * 40
    with fitting(40):
        text = wrapped("  " + "word " * 20 + "end\n" + table)
    assert table in text
    assert max(len(line) for line in text.splitlines()[:-1]) <= 40
    assert wrapped("  " + "word " * 20 + "end") == "  " + "word " * 20 + "end"


def test_headings_wrap_before_columns_are_hidden():
    header = ("θ\N{COMBINING MACRON} of left [K]", "∫ξ [kN m⁻¹]", "change to last level")
    columns = Table.of_rows("", header, [("60", "-12.5", "12")], (0, 0, 1)).columns
    with fitting(30):
        lines = columns_table(columns).splitlines()
    assert max(map(len, lines)) <= 31  # the bar over a letter takes no room
    assert len(lines) > 3
    assert not any("hidden" in line for line in lines)
    assert [line.split() for line in lines[-1:]] == [["60", "-12.5", "12"]]
    with fitting(20):
        assert "hidden columns: change to last level" in " ".join(columns_table(columns).split())


def test_what_a_column_means_stands_below_only_with_the_column():
    columns = [
        TextColumn("point", ["1" * 10]),
        TextColumn("certified", ["unique"], 1, ("certified: proved",)),
        TextColumn("again", ["unique"], 2, ("certified: proved", "again: once more")),
    ]
    for width, notes in ((80, 2), (25, 1), (15, 0)):
        with fitting(width):
            text = render([Table("", columns)])
        assert text.count(": proved") + text.count(": once") == notes
