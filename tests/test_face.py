"""`import rds` offers what a person types in a notebook, flat, and nothing else."""

from __future__ import annotations

import ast
import inspect
import json
from importlib import import_module
from pathlib import Path

import control
import numpy as np
import pytest
import scipy.signal
from documents import ROOT, blocks

import rds
import rds.references

TAU, K = 9.943e-3, 1.764


def test_what_there_is() -> None:
    assert dir(rds) == sorted(rds.__all__)
    assert 38 <= len(rds.__all__) <= 56
    for name in rds.__all__:
        thing = getattr(rds, name)
        assert name == "__version__" or (inspect.getdoc(thing) or "").strip(), f"rds.{name} has no docstring"
    assert rds.__version__.startswith("0.")


def test_each_kind_of_signal_is_there() -> None:
    assert set(rds.references.signal_kinds()) <= set(dir(rds))
    reference = rds.speed([[0.0, 2.0], [1.0, 2.0], [2.0, 0.0]]).reference(1.5)
    assert (reference.position, reference.velocity) == pytest.approx((2.75, 1.0))  # mm, mm/s


def test_an_unknown_name_says_where_to_look() -> None:
    with pytest.raises(AttributeError, match=r"no attribute 'simulate'; dir\(rds\)"):
        rds.simulate  # noqa: B018


DOCUMENTS = ["README.md", *(f"docs/{path.name}" for path in sorted((ROOT / "docs").glob("*.md")))]
NOTEBOOKS = [f"notebooks/{path.name}" for path in sorted((ROOT / "notebooks").glob("*.ipynb"))]


@pytest.mark.parametrize("document", DOCUMENTS + NOTEBOOKS)
def test_documents_import_from_the_face_or_from_a_room(document: str) -> None:
    """`import rds` and `from rds.nc import line`: no deeper, and what the face has comes from the face."""
    for module, name in _imported(document):
        assert module.count(".") <= 1, f"{document} imports {module}: offer it by rds/__init__.py, or by its room's"
        assert module == "rds" or name not in rds.__all__, f"{document} imports rds.{name} from {module}"
        thing = getattr(import_module(module), name) if name else import_module(module)
        assert thing is not None


def test_an_unknown_name_of_a_room_says_what_it_offers() -> None:
    with pytest.raises(ImportError):
        from rds.nc import no_such_name  # noqa: F401
    with pytest.raises(AttributeError, match=r"no attribute 'no_such_name'; it offers circle_error, synchronized"):
        import_module("rds.network").no_such_name  # noqa: B018


