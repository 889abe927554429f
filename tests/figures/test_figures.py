"""Every picture is built for a Kaplan-type machine, a point mass and a machine without a fold, and
read back.
"""

import io
import math
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import matplotlib
import numpy as np
import pytest
from matplotlib import pyplot
from PIL import Image

from hydrolab import (
    CentralDifference,
    HarmonicBalance,
    Schedule,
    follow,
    integrate,
    load_machine,
    load_rejection,
    rpm,
    run,
)
from hydrolab.dynamics.harmonics import ellipse
from hydrolab.dynamics.modes import modes
from hydrolab.errors import BadInput
from hydrolab.figures.drawing import REVOLUTION
from hydrolab.figures.jumps import hysteresis_picture
from hydrolab.figures.orbits import branch_picture, curve, draw_branch, orbit_picture
from hydrolab.figures.orders import run_picture, waterfall_picture
from hydrolab.figures.paper_figures import (
    figure_3,
    figure_6,
    figure_7,
    first_leg,
    study_pictures,
)
from hydrolab.figures.picture import Picture
from hydrolab.figures.readings import microns, percent, reading, verdicts
from hydrolab.figures.rotor import on_page
from hydrolab.figures.style import COLOURS, LINES, new_figure
from hydrolab.machine.parts import AirGap, Machine, RadialBearing, RigidBody
from hydrolab.paper.calibration import build
from hydrolab.paper.study import run_study

ROOT = Path(__file__).resolve().parents[2]
FREE = {"generator_mass": 64563.7, "generator_gyration": 0.720158, "generator_shape": 0.621429,
        "turbine_mass": 51240.7, "turbine_gyration": 1.41455, "turbine_shape": 0.739282,
        "turbine_offset": 0.657759,
        "thrust_depth": 4.38749, "turbine_bearing_depth": 8.51827, "unbalance_share": 0.706394,
        "unbalance_phase": 0.437807}


def point_mass(stiffness: float, field: float = 0.5) -> Machine:
    damping = 0.02 * math.sqrt(stiffness * 1.5e5)
    return Machine("point mass", rpm(150), None,
                   (RigidBody("disc", 0, 1.5e5, 0.0, 0.0, unbalance=55.0),),
                   (RadialBearing("springs", 0, stiffness, damping),),
                   air_gap=AirGap("disc", field, 2.9945, 0.97, 0.011))


MACHINES = {"kaplan": build(FREE, 0.945331, 121.701), "point mass": point_mass(2.7e8),
            "no fold": point_mass(2e9, field=0.02)}


@pytest.fixture(scope="module")
def studies():
    return {name: run_study(machine, revolutions=60, ramp=20) for name, machine in MACHINES.items()}


@pytest.fixture(scope="module")
def pictures(studies):
    made = {}
    for name, study in studies.items():
        stability = study.stability
        made[name] = study_pictures(study) | {
            "orbit": orbit_picture(study.orbits[8.8]),
            "branch": branch_picture(study.branch, stability),
            "branch without stability": branch_picture(study.natural)}
    return made


@pytest.fixture(params=MACHINES)
def machine_name(request):
    return request.param


def test_the_cases_are_what_they_are_called(studies):
    assert studies["kaplan"].branch.folds and studies["kaplan"].scale == 1
    assert studies["point mass"].branch.folds and studies["point mass"].scale != 1
    assert not studies["no fold"].branch.folds


def test_axes_have_units_and_amplitudes_say_how_they_are_counted(pictures, machine_name):
    for name, picture in pictures[machine_name].items():
        shared = picture.figure.get_supxlabel()
        labels = [shared] if shared else []
        for axes in picture.figure.axes:
            if axes.get_xlabel() == "" and axes.xaxis.get_tick_params().get("labelbottom", True):
                assert shared, f"{name}: an axis with numbers and no label"
            labels += [axes.get_xlabel(), axes.get_ylabel()]
        labels = [label for label in labels if label]
        assert labels
        for label in labels:
            assert re.search(r", (mm|µm|m|s|% of the gap)\b|^revolutions",
                             label), f"{name}: {label!r} has no unit"
            assert "amplitude" not in label or "0-to-peak" in label


