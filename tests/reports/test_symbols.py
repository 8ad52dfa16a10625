"""Symbols of parameters in reports."""

from tcstudy.reports.symbols import symbol


def test_parameters_are_written_with_the_symbols_of_the_paper() -> None:
    names = ("alpha", "theta_bar", "friction.tau_s", "material.E", "boundary_end_theta_bar",
             "boundary_grip_u_x", "heat_theta")  # fmt: skip
    assert symbol("friction.film.points.2") == "b_2"
    bar = "θ\N{COMBINING MACRON}"
    written = ["α", bar, "τ_s", "E", f"{bar} of end", "u_x of grip", "θ"]
    assert [symbol(name) for name in names] == written


def test_symbols_keep_the_edge_or_region_that_they_belong_to() -> None:
    bar = "θ\N{COMBINING MACRON}"
    written = {
        "boundary.end.pressure": "pressure of end",
        "boundary.left.theta_bar": f"{bar} of left",
        "boundary.my_right.heat.alpha": "α of my_right",
        "boundary.grip.spring.k_T": "k_T of grip",
        "friction.film.tau_s": "τ_s of film",
        "materials.coat.E": "E of coat",
    }
    assert {path: symbol(path) for path in written} == written
