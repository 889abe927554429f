r"""The pull of a field with p pole pairs, which turns: a mean part and parts that beat with twice
the electrical frequency.

The field at the gap angle φ is √2 B0 Re(c e^{−ipφ}) g0/g, with c = e^{iθ} for a wave that turns
forward, θ the electrical angle. B0 is the rms value of the wave; its peak B̂ is √2 B0. With the
complex eccentricity ζ = (z + ix)/g0, s = |ζ|² and w = √(1 − s), the integral of the Maxwell stress
over the true gap g0 (1 − Re(ζ̄ e^{iφ})) is, for any p,

F_z + i F_x = k g0 [2 |c|² a₁ ζ + c̄² a_{2p+1} ζ^{2p+1} + c² a_{2p−1} ζ̄^{2p−1}],  a_n = (1 + n w) /
(2 w³ (1 + w)ⁿ).

The wave leaves a net flux over in an uneven gap, which must return through shaft and frame. The
rotor's iron takes the magnetic potential u that lets a share χ of it pass: all of it where the way
is free (χ = 1: u = 0, the force above), none where it is blocked (χ = 0). The field is then √2 B0
(Re(c e^{−ipφ}) − u) g0/g with u = (1 − χ) Re(c ζ̄^p)/(1 + w)^p, and with the same integrals

F_z + i F_x += k g0 [4 u² a₁ ζ − 4 u (c a_{p−1} ζ̄^{p−1} + c̄ a_{p+1} ζ^{p+1})].

For one pole pair about the centre a blocked way halves the stiffness and takes the beat away. Only
for p = 1 does the beat grow with the first power of the eccentricity; in general it is
O(ε^{2p−1}). Guo, Chu and Chen (2002) expand the permeance to its third order instead, which changes
the a_n and drops n > 5. Their text could not be read; the truncated forces here follow from the
same series.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
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
    permeance to its third order (Guo, Chu and Chen 2002), not the whole force. flux_share: χ, the
    share of the net flux that the way through shaft and frame lets pass, 1 free, 0 blocked.
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
    flux_share: float = 1.0

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
        c, p = self.wave(phase), self.pole_pairs
        size = truncated_size if self.truncated else whole_size
        total = _sum(size, zeta, w, ((2 * np.abs(c) ** 2, 1, True),
                                     (c.conj() ** 2, 2 * p + 1, True), (c**2, 2 * p - 1, False)))
        if self.flux_share != 1.0:
            total += self._held_back(zeta, w, c)
        force, by_zeta, by_conj = total
        along_z, along_x = by_zeta + by_conj, 1j * (by_zeta - by_conj)
        slope = np.stack([along_x.imag, along_z.imag, along_x.real, along_z.real])
        return (self.stiffness * self.gap * np.stack([force.imag, force.real]),
                self.stiffness * slope.reshape(2, 2, *slope.shape[1:]), None)

    def _held_back(self, zeta: NDArray, w: NDArray, c: NDArray) -> NDArray:
        """What the force changes by where the net flux is held back, as `_sum` gives it."""
        p, conj, held = self.pole_pairs, zeta.conj(), (1 - self.flux_share) / 2 * (1 + w) ** (
            -self.pole_pairs)
        wave = c * conj**p + c.conj() * zeta**p
        u = held * wave
        u_zeta = held * (c.conj() * p * zeta ** (p - 1) + wave * p * conj / (2 * w * (1 + w)))
        crossed = _sum(whole_size, zeta, w, ((c, p - 1, False), (c.conj(), p + 1, True)))
        own = _sum(whole_size, zeta, w, ((np.ones_like(c), 1, True),))
        through_u = (8 * u * own[0] - 4 * crossed[0]) * np.stack([0 * u, u_zeta, u_zeta.conj()])
        return 4 * u**2 * own - 4 * u * crossed + through_u


def _sum(size: Callable[[NDArray, int], tuple[NDArray, NDArray]], zeta: NDArray, w: NDArray,
         parts: Sequence[tuple[NDArray, int, bool]]) -> NDArray:
    """Σ factor · a_n(w) ζⁿ, or ζ̄ⁿ where a part is not forward; its derivatives by ζ and ζ̄."""
    conj = zeta.conj()
    total = np.zeros((3, *np.broadcast(zeta, parts[0][0]).shape), dtype=complex)
    for factor, n, forward in parts:
        a, slope = size(w, n)
        z = zeta if forward else conj
        own = factor * a * n * z ** max(n - 1, 0)
        through_w = -factor * slope * z**n / (2 * w)  # ∂w/∂ζ = −ζ̄/2w
        total += np.stack([factor * a * z**n, through_w * conj + (own if forward else 0),
                           through_w * zeta + (0 if forward else own)])
    return total


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
    flux_share: float = number_field("1", "share of the net flux that the way back through shaft "
                                     "and frame lets pass; 1 free, 0 blocked", least=0, most=1,
                                     default=1.0, example=0.3)
    series: str = choice_field("the whole permeance, or cut at its third order as published",
                               "whole", "published", default="whole")

    def disagreements(self) -> Iterator[Fault]:
        """The stator's wave goes without a cut series; a flux held back, with the closed form."""
        if self.stator_mmf and self.series != "whole":
            yield "stator_mmf", (f"is {self.stator_mmf:g}, which is taken by quadrature of the "
                                 "whole gap; leave out series.")
        if self.flux_share != 1.0 and (self.stator_mmf or self.series != "whole"):
            yield "flux_share", (f"is {self.flux_share:g}, which is known for the whole series "
                                 "without a stator's wave; leave out series and stator_mmf.")

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
                            self.backward, self.backward_angle, self.series == "published",
                            self.flux_share)