def test_orbits_keep_their_shape_and_turn_with_the_spin(pictures, machine_name):
    for name, picture in pictures[machine_name].items():
        for axes in picture.figure.axes:
            if "z" in axes.get_ylabel() and "mm" in axes.get_ylabel() and name != "figure-4":
                assert axes.get_aspect() == 1, name
                assert np.diff(axes.get_xlim()) > 0 and np.diff(axes.get_ylim()) > 0, name


def test_forward_whirl_is_clockwise_on_the_page(studies):
    picture = orbit_picture(studies["kaplan"].orbits[0.0])
    x, z = picture.figure.axes[0].lines[0].get_data()
    assert np.sum(x[:-1] * np.diff(z) - z[:-1] * np.diff(x)) < 0
    arrow = next(t for t in picture.figure.axes[0].texts if t.arrow_patch)
    (x0, z0), (x1, z1) = arrow.xyann, arrow.xy
    assert x0 * z1 - z0 * x1 < 0


def test_pictures_say_their_reading(pictures, machine_name):
    for name, picture in pictures[machine_name].items():
        assert repr(picture) == picture.reading
        assert picture.reading.endswith(".") and not re.search(r"\d\.\d{5}|nan|inf\b|e-\d",
                                                               picture.reading), name


def test_a_notebook_gets_a_figure_with_alt_text_and_caption(pictures):
    for name in ("figure-3", "branch"):
        picture = pictures["kaplan"][name]
        bundle = picture._repr_mimebundle_()
        assert bundle["text/plain"] == picture.reading
        page = ElementTree.fromstring(bundle["text/html"])
        assert page.tag == "figure"
        assert page.find("img").get("alt") == page.find("figcaption").text == picture.reading
        assert page.find("img").get("src").startswith("data:image/webp;base64,")


def test_every_picture_can_be_drawn(pictures):
    for name in ("figure-5", "figure-7", "figure-8", "branch"):
        for machine in ("point mass", "no fold"):
            pictures[machine][name].figure.canvas.draw()


def test_a_palette_keeps_the_colours_of_the_house(studies):
    picture = figure_3(studies["kaplan"])
    few = Image.open(io.BytesIO(picture.png()))
    assert few.mode == "P" and few.info["Description"] == picture.reading
    full = np.asarray(few.convert("RGB"))
    assert (full[0, 0] == 255).all()
    for name in ("harmonic balance", "stator"):
        wanted = [int(COLOURS[name][i:i + 2], 16) for i in (1, 3, 5)]
        assert abs(full.astype(int) - wanted).sum(axis=2).min() <= 6, name


def test_words_of_a_reading_are_escaped():
    picture = Picture(new_figure(1, 1), 'less < more & "said" it\'s')
    assert ElementTree.fromstring(picture._repr_html_()).find("img").get("alt") == picture.reading


def test_files_carry_the_reading_and_nothing_of_the_day(studies, tmp_path):
    first, second = figure_3(studies["kaplan"]), figure_3(studies["kaplan"])
    png = first.png()
    assert png == first.png() == second.png()
    assert b"Software" not in png and b"Description" in png
    svg = first.svg()
    assert svg == second.svg()
    assert b"dc:date" not in svg
    title = ElementTree.fromstring(svg).find("{http://www.w3.org/2000/svg}title")
    assert title.text == first.reading
    assert first.save(tmp_path / "orbit.png").read_bytes() == png
    assert first.save(str(tmp_path / "orbit.SVG")).read_bytes() == svg
    with pytest.raises(BadInput, match="pdf"):
        first.save(tmp_path / "orbit.pdf")


