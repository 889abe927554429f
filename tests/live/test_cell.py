"""`show(…)` in a cell: the right machine on the right orbit, and a plain text that is the same
every time.
"""

import numpy as np
import pytest

from hydrolab import Arclength, HarmonicBalance, follow, load_machine, orbits_at, steady_states
from hydrolab.errors import BadInput
from hydrolab.figures.readings import reading
from hydrolab.live.cell import ELSEWHERE, show
from hydrolab.live.server import current_server


@pytest.fixture(scope="module")
def unit():
    return load_machine("kaplan-150rpm")


@pytest.fixture(scope="module")
def branch(unit):
    return follow(unit.model(), to=0.12, speed=unit.speed, method=Arclength(max_folds=3))


@pytest.fixture(autouse=True)
def port_of_its_own(monkeypatch):
    """Any free port first: another process may take 8080 between two servers."""
    monkeypatch.setattr("hydrolab.live.server.FIRST_PORT", 0)


def bundle(view):
    return view._repr_mimebundle_(include=None, exclude=None)


def test_a_machine_is_shown_with_its_reading(unit):
    first = show(unit)
    server = current_server()
    assert first.address == f"http://127.0.0.1:{server.get_port()}/"
    data = bundle(first)
    assert set(data) == {"text/plain", "application/vnd.jupyter.widget-view+json"}
    assert data["text/plain"] == repr(first) == first.reading
    assert "smallest gap is 10.800 mm of 11.000 mm" in first.reading
    assert str(server.get_port()) not in data["text/plain"]
    again = show(unit)  # the cell is run again
    assert current_server() is not server
    assert current_server().get_port() == server.get_port()
    assert bundle(again)["text/plain"] == data["text/plain"]


def test_an_orbit_is_shown_on_its_own_leg(branch):
    for leg, orbit in enumerate(orbits_at(branch, 0.088)):
        view = show(orbit)
        assert view.reading == reading(orbit)
        scene = scene_of()
        assert scene.settings.leg == leg
        assert scene.smallest_gap == pytest.approx(orbit.smallest_gap, rel=1e-6)


def scene_of():
    """The scene of the process's server, by what stops with it."""
    from hydrolab.live import server

    return next(stop.__self__ for stop in server._open.stops
                if hasattr(getattr(stop, "__self__", None), "shown"))


def test_a_branch_is_shown_as_it_was_followed(branch):
    view = show(branch)
    assert view.reading == reading(branch)
    assert scene_of().live.legs.branch is branch


def test_an_orbit_at_another_speed_is_shown_at_that_speed(unit):
    orbit = HarmonicBalance(harmonics=4).solve(unit.model(), 0.9 * unit.speed, 0.03)
    show(orbit)
    assert scene_of().machine.speed == pytest.approx(0.9 * unit.speed)
    assert scene_of().smallest_gap == pytest.approx(orbit.smallest_gap, rel=1e-6)


def test_what_cannot_be_shown_gets_a_sentence(unit, branch, make_jeffcott):
    model = unit.model()
    solve = HarmonicBalance(harmonics=4).solve
    for what, words in [
        (model, "A Model cannot be shown in 3D; give a machine, an orbit or a branch"),
        (solve(model.with_unbalance(0.5), unit.speed, 0.03),
         "is not of kaplan-150rpm as it stands"),
        (solve(make_jeffcott(mass=1e5).model(), unit.speed, 0.03), "is not of jeffcott as it"),
    ]:
        with pytest.raises(BadInput, match=words):
            show(what)
    far = max(steady_states(model, speed=unit.speed, static_eccentricity=0.088),
              key=lambda orbit: np.hypot(*orbit.mean))  # at 8.8 % one is on no leg
    with pytest.raises(BadInput, match=r"at 8.8 % is not on the branch that begins at the centre"):
        show(far)
    with pytest.raises(BadInput, match="height is 20"):
        show(unit, height=20)


@pytest.mark.parametrize(("sign", "words"), [("COLAB_RELEASE_TAG", "on Google Colab"),
                                             ("SSH_CONNECTION", "reached over SSH"), (None, "")])
def test_the_cell_says_where_this_computer_is_not_the_readers(unit, monkeypatch, sign, words):
    for name in ("JUPYTERHUB_SERVICE_PREFIX", *ELSEWHERE):
        monkeypatch.delenv(name, raising=False)
    if sign:
        monkeypatch.setenv(sign, "1")
    shown = []
    monkeypatch.setattr("ipywidgets.HTML.__init__", lambda self, text: shown.append(text))
    monkeypatch.setattr("ipywidgets.HTML._repr_mimebundle_", lambda self: {})
    bundle(show(unit))
    assert words in shown[0] and ("--record" in shown[0]) == bool(sign)
