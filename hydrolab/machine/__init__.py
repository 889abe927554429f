"""What the machine is: from a card to matrices and force laws.

`cards` reads a TOML card or a shipped one; `quantities` declares each number once, with its unit
and limits. `parts` holds the machine and its shaft, bodies and air gap, `bearings` and `crack` what
carries or weakens the shaft. `elements` is the finite-element shaft. `pull` holds the base class of
every force law and the pull of a round gap; `gap_shape` and `pole_pairs` are its neighbours.
`loads` is
what acts whatever the motion. `model` puts all of it together: M, C, G, K, the law, the loads.
"""

from hydrolab.machine.bearings import (
    JournalFilm,
    PadBearing,
    RadialBearing,
    ShortFilm,
    ThrustBearing,
)
from hydrolab.machine.cards import card_keys, card_names, card_text, load_machine, vary
from hydrolab.machine.crack import Crack
from hydrolab.machine.elements import energies, shaft_element
from hydrolab.machine.gap_shape import GapShape, gap_shapes, read_gap, selection_rule
from hydrolab.machine.loads import Bow, Gravity, Load
from hydrolab.machine.model import Model, body_matrices, rigid_link
from hydrolab.machine.parts import AirGap, Machine, RayleighDamping, RigidBody, Shaft
from hydrolab.machine.pole_pairs import PolePairPull, Poles, truncated_size, whole_size
from hydrolab.machine.pull import (
    Bulge,
    CircularPull,
    ForceLaw,
    LinearPull,
    ShapedPull,
    TiltedPull,
    Wave,
    closed_form,
    outline,
    shaped_law,
)

__all__ = [
    "AirGap", "Bow", "Bulge", "CircularPull", "Crack", "ForceLaw", "GapShape", "Gravity",
    "JournalFilm", "LinearPull", "Load", "Machine", "Model", "PadBearing", "PolePairPull",
    "Poles", "RadialBearing", "RayleighDamping", "RigidBody", "Shaft", "ShapedPull",
    "ShortFilm", "ThrustBearing", "TiltedPull", "Wave", "body_matrices", "card_keys",
    "card_names", "card_text", "closed_form", "energies", "gap_shapes", "load_machine",
    "outline", "read_gap", "rigid_link", "selection_rule", "shaft_element", "shaped_law",
    "truncated_size", "vary", "whole_size",
]