def test_readings_hold_the_numbers_of_the_result(studies, pictures, machine_name):
    study, made = studies[machine_name], pictures[machine_name]
    orbit, last = study.orbits[8.8], study.orbits[8.9]
    assert f"{1e3 * orbit.smallest_gap:.3f} mm of 11.000 mm" in made["figure-3"].reading
    assert f"1X is {microns(np.hypot(*orbit.coefficients[0, 1:3]))} in x" in made["orbit"].reading
    times, path = study.check.last(3)
    apart = np.abs(orbit.positions(study.speed * times) - path).max(axis=1)
    x, z = map(microns, apart)
    assert f"at most {x} in x and {z} in z" in made["figure-4"].reading
    ratio = np.hypot(*last.coefficients[0, 1:3]) / np.hypot(*study.orbits[0.0].coefficients[0, 1:3])
    assert f"{ratio:.2f} times that at 0 %" in made["figure-5"].reading
    ratio, at = ellipse(last.coefficients).ratio, percent(study.eccentricity(8.9))
    assert f"{ratio:.2f} at {at}" in made["figure-6"].reading
    assert microns(math.hypot(*last.mean)) in made["figure-7"].reading
    for fold in study.branch.folds:
        assert percent(fold.value, 4) in made["figure-8"].reading
        assert percent(fold.value, 4) in made["branch"].reading
    if not study.branch.folds:
        assert "followed no further" in made["figure-8"].reading
        assert "no fold" in made["figure-8"].reading and "no fold" in made["branch"].reading
    if not study.beyond.finished:
        assert f"after {study.beyond.stopped.split(' after ')[1][:4]}" in made["figure-8"].reading


def test_percentages_are_those_of_the_machine(studies, pictures):
    study = studies["point mass"]
    titles = [axes.get_title() for axes in pictures["point mass"]["figure-6"].figure.axes]
    assert percent(study.eccentricity(8.9)) in titles and "8.9 %" not in titles


def test_the_first_leg_ends_at_the_fold_without_a_jump(studies, machine_name):
    study = studies[machine_name]
    leg = first_leg(study)
    values = np.array([orbit.static_eccentricity for orbit in leg])
    assert (np.diff(values) > 0).all() and len(leg) > 150
    assert max(orbit.residual for orbit in leg) < 1e-9 * leg[0].equations.force
    first = np.array([orbit.amplitudes[0, 0] for orbit in leg])
    assert np.abs(np.diff(first)).max() < (0.08 if study.branch.folds else 0.2) * np.ptp(first)


def test_the_smooth_curve_turns_at_the_folds(studies):
    branch = studies["kaplan"].branch
    smooth = curve(branch)
    eccentricity, coefficients = smooth(smooth.at_points)
    np.testing.assert_allclose(eccentricity, branch.static_eccentricity, atol=1e-14)
    np.testing.assert_allclose(coefficients, branch.coefficients, atol=1e-14)
    slope = smooth.spline(smooth.at_folds, 1)[:, 0]
    np.testing.assert_allclose(slope, 0, atol=1e-3)
    np.testing.assert_allclose(smooth(smooth.at_folds)[0], [fold.value for fold in branch.folds],
                               atol=1e-14)


def test_stable_is_solid_and_ends_at_the_fold(studies):
    study = studies["kaplan"]
    axes = new_figure(4, 3).subplots()
    stability = study.stability
    draw_branch(axes, study.branch, lambda c: np.hypot(c[:, 0, 1], c[:, 0, 2]), stability)
    first, second, *_ = axes.lines
    assert (first.get_color(), first.get_linestyle()) == (COLOURS["stable"], LINES["stable"])
    assert (second.get_color(), second.get_linestyle()) == (COLOURS["unstable"], LINES["unstable"])
    assert first.get_xdata()[-1] == pytest.approx(100 * study.branch.folds[0].value, abs=1e-9)
    assert np.array_equal(second.get_xydata()[0], first.get_xydata()[-1])
    words = verdicts(study.branch, stability)
    assert set(words[study.branch.first_leg]) == {"stable"}
    assert words[study.branch.folds[0].after + 1] == "unstable"


