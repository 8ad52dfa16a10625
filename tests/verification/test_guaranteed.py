"""λ₁ of the body from both sides, against NGSolve at order 4 on meshes refined thrice, finer P1
meshes; its digits."""

from pathlib import Path

import ngsolve as ngs
import numpy as np
import pytest
import scipy.sparse as sp

import tcstudy
from tcstudy.contact.certificates import certify
from tcstudy.contact.problem import CondensedBody, ContactProblem, least_eigenpair
from tcstudy.contact.solve import solve_block
from tcstudy.errors import GeometryFailed, StudyError
from tcstudy.laws.laws import Laws
from tcstudy.laws.shapes import slip_weakening
from tcstudy.offline.guaranteed import Band, shape_constants
from tcstudy.offline.level import Level
from tcstudy.reports.terminal.summary import text_of, verdict_of
from tcstudy.scene.records import Scene
from tests.verification.scenes import HEATED_BRACKET, RECTANGLE, levels_of, study_of

SUPPORTS = {
    "left": (
        "clamped",
        "{role: clamped, u_x: 0}",
        "symmetry",
        "{role: traction, spring: {normal: K}}",
    ),
    "right": (
        "free",
        "{role: traction, spring: {normal: K, tangential: K}}",
        "{role: rigid, u_y: 0}",
    ),
    "top": ("free", "{role: traction, spring: {normal: K}}", "{role: rigid, moment: 0}", "clamped"),
}


def bands(text: str, *changes: str) -> list[tuple[Level, Scene, Band]]:
    study = study_of(text, *changes)
    scene = study.scenes[0]
    return [(level, scene, level.band(scene)) for level in levels_of(study)]


def reference(level: Level, scene: Scene, refined: int = 1) -> float:
    """λ₁ by order 4 on a mesh refined so often; contact along y = 0, no rigid edge."""
    kernel = level.mesh.mesh.ngmesh.Copy()
    for _ in range(refined):
        kernel.Refine()
    kernel.Scale(level.mesh.geometry.unit)
    mesh = ngs.Mesh(kernel)
    held: dict[int, list[str]] = {0: [], 1: [level.mesh.region("bottom")]}
    for name, role in scene.boundary:
        for c, given in enumerate(role.u if name != "bottom" else ()):
            if given is not None:  # symmetry: u_N = u_x of the left edge
                held[c].append(level.mesh.region(name))
    V = ngs.VectorH1(mesh, order=4, dirichletx="|".join(held[0]), dirichlety="|".join(held[1]))
    (u, v), n = V.TnT(), ngs.specialcf.normal(2)
    at = np.empty((2, mesh.ne))
    index = mesh.ngmesh.Elements2D().NumPy()["index"]
    for where, own in scene.pieces:
        names = np.array([not where or name in where for name in mesh.GetMaterials()])[index - 1]
        at[:, names] = [[own.lam], [own.mu]]
    lam, mu = (ngs.GridFunction(ngs.L2(mesh, order=0)) for _ in range(2))
    lam.vec.FV().NumPy()[:], mu.vec.FV().NumPy()[:] = at
    eps = lambda w: ngs.Sym(ngs.Grad(w))  # noqa: E731
    a = ngs.BilinearForm(
        (lam * ngs.div(u) * ngs.div(v) + 2 * mu * ngs.InnerProduct(eps(u), eps(v))) * ngs.dx
    )
    for name, k_n, k_t in scene.springs:
        push = k_n * (u * n) * (v * n) + k_t * (u * v - (u * n) * (v * n))
        a += push * ngs.ds(level.mesh.region(name))
    b = ngs.BilinearForm(u[0] * v[0] * ngs.ds(level.mesh.region("bottom")), check_unused=False)
    values, columns, starts = b.Assemble().mat.CSR()
    B = sp.csr_array((np.array(values), np.array(columns), np.asarray(starts).view(np.int64)))
    inverse = a.Assemble().mat.Inverse(V.FreeDofs(), "sparsecholesky")
    on = np.flatnonzero(np.diff(B.indptr) * np.array(list(V.FreeDofs())))
    load, found = a.mat.CreateColVector(), np.empty((len(on), len(on)))
    for i, dof in enumerate(on):  # 1/λ₁ is the largest eigenvalue of A⁻¹B
        load[:] = 0.0
        load[int(dof)] = 1.0
        found[:, i] = (inverse * load).Evaluate().FV().NumPy()[on]
    return float(1 / np.linalg.eigvals(found @ B[on][:, on].toarray()).real.max())


