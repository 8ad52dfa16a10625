"""A walk through tcstudy from Python; each step ends in one number, and all of them take a few
seconds.

Run it with `python tests/walkthrough.py`, or cell by cell in an editor or notebook (`# %%` begins
one); the tests run it, too.
"""

import tempfile
from pathlib import Path

import numpy as np
import xarray as xr

import tcstudy

FOLDER = Path(tempfile.mkdtemp())

# %% 1. A study as a mapping: a block on a weakening film, its top pushed sideways. Numbers are SI.
study = tcstudy.Study.from_dict(
    {
        "title": "A block pushed sideways",
        "body": {"rectangle": {"width": 2, "height": 1}},
        "boundary": {"bottom": "contact", "top": {"role": "clamped", "u_x": 2e-3, "u_y": 0},
                     "left": "free", "right": "free"},
        "material": {"E": "100 MPa", "nu": 0.3},
        "friction": {"law": "slip-weakening", "tau_s": "50 kPa", "tau_k": "20 kPa", "delta": "1 mm"},
        "mesh": {"maxh": 0.5, "levels": 2},
    }
)  # fmt: skip
forecast = tcstudy.plan(study)
print("points of a run", forecast.points)
assert forecast.points == 1

# %% 2. Another study with one value changed: the same film, twice as tough, and no film at all.
tougher = study.with_(friction_delta="2 mm")
assert tougher.scenes[0].friction.omega == 0.5 * study.scenes[0].friction.omega
sweep = study.with_({"sweep": {"tau_k": [5e3, 20e3, 50e3]}})
print("points of the sweep", len(sweep.scenes))
assert len(sweep.scenes) == 3

# %% 3. Run it: the answer, and its data. Every solution passes the inclusion test, or says why not.
result = tcstudy.run(sweep, FOLDER / "block.nc", jobs=1)
print(result.summary)
residual = float(result["inclusion_residual"].max())
print("largest inclusion residual", residual)
assert residual <= 1e-10
table = result.to_dataframe()  # a row a point and level
assert table["energy"].notna().all()
result.draw(
    FOLDER / "block.svg", x="tau_k", y="slip_length"
)  # without a name the notebook shows it

# %% 4. Files of other values, joined and compared by xarray.
one, two = FOLDER / "block.nc", FOLDER / "more.nc"
tcstudy.run(study.with_({"sweep": {"tau_k": [20e3, 40e3]}}), two, jobs=1)
with xr.open_dataset(one) as a, xr.open_dataset(two) as b:
    whole, (shared, again) = a.combine_first(b), xr.align(a, b, join="inner")
print("points of both", whole["tau_k"].values)
assert whole["energy"].notnull().all()
assert np.allclose(shared["energy"], again["energy"], rtol=1e-9)

# %% 5. Matrices of your own: a softening spring under one mass, in units of your choice.
problem = tcstudy.ContactProblem(
    [[1.0]], [1.2], [1.0], tcstudy.law("slip-weakening", tau_s=1.0, tau_k=0.0, delta=4.0)
)
answer = tcstudy.solve(problem)
print("slip", answer.v[0])  # v + (1 − v/4) = 1.2
assert np.isclose(answer.v[0], 4 / 15, rtol=1e-12)

# %% 6. Its certificate: the film softens by 1/4 per length, less than λ₁ = 1.
certificate = tcstudy.certify(problem, answer)
print("margin to uniqueness", certificate.margin)
assert certificate.unique
assert np.isclose(certificate.margin, 0.75, rtol=1e-12)

# %% 7. A brittle film, twice: equilibria on the branch from rest, through the fold where it lets go.
brittle = tcstudy.ContactProblem([[1.0]], [0.0], [1.0], tcstudy.law(points=[(0, 1), (0.5, 0)]))
along = tcstudy.follow(brittle, [1.0], [0.0], t_max=2.0, direction="forward")
print("load at the fold", along.t[1])
assert np.isclose(along.t[1], 1.0, rtol=1e-12)
assert not along.stable.all()

# %% 8. What cannot be is refused in one line.
try:
    tcstudy.ContactProblem([[1.0, 2.0], [2.0, 1.0]], [0, 0], [1, 1], tcstudy.law("tresca", tau=1.0))
except tcstudy.UserFault as fault:
    said = str(fault)
print(said)
assert said.startswith("A_tilde is not positive definite (smallest eigenvalue -1.0e+00")
