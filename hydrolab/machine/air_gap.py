"""The generator's air gap: frozen, validated on construction, in SI units."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hydrolab.errors import BadInput
from hydrolab.machine.checks import number, shown

MU_0 = 4e-7 * math.pi  # permeability of vacuum as the paper's Table 1 states it, H/m


@dataclass(frozen=True)
class AirGap:
    """The generator's air gap (Villa et al., Table 1).

    body: the name of the rigid body inside it. field: unperturbed flux density B0, T (rms).
    mean_radius: u0, m. length: l0, m. gap: nominal gap g0, m.
    tilt: whether the pull also feels the rotor lean in the stator, over the height l0 (`TiltedPull`).
    linear: take the pull as a negative stiffness at any eccentricity, as design tools do (`LinearPull`).
    tangential: pull across the eccentricity that damper circuits add, over the pull along it; above 0 it drives forward
    whirl (`TangentialPull`).
    """

    body: str
    field: float
    mean_radius: float
    length: float
    gap: float
    tilt: bool = False
    linear: bool = False
    tangential: float = 0.0

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "field", number("air_gap.field", self.field, least=0, unit="T"))
        put(self, "mean_radius", number("air_gap.mean_radius", self.mean_radius, above=0, unit="m"))
        put(self, "length", number("air_gap.length", self.length, above=0, unit="m"))
        put(self, "gap", number("air_gap.gap", self.gap, above=0, unit="m"))
        if self.gap >= self.mean_radius:
            raise BadInput(f"air_gap.gap is {self.gap:g} m; it must be smaller than "
                           f"air_gap.mean_radius, {self.mean_radius:g} m.")
        put(self, "tangential", number("air_gap.tangential", self.tangential))
        for name in ("tilt", "linear"):
            if not isinstance(getattr(self, name), bool):
                raise BadInput(f"air_gap.{name} is {shown(getattr(self, name))}; it must be true or false.")

    @property
    def pull_stiffness(self) -> float:
        """π B0² u0 l0 / (µ0 g0), N/m: the pull per metre of a small displacement."""
        return math.pi * self.field**2 * self.mean_radius * self.length / (MU_0 * self.gap)
