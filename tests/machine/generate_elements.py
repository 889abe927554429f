"""The shaft element's matrices as a module, written from their derivation.

    python -m tests.machine.generate_elements

SymPy takes a second to derive them, and sixteen in a browser; who only computes should not wait.
"""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import sympy as sp

from hydrolab.machine import element_matrices
from hydrolab.machine.elements import element_matrices_symbolic, symbols

MODULE = '''"""M, G and K of the shaft element in numbers.

Written by `python -m tests.machine.generate_elements` from the derivation in
`hydrolab.machine.elements`, with common parts taken out; a test holds the two together.
"""

from numpy import array
from numpy.typing import NDArray


def timoshenko(L: float, Phi: float, E: float, rho: float, A: float,
               I: float) -> tuple[NDArray, NDArray, NDArray]:
    """M, G and K of the element "timoshenko", each (8, 8), in the letters of `symbols`."""
{body}    return (
{matrices})
'''


def module_text() -> str:
    """The module as the derivation gives it."""
    c = symbols()
    made = sp.lambdify((c.L, c.Phi, c.E, c.rho, c.A, c.I), element_matrices_symbolic("timoshenko"),
                       "numpy", cse=True)
    body, matrices = inspect.getsource(made).split("\n", 1)[1].split("    return ")
    rows = [re.sub(r"\], \[", "],\n               [", matrix)
            for matrix in re.findall(r"array\(\[\[.*?\]\]\)", matrices)]
    return MODULE.format(body=body, matrices=",\n".join(" " * 8 + matrix for matrix in rows))


if __name__ == "__main__":
    Path(element_matrices.__file__).write_text(module_text(), encoding="utf-8", newline="\n")