def scene_of(seed: int) -> str:
    rng = np.random.default_rng(seed)
    size, E = 10 ** rng.uniform(-2, 2), 10 ** rng.uniform(0, 11)
    w, h = rng.uniform(1, 4) * size, rng.uniform(0.4, 1.5) * size
    x, y = w + rng.uniform(-0.3, 0.3) * size, h * rng.uniform(0.6, 1)
    roles = {name: str(rng.choice(some)) for name, some in SUPPORTS.items()}
    if roles["right"].startswith("{role: rigid") and roles["top"].startswith(
        ("{role: rigid", "clamped")
    ):
        roles["top"] = "free"
    if (
        roles["top"] != "free"
        and roles["left"] in ("symmetry", "clamped")
        and "rigid" in roles["top"]
    ):
        roles["left"] = SUPPORTS["left"][3]
    spring = repr(E * 10 ** rng.uniform(-2, 2) / size)
    edges = ", ".join(f"{name}: {role}" for name, role in roles.items()).replace("K", spring)
    nu = rng.choice([0.0, 0.3, 0.45, 0.499, 0.4999])
    return f"""
units: none
body:
  outline: [{{from: [0, 0], edge: bottom}}, {{from: [{w}, 0], edge: right}}, {{from: [{x}, {y}], edge: top}},
            {{from: [0, {h}], edge: left}}]
  regions: {{part: {{rectangle: {{corner: [{0.2 * w}, {0.1 * h}], width: {0.4 * w}, height: {0.3 * h}}}}}}}
boundary: {{bottom: contact, {edges}}}
material: {{E: {E!r}, nu: {nu}, plane: {rng.choice(["strain", "stress"])}}}
materials: {{part: {{E: {E * 10 ** rng.uniform(-2, 2)!r}, nu: 0.3}}}}
friction: {{law: tresca, tau: {E * 0.01!r}}}
mesh: {{maxh: {h * rng.uniform(0.15, 0.6)}}}
"""


@pytest.mark.parametrize("seed", range(2, 6))
def test_the_body_lies_within_the_band(seed: int) -> None:
    ((level, scene, band),) = bands(scene_of(seed))
    if any("Rigid" in type(role).__name__ for _, role in scene.boundary):
        finest = bands(scene_of(seed), "mesh.levels=4")[-1][2]
        assert band.low <= finest.high * (1 + 1e-9)
        assert finest.low <= band.high * (1 + 1e-9)
    else:
        exact = reference(level, scene)
        assert band.low <= exact * (1 + 1e-6)
        assert exact <= band.high * (1 + 1e-6)


def test_the_band_closes_and_turns_with_the_body() -> None:
    """First order at least; the same for a body that lies on a slope."""
    found = [band for _, _, band in bands(RECTANGLE)]
    gaps = [(band.high - band.low) / band.high for band in found]
    assert gaps[0] < 0.05
    assert gaps[2] < 0.27 * gaps[0]
    turned = """
units: none
body: {outline: [{from: [0, 0], edge: bottom}, {from: [1.6, 1.2], edge: right}, {from: [1, 2], edge: top},
                 {from: [-0.6, 0.8], edge: left}]}
boundary: {bottom: contact, left: clamped, top: free, right: free}
"""
    rest = RECTANGLE[RECTANGLE.index("material") :]
    other = bands(turned + rest)[2][2]
    assert (other.low, other.hat, other.high) == pytest.approx(
        (found[2].low, found[2].hat, found[2].high), rel=2e-3
    )


def test_a_shape_has_the_constant_that_was_found() -> None:
    equilateral, low, high = shape_constants(((0.5, 0.75**0.5), (0.4, 0.5), (0.4, 0.6)))
    assert equilateral == pytest.approx(0.320, abs=5e-4)
    assert low >= high  # one lies in the other


def test_curved_edges_are_refused() -> None:
    study = study_of(HEATED_BRACKET, "mesh.levels=1")
    level = levels_of(study)[0]
    with pytest.raises(GeometryFailed, match=r"guarantee.*bore, curve"):
        Level(level.mesh, study.scenes[0], guarantee="bounds")


def test_a_round_part_is_refused_as_its_mesh_has_a_polygon() -> None:
    part = ", regions: {part: {circle: {center: [1, 0.5], radius: 0.2}}}"
    text = STABILITY.replace("height: 1}", "height: 1}" + part, 1)
    text = text.replace(", guarantee: true", "").split("sweep")[0]
    study = study_of(text)  # the part is of the same material: λ₁ does not see it
    assert study.encloses_lambda_1
    with pytest.raises(GeometryFailed, match=r"guarantee.*part"):
        Level(levels_of(study)[0].mesh, study.scenes[0], guarantee="bounds")
    assert not study_of(text + "materials: {part: {E: 5, nu: 0.3}}").encloses_lambda_1