def test_the_rotor_hangs_down_and_its_bodies_sit_on_their_links(studies, pictures):
    study = studies["kaplan"]
    for p in (1.0, 8.9):
        orbit = study.orbits[p]
        np.testing.assert_allclose(orbit.body_coefficients(study.machine.body("generator")),
                                   orbit.coefficients, atol=1e-10)
    panels = pictures["kaplan"]["figure-7"].figure.axes[:4]
    for axes in panels:
        bottom, top = axes.get_ylim()
        assert bottom > 9.04 > 0 > -0.472 > top
    assert len({axes.get_xlim() for axes in panels}) == len({axes.get_ylim()
                                                             for axes in panels}) == 1
    names = [label.get_text() for label in panels[-1].child_axes[0].get_yticklabels()]
    assert names == ["generator", "generator guide bearing", "thrust bearing", "turbine guide "
                     "bearing", "turbine"]
    factor = int(re.search(r"drawn (\d+) times",
                           pictures["kaplan"]["figure-7"].figure.get_suptitle())[1])
    x, y = on_page(np.array([[1e-3], [0.0]]), 2.0, factor)
    assert (x[0], y[0]) == (pytest.approx(1.0), 2.0)
    # +z is drawn upwards, as seen from above
    assert on_page(np.array([[0.0], [1e-3]]), 2.0, factor)[1][0] < 2.0


def test_a_point_has_orbits_only(studies):
    figure = figure_7(studies["point mass"]).figure
    assert len(figure.axes) == 4 and all(axes.get_aspect() == 1 for axes in figure.axes)


def test_orbits_lie_in_the_plane_as_they_are(studies, pictures):
    study = studies["kaplan"]
    travel = pictures["kaplan"]["figure-6"].figure.axes[0]
    drawn = np.array(travel.lines[7].get_data()) / 1e3
    np.testing.assert_allclose(drawn, study.orbits[8.9].positions(REVOLUTION), atol=1e-15)


def test_readings_of_other_results(studies):
    study = studies["kaplan"]
    assert reading(study.orbits[0.0]).startswith("At 0 % static eccentricity and 150 rpm")
    assert "has no fold" in reading(study.natural)
    said = reading(modes(study.model, study.speed))
    assert re.search(r"At 150 rpm the lowest of \d+ modes are at \d+\.\d\d Hz "
                     r"\((forward|backward), damping", said)
    motion = integrate(study.model, CentralDifference(512), speed=study.speed,
                       static_eccentricity=0.05, revolutions=3)
    assert "Over 3 revolutions at 150 rpm and 5 % static eccentricity" in reading(motion)
    assert reading("as it is") == "as it is"


def test_a_leaning_rotor_off_the_axes_is_drawn_with_its_own_numbers():
    """The curve once took four unknowns for two and drew 47 to 51 µm."""
    machine = load_machine("kaplan-150rpm")
    machine = replace(machine, air_gap=replace(machine.air_gap, tilt=True))
    branch = follow(machine.model(), to=0.05, speed=machine.speed, direction=0.7)
    picture = branch_picture(branch)
    drawn = picture.figure.axes[1].lines[0].get_ydata()
    # 1X along the stator's offset of each steady state, solved for alone
    ends = [HarmonicBalance().solve(branch.equations.model, machine.speed, e, direction=0.7)
            for e in (0.0, 0.05)]
    along = [1e6 * np.hypot(*(math.sin(0.7) * o.coefficients[0, 1:3]
                              + math.cos(0.7) * o.coefficients[1, 1:3])) for o in ends]
    assert along == pytest.approx([207, 254], abs=0.5)
    assert drawn[[0, -1]] == pytest.approx(along, rel=1e-6)
    assert "starts at 207 µm and is at most 254 µm" in picture.reading
    # x at Ωt = 0, which a slow passage is drawn over
    under = hysteresis_picture(branch, [], {}).figure.axes[0].lines[0].get_ydata()
    assert under[-1] == pytest.approx(1e6 * ends[1].positions([0.0])[0, 0], rel=1e-6)


