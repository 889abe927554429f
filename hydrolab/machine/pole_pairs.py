r"""The pull of a field with p pole pairs, which turns: a mean part and parts that beat with twice
the electrical frequency.

The field at the gap angle φ is √2 B0 Re(c e^{−ipφ}) g0/g, with c = e^{iθ} for a wave that turns
forward, θ the electrical angle. B0 is the rms value of the wave; its peak B̂ is √2 B0. With the
complex eccentricity ζ = (z + ix)/g0, s = |ζ|² and w = √(1 − s), the integral of the Maxwell stress
over the true gap g0 (1 − Re(ζ̄ e^{iφ})) is, for any p,

F_z + i F_x = k g0 [2 |c|² a₁ ζ + c̄² a_{2p+1} ζ^{2p+1} + c² a_{2p−1} ζ̄^{2p−1}],  a_n = (1 + n w) /
(2 w³ (1 + w)ⁿ).

Only for p = 1 does the beat grow with the first power of the eccentricity; in general it is
O(ε^{2p−1}). Guo, Chu and Chen (2002) expand the permeance to its third order instead, which changes
the a_n and drops n > 5. Their text could not be read; the truncated forces here follow from the
same series.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydrolab.machine.pull import ForceLaw, Linear, Phase, Rate, Wave, quiet
from hydrolab.machine.quantities import Fault, Part, choice_field, number_field, whole_field

# of the series to third order: a_n w² (1 + w)ⁿ as a polynomial in ρ²
KEPT = {1: (1, 1, 1), 3: (2, 0, 0), 5: (1, 0, 0)}


def whole_size(w: NDArray, n: int) -> tuple[NDArray, NDArray]:
    """a_n, n the order, of the whole force at w = √(1 − ε²), and its derivative by w."""
    size = (1 + n * w) / (2 * w**3 * (1 + w) ** n)
    return size, size * (n / (1 + n * w) - 3 / w - n / (1 + w))


def truncated_size(w: NDArray, n: int) -> tuple[NDArray, NDArray]:
    """a_n of the permeance series to its third order, and its derivative by w; zero for n > 5."""
    square = (1 - w) / (1 + w)  # ρ², with ρ = (1 − w)/ε
    a, b, c = KEPT.get(n, (0, 0, 0))
    below = w**2 * (1 + w) ** n
    size = (a + b * square + c * square**2) / below
    return size, -size * (2 / w + n / (1 + w)) - 2 * (b + 2 * c * square) / (below * (1 + w) ** 2)


@dataclass(frozen=True)
class PolePairPull(ForceLaw):
    """The pull of a wave of p pole pairs in closed form.

    stiffness: k = π B0² u0 l0/(µ0 g0), N/m, with the rms value B0 of the forward wave. gap: g0, m.
    pole_pairs: p. ratio: electrical over mechanical angle, p for a synchronous machine, p/(1 −
    slip) for an induction motor. start: electrical angle at phase 0, rad. backward: size of a wave
    that turns the other way, over the forward one, which phases out of balance make; its sum with
    the forward wave is largest at the electrical angle −backward_angle/2, rad. truncated: take the
    permeance to its third order (Guo, Chu and Chen 2002), not the whole force.
    """

    moving = True
    stiffness: float
    gap: float
    pole_pairs: int
    ratio: float
    start: float = 0.0
    backward: float = 0.0
    backward_angle: float = 0.0
    truncated: bool = False

    def wave(self, phase: Phase) -> NDArray:
        """The complex amplitude c of the field at the phases Ωt, rad."""
        angle = self.ratio * np.asarray(phase) + self.start
        return np.exp(1j * angle) + self.backward * np.exp(-1j * (angle + self.backward_angle))

    @quiet
    def linearise(self, u: NDArray, velocity: Rate = None, phase: Phase = 0.0,
                  speed: float = 0.0) -> Linear:
        """Force, N, and its derivative, N/m; nan where |e| ≥ g0."""
        zeta = (u[1] + 1j * u[0]) / self.gap
        w = np.sqrt(1 - np.abs(zeta) ** 2)
        conj, c, p = zeta.conj(), self.wave(phase), self.pole_pairs
        size = truncated_size if self.truncated else whole_size
        force, by_zeta, by_conj = (np.zeros(np.broadcast(zeta, c).shape, dtype=complex)
                                   for _ in range(3))
        # each part is factor · a_n(w) · ζᵐ or ζ̄ᵐ, and ∂w/∂ζ = −ζ̄/2w
        parts = ((2 * np.abs(c) ** 2, 1, True), (c.conj() ** 2, 2 * p + 1, True),
                 (c**2, 2 * p - 1, False))
        for factor, n, forward in parts:
            a, slope = size(w, n)
            z = zeta if forward else conj
            force += factor * a * z**n
            own = factor * a * n * z ** (n - 1)
            through_w = -factor * slope * z**n / (2 * w)
            by_zeta += through_w * conj + (own if forward else 0)
            by_conj += through_w * zeta + (0 if forward else own)
        along_z, along_x = by_zeta + by_conj, 1j * (by_zeta - by_conj)
        slope = np.stack([along_x.imag, along_z.imag, along_x.real, along_z.real])
        return (self.stiffness * self.gap * np.stack([force.imag, force.real]),
                self.stiffness * slope.reshape(2, 2, *slope.shape[1:]), None)


@dataclass(frozen=True)
class Poles(Part):
    """Poles; their pull beats with twice the electrical frequency: `PolePairPull`, `ShapedPull`."""

    table = "poles"
    pole_pairs: int = whole_field("pole pairs p of the field", 20, least=1, most=100,
                                  why="leave out [poles] for a constant field")
    electrical_ratio: float = number_field("1", "electrical over mechanical angle; 0 stands for "
                                           "pole_pairs, a synchronous machine", least=0,
                                           default=0.0, example=20)
    pole_angle: float = number_field("rad", "electrical angle of the field's peak from z at phase "
                                     "0", default=0.0, example=(90, "deg"), mirrored=True)
    backward: float = number_field("1", "wave that turns backward where the phases are out of "
                                   "balance, over the forward one", least=0, default=0.0,
                                   example=(5, "%"))
    backward_angle: float = number_field("rad", "angle of the backward wave", default=0.0,
                                         example=0.4, mirrored=True)
    stator_mmf: float = number_field("1", "wave of magnetomotive force of the stator, over the "
                                     "rotor's, whose field is B0", least=0, default=0.0,
                                     example=(80, "%"))
    load_angle: float = number_field("rad", "electrical angle of the stator's wave behind the "
                                     "rotor's", default=0.0, example=(60, "deg"))
    series: str = choice_field("the whole permeance, or cut at its third order as published",
                               "whole", "published", default="whole")

    def disagreements(self) -> Iterator[Fault]:
        """The stator's wave goes without a cut series."""
        if self.stator_mmf and self.series != "whole":
            yield "stator_mmf", (f"is {self.stator_mmf:g}, which is taken by quadrature of the "
                                 "whole gap; leave out series.")

    @property
    def ratio(self) -> float:
        """Electrical over mechanical angle."""
        return self.electrical_ratio or float(self.pole_pairs)

    def waves(self) -> tuple[Wave, ...]:
        """The waves of magnetomotive force: the rotor's, the stator's behind it, the backward one.
        """
        p, start, ratio = self.pole_pairs, self.pole_angle, self.ratio
        waves = (Wave(p, 1.0, ratio, start),
                 Wave(p, self.stator_mmf, ratio, start - self.load_angle),
                 Wave(p, self.backward, -ratio, -start - self.backward_angle))
        return tuple(wave for wave in waves if wave.share)

    def closed(self, stiffness: float, gap: float) -> PolePairPull:
        """The law of the field in a round gap in closed form, without a stator's wave.

        stiffness: k, N/m. gap: g0, m.
        """
        return PolePairPull(stiffness, gap, self.pole_pairs, self.ratio, self.pole_angle,
                            self.backward, self.backward_angle, self.series == "published")
