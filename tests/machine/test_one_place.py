"""Laws that act on one place add up there, and no coordinate of a model depends on the others."""

from dataclasses import replace

import numpy as np
import pytest

from hydrolab import BadInput, HarmonicBalance
from hydrolab.machine.bearings import JournalFilm, PadBearing
from hydrolab.machine.crack import Crack
from hydrolab.machine.pull import Placed, SeveralLaws
from tests.machines import CRACK, PADS, UPPER, gap, guided, jeffcott, unit
from tests.reference.full_balance import solve_full

FILM = JournalFilm("film", UPPER, 0.03, 0.4, 0.25, 1.5e-4)
GENERATOR = unit().body("generator")


def hung(node: int = GENERATOR.node, **parts):
    """The unit with its generator on the node itself, not above it."""
    bodies = tuple(replace(b, offset=0.0) if b.name == "generator" else b for b in unit().bodies)
    return replace(unit(bodies=bodies), **parts)


def stacked(machine):
    """The machine's model with a coordinate for every law, whether they depend or not: for a
    solver that takes all DOFs and no coordinates.
    """
    model = machine.model()
    pull = machine_without(machine).model()
    laws, rows = [Placed(pull.law, slice(0, len(pull.selection)))], pull.selection
    for support in model.supports.values():
        if support.law:
            laws.append(Placed(support.law, slice(len(rows), len(rows) + 2)))
            rows = np.vstack([rows, support.rows])
    return replace(model, law=SeveralLaws(tuple(laws)), selection=rows)


def machine_without(machine):
    return replace(machine, films=(), pad_bearings=())


TOGETHER = {
    "two films": lambda: guided(films=(FILM, replace(FILM, name="second", viscosity=0.02))),
    "film and pads": lambda: guided(films=(FILM,), pad_bearings=(PADS,)),
    "film on a point mass without a gap": lambda: jeffcott(
        air_gap=None, films=(replace(FILM, node=0, clearance=1e-3),)),
    "film and pads at a disc without a gap": lambda: hung(
        air_gap=None, films=(replace(FILM, node=0, clearance=2e-3),),
        pad_bearings=(PadBearing("pads", 0, 8, 1e8, 1e-4, rounding=3e-5),)),
}


@pytest.mark.parametrize("name", TOGETHER)
def test_laws_at_one_place_add_up(name):
    """Against the twin without coordinates, which adds up forces on all DOFs."""
    machine = TOGETHER[name]()
    eccentricity = 0.01 if machine.air_gap else 0.0
    model = machine.model()
    assert np.linalg.matrix_rank(model.selection) == len(model.selection)
    assert len(model.selection) < len(stacked(machine).selection)
    orbit = HarmonicBalance(4, samples=64).solve(model, machine.speed, eccentricity)
    full = solve_full(stacked(machine), machine.speed, eccentricity)
    assert np.abs(full - orbit.shaft).max() < 1e-9 * np.abs(full).max()
    plain = HarmonicBalance(4, samples=64).solve(machine_without(machine).model(), machine.speed,
                                                 eccentricity)
    assert np.abs(plain.coefficients - orbit.coefficients).max() > 1e-3 * np.abs(full).max()


def test_two_films_are_one_of_their_summed_viscosity():
    both = guided(films=(FILM, replace(FILM, name="second", viscosity=0.02))).model()
    one = guided(films=(replace(FILM, viscosity=0.05),)).model()
    orbits = [HarmonicBalance(8).solve(model, unit().speed, 0.02) for model in (both, one)]
    assert np.abs(orbits[0].local - orbits[1].local).max() < 1e-9 * np.abs(orbits[1].local).max()


@pytest.mark.parametrize("machine", [
    jeffcott(pad_bearings=(PadBearing("pads", 0, 8, 1e8, 1e-4),)),
    hung(films=(replace(FILM, node=0),)),
    gap(tilt=True, base=unit(films=(replace(FILM, node=0),)))],
    ids=["point mass", "offset 0", "leaning"])
def test_a_law_at_the_centre_of_the_rotor_in_the_gap_is_refused(machine):
    with pytest.raises(BadInput, match=r"acts on the centre of generator, .* another node"):
        machine.model()


def test_two_cracks_in_one_element_are_refused():
    machine = unit(cracks=(CRACK, Crack("second", CRACK.element, 0.1)))
    with pytest.raises(BadInput, match=r"cracks.second is in an element that has another crack"):
        machine.model()
    apart = unit(cracks=(CRACK, Crack("second", CRACK.element + 1, 0.1))).model()
    assert len(apart.selection) == 6