STABILITY = """
units: none
body: {rectangle: {width: 2, height: 1}}
boundary: {bottom: contact, left: clamped, top: {role: traction, g: [0.1, 0]}, right: free}
material: {E: 1, nu: 0.3}
friction: {law: slip-weakening, tau_s: 0.1, tau_k: 0.05, delta: 0.1}
mesh: {maxh: 0.2, levels: 2, guarantee: true}
sweep: {material.nu: [0.3, 0.4999999], friction.delta: [0.065, 0.15], material.E: [1, 3]}
"""


def test_a_study_says_what_is_proved_of_the_body(tmp_path: Path) -> None:
    """At ν → ½ the mesh certifies one solution for ω = 0.77, above λ₁ = 0.4926 of the body; in
    blocks and alone."""
    found = []
    for name in (
        "separable-newton",
        "{name: [separable-newton, bundle-newton], max_iterations: 1}",
    ):
        (tmp_path / "s.yaml").write_text(STABILITY + f"solver: {name}\n")
        tree = tcstudy.run(tmp_path / "s.yaml", tmp_path / f"{len(found)}.nc")
        found.append(tree.to_dataset().load())
        trust = verdict_of(tmp_path / f"{len(found) - 1}.nc").trust
        assert trust[1] == "6 of 7 unique for the body itself"
    data, other = found
    for name in ("lambda_1_low", "lambda_1_high", "lambda_1_dual", "proved_unique"):
        np.testing.assert_allclose(data[name], other[name], rtol=1e-12)
    np.testing.assert_allclose(
        data["error_bound_relative"], other["error_bound_relative"], rtol=1e-7
    )
    assert np.all(data["lambda_1_low"] <= data["lambda_1_dual"] * (1 + 1e-9))
    at = data.sel(level=1)
    stiff = at["lambda_1_low"] / at["E"]
    assert stiff.values == pytest.approx(stiff.isel(E=0).values[..., None] * np.ones(2), rel=1e-9)
    for nu, exact in ((0.3, 0.41335), (0.4999999, 0.4926)):
        one = at.sel(nu=nu, E=1)
        assert (one["lambda_1_low"] < exact).all()
        assert (exact < one["lambda_1_high"]).all()
    proved = at["proved_unique"].sel(E=1)
    assert proved.sel(nu=0.4999999).values.tolist() == [0, 1]
    assert at["unique"].sel(nu=0.4999999, E=1).values.tolist() == [1, 1]


@pytest.mark.parametrize("levels", [1, 3])
def test_the_coarsest_mesh_bounds_the_body_by_default(tmp_path: Path, levels: int) -> None:
    """The same bounds on all levels, wherever a run begins; none with guarantee: false."""
    text = STABILITY.replace("levels: 2, guarantee: true", f"levels: {levels}")
    (tmp_path / "s.yaml").write_text(text)
    data = tcstudy.run(tmp_path / "s.yaml", tmp_path / "s.nc").to_dataset().load()
    for nu, exact in ((0.3, 0.41335), (0.4999999, 0.4926)):
        low, high = (data[f"lambda_1_{end}"].sel(nu=nu, E=1).values for end in ("low", "high"))
        assert np.all(low < exact)
        assert np.all(exact < high)
        assert np.ptp(low) == np.ptp(high) == 0.0
    assert np.all(data["proved_unique"].values == (data["omega"] < data["lambda_1_low"]).values)
    assert "error_bound" not in data
    assert data.attrs["guarantee"] == "band"
    (tmp_path / "s.yaml").write_text(text.replace("maxh: 0.2,", "maxh: 0.2, guarantee: false,"))
    assert "lambda_1_low" not in tcstudy.run(tmp_path / "s.yaml", tmp_path / "t.nc").to_dataset()


