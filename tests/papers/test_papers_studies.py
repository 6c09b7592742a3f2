"""What every study must be, run with few seeds: whole, in both languages, moved by its seed, and the same from one."""

import re
from importlib import import_module
from typing import NamedTuple

import numpy as np
import pytest
import scipy.stats  # noqa: F401  (it draws without a seed as it is imported)

from plumbob import simulate_chain
from plumbob.arm import JointTrack, replay, taught
from plumbob.core.errors import ParameterError
from plumbob.papers.description import Description
from plumbob.papers.reproduce import reproduce
from plumbob.papers.studies import Study, errors_deg, largest, rms
from plumbob.rotations import quat_from_euler_zyx
from tests.helpers import slow_as_python
from tests.helpers.papers import by_key, english_alone, named, unmet

pytestmark = slow_as_python


class Short(NamedTuple):
    """A study that is run shortly: with what, which bars need all seeds, and names without Chinese.

    `fixed`: figures that a seed need not move: shares of few seeds, and of samples that all pass.
    """

    how: dict
    unmet: set
    fixed: str
    names: str


SHORT = {
    "rod": Short(
        {"seeds": 1, "duration": 404.0, "booms": 1}, set(),
        r"(live|chain)\..*|boom\.late|(fused|ideal)\.(kept|causal|hard_reset|narrow.*)",
        r"ADIS16355|AHRS500GA|AHRS|ekf7|mekf|mahony|vqf|[Pp]lumbob|RS232|SPI|atan2",
    ),
    "trackball": Short(
        {"seeds": {"short": 3, "white": 1, "long": 1, "table": 2, "part": 2}, "long_seconds": 7200.0,
         "soak_seconds": 900.0, "gains": [0.5, 0.6, 0.7]},
        {"allan.ratio.50", "allan.long.100", "allan.long.600", "allan.angle", "noise.flicker", "noise.white",
         "rest.variance.q6"},
        r"fit\.negative|live\.same", r"plumbob .*|solid.*|dashed.*|dotted.*|scalar.*|Q/R.*",
    ),
    "arm": Short(
        {"seeds": 2, "few": 1, "faults": 1, "hours": 0.02},
        {"recovery.control"}
        | {f"{case}.{figure}.{axis}" for case in ("static", "turn") for axis in ("roll", "pitch", "yaw")
           for figure in ("fuzzy", "two", "pi_over_none", "fuzzy_over_pi")},
        r"fault\..*|parity\..*|teach\..*|live\.same",
        r"EKF|PI|Plumbob|Mamdani|Hz|rad|det|Ts|MPU|HMC|plumbob.*|read_array|mounts|array|paper|filters|sets_of|run|law|"
        r"start|tilt_compass|fuzzy_pi|error_of|regulate|combine|ekf_quaternion|rotations|euler_zyx_from_quat|q_bs|arm|"
        r"align|export|replay|program|csv|teach|mg|nT|µT|Kp|Ki",
    ),
    "fin": Short(
        {"swims": 1, "length": 22.0, "records": 6, "runs": 3},
        {"three.Q.cover", "three.N.cover", "three.B.cover", "three.B.bias", "three.B.scatter", "swim.inside"},
        r"live\..*|text\.lost|swim\.inside|clip\.(missed|share)|three\..*\.cover",
        r"plumbob .*|0xFFFF.*|ADXRS\d+ [xyz]|ADXRS\d+|\d+[xyz]|σ.*|/\(πfT\)²?|f ≤ f0?",
    ),
    "buoy": Short(
        {"units": 2, "slides": 1, "seas": 1, "captures": 1, "duration": 70.0},
        {"slide.reduction.roll", "slide.reduction.pitch", "sea.roll", "sea.pitch", "sea.unit.roll", "sea.unit.pitch"},
        r"static\.share|refused\..*|line\.rate|events\.missed|log\.same|sea\.output|live\.same",
        r"plumbob .*|filters/.*|calibration/.*|(solid|dashed|dotted).*|arctan|atan2|C#|Plumbob|Flash|Matlab|\w+\.html$"
        r"|PS-MPU.*|assumed.*|MSP430.*|0\.29 mA.*|LPM3.*|serial NOR.*",
    ),
}  # fmt: skip


def true_teach_in(study):
    """What the simulator has of a teach-in: one through bytes costs 15 s."""
    sim = simulate_chain("teach", "teach", frame="NWU", sensors="ideal", unit="calibrated", seed=1, duration="12 s")
    joints = JointTrack(sim.t, sim.chain.angles, sim.angles, hand=sim.hand_n)
    program = taught(joints, sim.chain, rate="100 Hz")
    study.rows({f"teach.{key}": (None, 0.4) for key in ("mounts", "claim")}, all=0.4, rest=0.4)
    study.values |= {"mounts_deg": 3.0, "files": "program.csv"}
    return sim.chain, joints, joints, program, replay(program, sim.chain), 0.0


