"""The 2-DOF benchmark of peers in pyHarm (`pip install pyHarm-os`), run by the interpreter of its
own environment.

Reads {m, c, k, pull, gap, speed, unbalance, harmonics, samples, to} as JSON on the command line,
prints JSON: points, seconds and, of every point, the eccentricity and the mean along it (in gaps).
pyHarm's continuation parameter is the frequency; here it is the eccentricity instead, with
frequency-independent matrices. Everything is scaled by gap and stiffness, the Jacobian is analytic,
and the numbers below are compiled by numba before the clock starts.
"""

import json
import logging
import sys
import time

import numpy as np
from pyHarm.Elements.SubstructureMatrixElements.MatrixElement import MatrixElement
from pyHarm.Maestro import Maestro


class Pull(MatrixElement):
    """−(unbalance + pull), with the stator at x = om; cosines before sines, harmonic by harmonic.
    """

    factory_keyword = "Pull"

    def _generateMatrices(self, data):
        self.strength, self.unbalance = data["strength"], data["unbalance"]

    def __flag_update__(self):
        self.flag_nonlinear = self.flag_AFT = True

    def adim(self, lc, wc):
        """Nothing: the equations come scaled."""

    def evalResidual(self, xg, om):
        """The forces on the left-hand side."""
        e = xg[self.indices].reshape(-1, 2).T @ self.D["ft"]
        e[0] -= om
        s = 1 / (1 - (e * e).sum(axis=0))
        pull = (self.strength * s * np.sqrt(s) * e) @ self.D["tf"]
        self.R = -pull.T
        self.R[2, 0] -= self.unbalance  # x ~ sin
        self.R[1, 1] -= self.unbalance  # z ~ cos
        self.R = self.R.ravel()
        return self.R

    def evalJacobian(self, xg, om):
        """Its derivatives."""
        e = xg[self.indices].reshape(-1, 2).T @ self.D["ft"]
        e[0] -= om
        s = 1 / (1 - (e * e).sum(axis=0))
        radial = self.strength * s * np.sqrt(s)
        slope = 3 * radial * s * e[:, None] * e + radial * np.eye(2)[:, :, None]
        J = -np.einsum("tk,ijt,lt->kilj", self.D["tf"], slope, self.D["ft"], optimize=True)
        n = 2 * self.D["ft"].shape[0]
        self.J = J.reshape(n, n)
        self.dJdom = (slope[:, 0] @ self.D["tf"]).T.ravel()
        return self.J, self.dJdom


def main():
    """Follow the branch twice, so that the second run finds everything compiled."""
    p = json.loads(sys.argv[1])
    logging.disable(logging.CRITICAL)
    w, k, gap = p["speed"], p["k"], p["gap"]
    matrices = {"inertia": (2, p["m"] * w**2 / k), "damping": (1, p["c"] * w / k),
                "spring": (0, 1.0)}
    connectors = {name: {"type": "GOMatrix", "connect": "rotor", "matrix": value * np.eye(2),
                         "dto": order, "dom": 0}
                  for name, (order, value) in matrices.items()}
    connectors["pull"] = {"type": "Pull", "connect": "rotor", "strength": p["pull"] / k,
                          "unbalance": p["unbalance"] * w**2 / k / gap}
    data = {"plugin": [Pull], "system": {"type": "Base", "nh": p["harmonics"], "nti": p["samples"]},
            "substructures": {"rotor": {"type": "onlydofs", "nnodes": 1, "ndofs": 2, "matrix": {}}},
            "connectors": connectors,
            "analysis": {"branch": {"study": "frf", "solver": p.get("solver", "NewtonRaphson"),
                                    "puls_inf": -1e-3,
                                    "puls_sup": p["to"], "puls_start": 0.0, "ds0": 2e-3,
                                    "ds_max": 2e-2, "ds_min": 1e-7,
                                    "corrector": "pseudo_arc_length", "predictor": "tangent",
                                    "verbose": False,
                                    "stopper": "solnumber",
                                    "stopper_options": {"max_solutions": p["points"]}}}}
    for _ in range(2):
        study = Maestro(data)
        begin = time.perf_counter()
        study.operate()
        seconds = time.perf_counter() - begin
    points = [s for s in study.nls["branch"].SolList if s.flag_accepted]
    print(json.dumps({"points": len(points), "seconds": seconds,
                      "eccentricity": [float(s.x[-1]) for s in points],
                      "mean": [float(s.x[0]) for s in points]}))


if __name__ == "__main__":
    main()