def test_a_branch_along_the_speed_is_drawn_over_the_speed():
    model = load_machine("jeffcott").model().with_field(0.0)
    branch = follow(model, "speed", to=rpm(120), speed=rpm(60))
    picture = branch_picture(branch)
    assert picture.figure.get_supxlabel() == "speed, rpm"
    x, y = picture.figure.axes[1].lines[0].get_data()
    assert (x[0], x[-1]) == (pytest.approx(60), pytest.approx(120))
    assert y[-1] == pytest.approx(1e6 * HarmonicBalance().solve(model, rpm(120)).amplitudes[0, 0])
    assert picture.reading.startswith("The branch starts at 60 rpm speed, has no fold and ends at "
                                      "120 rpm; 1X")


def test_an_orbit_of_two_revolutions_is_drawn_whole_and_read_by_its_1x():
    model = load_machine("jeffcott").model()
    once, twice = (HarmonicBalance(4 * q, revolutions=q).solve(model, rpm(150), 0.02)
                   for q in (1, 2))
    pictures = [orbit_picture(orbit) for orbit in (once, twice)]
    assert pictures[0].reading == pictures[1].reading
    path = pictures[1].figure.axes[0].lines[0].get_xydata().T / 1e3
    np.testing.assert_allclose(path, twice.positions(2 * REVOLUTION), atol=1e-15)


@pytest.mark.parametrize(("length", "words"),
                         [(519.4e-6, "519 µm"), (2.34e-6, "2.3 µm"), (-0.0421e-6, "-0.042 µm"),
                                               (1e-12, "0 µm"), (-1e-20, "0 µm")])
def test_microns(length, words):
    assert microns(length) == words


def test_colours_that_must_differ_do():
    for together in (("x", "z"), ("mean", "1X", "2X", "3X", "4X"),
                     ("stable", "unstable", "unknown"),
                     ("harmonic balance", "integration", "stator"), ("rotor", "stator", "mean")):
        assert len({COLOURS[name] for name in together}) == len(together)


def test_drawing_leaves_nothing_behind(studies):
    before = dict(matplotlib.rcParams)
    picture = figure_6(studies["kaplan"])
    picture.png()
    assert dict(matplotlib.rcParams) == before
    assert pyplot.get_fignums() == []


def test_drawing_needs_no_pyplot():
    code = ("import sys, hydrolab.figures.paper_figures, hydrolab.figures.orbits as f\n"
            "from hydrolab.figures.picture import Picture; from hydrolab.figures.style import "
            "new_figure\n"
            "Picture(new_figure(2, 2), 'empty.').png()\n"
            "assert 'matplotlib.pyplot' not in sys.modules")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True,
                          timeout=120, cwd=ROOT)
    assert done.returncode == 0, done.stderr


def test_a_run_is_drawn_as_it_was_computed():
    """The lines are the run's numbers, the reading its story; also without a gap."""
    model = load_machine("kaplan-150rpm").model()
    found = run(model, load_rejection(rpm(150), seconds=40), static_eccentricity=0.05,
                steps_per_revolution=64, check=False)
    picture = run_picture(found, steady=5)
    assert picture.reading == str(found)
    _, motion, gap, _ = picture.figure.axes
    assert motion.lines[0].get_ydata() == pytest.approx(1e6 * found.revolutions[1])
    assert gap.lines[0].get_ydata().min() == pytest.approx(1e3 * found.smallest_gap.value)
    fall = waterfall_picture(found, lines=10)
    assert microns(found.waterfall(lines=10, highest=4).of(1).max()) in fall.reading
    still = run(load_machine("three-disc").model(), Schedule([0, 0.1], [2600, 2618]), check=False)
    assert "three-disc" in run_picture(still, steady=2).reading