KINDS = ("text", "texts", "table", "figure")


def watched(kind, used):
    """What a description has of a kind, noted by its key."""
    original = getattr(Description, kind)

    def noted(self, key, *args, **how):
        used.add((kind, key))
        return original(self, key, *args, **how)

    return noted


def run(name, folder, seed):
    folder.mkdir(parents=True)
    study = Study(name, folder, seed)
    import_module(f"plumbob.papers.{name}").measure(study, **SHORT[name].how)
    study.save("today, 1 s")
    return study.paper()


@pytest.mark.parametrize("name", SHORT)
def test_a_study_is_whole_in_both_languages_and_moved_by_its_seed_alone(name, tmp_path, monkeypatch):
    monkeypatch.setattr("plumbob.papers.arm.teach", true_teach_in)
    draws = np.random.default_rng

    def seeded(seed):
        assert seed is not None
        return draws(seed)

    monkeypatch.setattr(np.random, "default_rng", seeded)
    used = set()
    for kind in KINDS:
        monkeypatch.setattr(Description, kind, watched(kind, used))
    paper = run(name, tmp_path / "1" / name, 1)
    monkeypatch.setattr(Study, "live", lambda *_: 100.0)  # once is enough: that a line equals its file has its own bar
    same, other = (run(name, tmp_path / folder / name, int(folder[0])) for folder in ("1 again", "2"))
    assert [one.summary() for one in same.outcomes] == [one.summary() for one in paper.outcomes]
    content = Study(name, tmp_path).description.content
    assert {(kind, key) for kind in KINDS for key in content.get(kind, ())} <= used
    outcomes = by_key(paper.outcomes)
    assert unmet(outcomes.values()) <= SHORT[name].unmet
    assert named(Study(name, tmp_path).description.items) <= outcomes.keys()
    assert english_alone(paper.report, SHORT[name].names) == set()
    page = paper.report.write_html(tmp_path / "page.html").read_text(encoding="utf-8")
    assert page.count("<figure>") >= 2
    assert name != "arm" or [n for n in range(1, 10) if f"Figure {n}: " not in page] == []
    pairs = zip(paper.outcomes, other.outcomes, strict=True)
    stay = {
        a.key for a, b in pairs if (a.faithful, a.best) == (b.faithful, b.best) and not a.by.startswith("arithmetic")
    }
    assert {key for key in stay if not re.fullmatch(SHORT[name].fixed, key)} == set()
    pages_are_made_of_what_a_run_kept(name, tmp_path / "1", paper)


def pages_are_made_of_what_a_run_kept(name, folder, paper):
    """A run that ended before its pages goes on from what it kept, in any language, and with its own seed alone."""
    (folder / "outcomes.json").write_text('{"seed": 1, "papers": {}}', encoding="utf-8")
    done = reproduce(name, out=folder)
    assert [one.summary() for one in done.outcomes[name]] == [one.summary() for one in paper.outcomes]
    reproduce(render=folder / "outcomes.json", lang="zh")
    with pytest.raises(ParameterError, match="takes no out"):
        reproduce(render=folder / "outcomes.json", out=folder)
    made = Study.restored(name, folder / name).paper().report
    for lang, ending in (("en", "html"), ("zh", "zh.html")):
        assert made.page(lang=lang) == paper.report.page(lang=lang)
        page = (folder / f"{name}.{ending}").read_text(encoding="utf-8")
        assert f"plumbob reproduce {name} --seed 1" in page and "today, 1 s" in page and f"index.{ending}" in page
        assert (folder / f"index.{ending}").read_text(encoding="utf-8").count("<figure>") == 1
    with pytest.raises(ParameterError, match="not of a run of this seed"):
        reproduce(name, out=folder, seed=2)


def test_a_figure_that_is_not_measured_is_told_and_errors_are_angles(tmp_path):
    with pytest.raises(ParameterError):
        Study("rod", tmp_path).paper()
    q = quat_from_euler_zyx(np.array([[0.3, 0.2, 0.1], [0.0, 0.0, 0.0]]))
    e = errors_deg(q, quat_from_euler_zyx(np.zeros((2, 3))))
    assert e[0] == pytest.approx(np.degrees([0.3, 0.2, 0.1]))
    assert largest(e).tolist() == e[0].tolist()
    assert rms(np.array([3.0, 4.0, 0.0, 0.0])) == 2.5
