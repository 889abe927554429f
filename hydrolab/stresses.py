"""Bending stress in the shaft along an orbit."""

from __future__ import annotations

import numpy as np

from hydrolab.dynamics.condensation import fourier_rows
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.machine.elements import shaft_element
from hydrolab.machine.parts import Shaft

PHASE = 2 * np.pi * np.arange(360) / 360


def stress_fluctuation(shaft: Shaft, orbit: PeriodicOrbit) -> float:
    """Largest 0-to-peak fluctuation over a revolution of the bending stress in a fibre that turns with the shaft, Pa.

    Bending moments are the end moments of the elements, K_e q_e; the fibre is taken at eight angles at each end.
    """
    motion = orbit.model.shaft_map @ orbit.shaft @ fourier_rows(orbit.harmonics, PHASE)
    worst = 0.0
    for i, length in enumerate(np.diff(shaft.nodes)):
        stiffness = shaft_element(shaft.element, length, shaft.young, shaft.density, shaft.area[i],
                                  shaft.second_moment[i], shaft.poisson, shaft.shear_coefficient)[2]
        ends = stiffness @ motion[4 * i:4 * i + 8]
        for mx, mz in (ends[2:4], ends[6:8]):
            for fibre in 2 * np.pi * np.arange(8) / 8:
                # Fibre at angle Ωt + fibre from z towards x; θx bends in the (y, z) plane, −θz in (y, x).
                stress = (mx * np.cos(PHASE + fibre) - mz * np.sin(PHASE + fibre)) * (
                    shaft.diameter[i] / 2 / shaft.second_moment[i])
                worst = max(worst, float(np.ptp(stress)) / 2)
    return worst