def _imported(document: str) -> list[tuple[str, str]]:
    """The modules of rds that the code of a document imports, each with the name that it takes from there."""
    if document.endswith(".ipynb"):
        cells = json.loads((ROOT / document).read_text(encoding="utf-8"))["cells"]
        code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    else:
        code = [block.text for block in blocks(document) if block.language == "python"]
    found = []
    for text in code:
        if text.startswith("%%"):
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Import):
                found += [(alias.name, "") for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                found += [(str(node.module), alias.name) for alias in node.names]
    return [(module, name) for module, name in found if module.partition(".")[0] == "rds"]


class TestAModelAlone:
    times = np.arange(0.0, 0.2, 0.001)
    voltage = 3.0 * np.sign(np.sin(40.0 * times))

    def test_as_scipy_s_lsim(self) -> None:
        def derivatives(t, x, u, params):  # type: ignore[no-untyped-def]
            return [x[1], (params["K"] * u[0] - x[1]) / params["tau"]]

        model = {"derivatives": derivatives, "params": {"tau": TAU, "K": K}}
        _, y, x = rds.lsim(model, self.voltage, self.times)
        _, expected, states = scipy.signal.lsim(
            ([[0, 1], [0, -1 / TAU]], [[0], [K / TAU]], [[1, 0]], [[0]]), self.voltage, self.times, interp=False
        )
        assert np.abs(y - expected).max() < 1e-8
        assert np.abs(x - states).max() < 1e-6

    def test_a_python_control_system_and_a_first_state(self) -> None:
        system = control.ss([[0, 1], [0, -1 / TAU]], [[0], [K / TAU]], [[1, 0]], [[0]])
        _, y, x = rds.lsim(system, 0.0, self.times, X0=[1.0, 20.0])
        assert np.abs(y - (1.0 + 20.0 * TAU * (1.0 - np.exp(-self.times / TAU)))).max() < 1e-8
        assert x.shape == (len(self.times), 2)

    def test_the_axis_of_a_machine_with_other_parameters(self) -> None:
        _, _, slow = rds.lsim("linear-axis", 5.0, self.times)
        _, _, fast = rds.lsim("linear-axis", 5.0, self.times, params={"K": 2 * K})
        assert fast[-1, 1] > slow[-1, 1] > 0.0

    @pytest.mark.parametrize(
        ("arguments", "said"),
        [
            ({"U": [1.0, 2.0], "T": times}, r"U has the shape \(2,\)"),
            ({"U": 1.0, "T": [0.0, 0.1, 0.3]}, "not at equal distances"),
            ({"U": 1.0, "T": [0.0]}, "two times or more"),
            ({"U": 1.0, "T": times, "X0": [1.0]}, r"X0 = \[1.0\] does not fit; give 2 finite numbers"),
            ({"U": 1.0, "T": times, "X0": [np.nan, 0.0]}, r"X0 = \[nan, 0.0\] does not fit; give 2 finite numbers"),
            ({"U": 1.0, "T": times, "X0": ["here", 0.0]}, "X0 = .* is not made of real numbers"),
            ({"U": 1.0 + 1.0j, "T": times}, "U = .* is not made of real numbers"),
            ({"U": np.full(len(times), 1.0 + 1.0j), "T": times}, "real numbers: it has the type complex128"),
            ({"U": 1.0, "T": ["now", "then"]}, "T = .* is not made of real numbers"),
            ({"U": 1.0, "T": np.arange(3).astype("datetime64[ms]")}, r"it has the type datetime64\[ms\]"),
            ({"U": 1.0, "T": times, "params": {"mass": 1.0}}, "no parameter 'mass'; it has"),
        ],
    )
    def test_what_is_refused(self, arguments: dict[str, object], said: str) -> None:
        with pytest.raises(rds.InputError, match=said):
            rds.lsim("linear-axis", **arguments)

    def test_a_system_of_scipy_is_refused_with_the_way_out(self) -> None:
        with pytest.raises(rds.InputError, match=r"a python-control system, .*scipy\.signal make one by control\.ss"):
            rds.lsim(scipy.signal.lti([K], [TAU, 1, 0]), 1.0, self.times)


def test_what_a_notebook_shows_of_each_thing_is_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("part.ngc").write_text("G21 G90\nG1 X2 Y1 F600\nM2\n")
    experiment = rds.Experiment(signal=rds.chirp(3.0, 0.5, 5.0, 2.0), duration=2.0)
    experiment.run(out="run")
    (log,) = rds.read_log("run")
    estimate = rds.fit(log, "axis")
    rds.write_model("fitted.toml", estimate)
    loop = rds.Experiment(axis=["X", "Y"], reference=rds.sinusoid(1.0, 2.0), controller="pid", duration=0.5)
    study = rds.robustness(loop, 4, ranges={axis: {"tau": (0.009, 0.011)} for axis in "XY"})
    machine = rds.load_machine("mini-cnc")
    design, file = rds.design("fitted.toml"), rds.read_model("fitted.toml")
    shown = {
        repr(machine): "<Machine mini-cnc: X in mm, Y in mm, Z in mm, spindle in rev/min; 0.001 s>",
        repr(machine.kinematics): "<Kinematics mini-cnc: X -75 to 75 mm, Y -75 to 75 mm, Z -50 to 50 mm>",
        repr(experiment): "<Experiment: simulation of X on mini-cnc, 2 s>",
        repr(loop): "<Experiment: simulation of X, Y on mini-cnc, 0.5 s>",
        repr(rds.PartProgram("part.ngc")): "<PartProgram part.ngc on mini-cnc: X, Y",
        repr(rds.sinusoid(1.0, 2.0)): "<Signal sinusoid: amplitude = 1, frequency = 2, offset = 0, phase = 0>",
        repr(rds.library_model("linear-axis", tau=TAU, K=K)): "<Model linear-axis: friction_plus = 0, ",
        repr(design): "<Controller tracking: g1 = 1600, ",
        repr(log): "<Log run: 2000 samples in 1.999 s, command in V, position in mm",
        repr(rds.structure("axis")): "<Structure axis: tau, K, friction_plus, friction_minus>",
        repr(estimate): "<Estimate of axis by simulation: tau = 0.0099",
        repr(file): "<ModelFile fitted.toml of axis: tau = 0.0099",
        repr(rds.frequency_response(log)): "<FrequencyResponse: ",
        repr(rds.interpolate(rds.LineSegment((0.0, 0.0), (2.0, 0.0), 10.0), 1e-3, "linear")): "<Interpolation of 1 ",
        repr(rds.interpolator("tustin")): "<Interpolator tustin: blu = 0.01, steps = 0>",
        repr(rds.learn(loop, 2)): "<Learned in 2 trials: RMS of the tracking error of X from ",
        repr(study): "<Study of X, Y: 4 runs of 0.5 s, seed 0, 0 unstable, 0 not run>",
    }
    for text, expected in shown.items():
        assert text.startswith(expected) and len(text) < 250 and "0x" not in text and "\n" not in text
    assert "  tau = 0.0099" in str(estimate) and "free run: fit 9" in str(estimate)
    assert "rank correlation" in study._repr_html_()
    (tmp_path / "law.py").write_text("def control(t, r, y, state, params):\n    return 0.0, state\n")
    assert repr(rds.check_file("law.py")).startswith("law.py: the controller keeps its interface")