def test_a_body_with_arcs_has_the_bounds_of_its_polygon(tmp_path: Path) -> None:
    """In the names of variables and in the verdict; by default it has none."""
    text = HEATED_BRACKET + "output: {quantities: [slip_bounds]}\n"
    study = study_of(text, "mesh.levels=1", "mesh.guarantee=polygon")
    data = tcstudy.run(study, tmp_path / "s.nc").to_dataset().load()
    assert "of the polygon that the mesh has" in data["lambda_1_low"].attrs["long_name"]
    assert np.isfinite(data["error_bound"]).all()
    assert np.isfinite(data["slip_bound"]).all()
    verdict = verdict_of(tmp_path / "s.nc")
    assert "the polygon that the mesh has" in " ".join(verdict.trust)
    (note,) = (
        line for line in text_of(tmp_path / "s.nc").splitlines() if "rel. error bound: " in line
    )
    assert note.endswith("of the polygon that the mesh has")
    assert "mean slips of segments proved" in " ".join(verdict.accuracy)
    bare = tcstudy.run(study_of(HEATED_BRACKET, "mesh.levels=1"), tmp_path / "t.nc").to_dataset()
    assert "lambda_1_low" not in bare
    with pytest.raises(StudyError, match="slip_bounds follow from bounds of the error; add guar"):
        study_of(text)


def test_converges_to_the_published_value() -> None:
    """0.4162, 0.4143, 0.4136, 0.4134 for h = 0.1 … 0.0125 on the 2×1 rectangle clamped at the left
    (E = 1, ν = 0.3)."""
    study = study_of(RECTANGLE, "mesh.levels=4")
    values = np.array([level.lambda_1(study.scenes[0]) for level in levels_of(study)])
    assert np.all(np.diff(values) < 0)
    assert values == pytest.approx([0.4162, 0.4143, 0.4136, 0.4134], abs=2.5e-4)


SLANTED = """
units: none
body: {outline: [{from: [0, 0], edge: bottom}, {from: [2, 0], edge: right}, {from: [2.4, 1], edge: top},
                 {from: [0.3, 1], edge: left}]}
boundary: {bottom: contact, left: {role: traction, spring: {normal: 1}},
           right: {role: traction, spring: {normal: 1}}, top: free}
material: {E: 1, nu: 0.3}
friction: {law: tresca, tau: 1}
mesh: {maxh: 0.3}
"""


def test_stiff_springs_cost_no_more_digits_than_is_said() -> None:
    """Springs across slanted edges: beyond 1e8 λ₁ changes by less than 1e-7, all else is
    rounding."""
    found = {}
    for k in (1e8, 1e10, 1e11, 1e12, 1e13):
        springs = (f"boundary.{edge}.spring.normal={k!r}" for edge in ("left", "right"))
        study = study_of(SLANTED, *springs)
        level = levels_of(study)[0]
        found[k] = level.lambda_1(study.scenes[0]), level.condensed(study.scenes[0]).problem.A_error
    reference, error = found[1e8]
    assert error < 1e-7
    for value, error in found.values():
        assert abs(value / reference - 1.0) <= error + 1e-7
    assert found[1e12][1] > 1e-6
    assert abs(found[1e13][0] / reference - 1.0) > 1e-6


def test_proofs_do_not_lean_on_lost_digits() -> None:
    """One node, λ₁ = 1: a film that falls by 0.99 is proved unique only where λ₁ is known to 1
    %."""
    law, load = slip_weakening(1.0, 0.01, 1.0), np.array([1.005])
    for error, unique in ((0.0, True), (1e-3, True), (0.02, False)):
        problem = ContactProblem(np.array([[1.0]]), load, np.ones(1), law, error)
        proof = certify(problem, np.zeros(1), 1.0)
        body = CondensedBody.of(np.array([[1.0]]), np.ones(1), error)
        laws = Laws.of([law], np.zeros((1, 1)))
        block = solve_block(body, load[None], laws).certificate
        assert proof.convex == block.convex[0] == unique
        assert proof.unique == block.unique[0] == unique
        assert (proof.lambda_1_error, proof.margin > 0.0) == (error, unique)


def test_eigenpair_of_a_stiffness_with_contrast() -> None:
    """Ã = Q diag(1, 1e13, …) Qᵀ with its digits: the residual tells what the eigenvalue solver
    loses."""
    Q = np.linalg.qr(np.random.default_rng(1).normal(size=(6, 6)))[0]
    A = (Q * 10.0 ** np.array([0, 13, 13, 12, 12, 13])) @ Q.T
    A = 0.5 * (A + A.T)
    value, _, error = least_eigenpair(A, np.ones(6))
    exact = 1.0 / np.linalg.eigvalsh(np.linalg.inv(A))[-1]
    assert abs(value - exact) <= 2.0 * error * value
    assert error > 1e-6
    assert least_eigenpair(np.diag([2.0, 3.0]), np.ones(2))[2] <= 1e-15
