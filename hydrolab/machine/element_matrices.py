"""M, G and K of the shaft element in numbers.

Written by `python -m tests.machine.generate_elements` from the derivation in
`hydrolab.machine.elements`, with common parts taken out; a test holds the two together.
"""

from numpy import array
from numpy.typing import NDArray


def timoshenko(L: float, Phi: float, E: float, rho: float, A: float,
               I: float) -> tuple[NDArray, NDArray, NDArray]:
    """M, G and K of the element "timoshenko", each (8, 8), in the letters of `symbols`."""
    x0 = 252*I
    x1 = L**2
    x2 = A*x1
    x3 = Phi*x2
    x4 = Phi**2
    x5 = x2*x4
    x6 = L**(-1.0)
    x7 = Phi + 1
    x8 = rho/x7**2
    x9 = x6*x8
    x10 = (1/210)*x9
    x11 = x10*(x0 + 78*x2 + 147*x3 + 70*x5)
    x12 = 84*I
    x13 = I*Phi
    x14 = 420*x13
    x15 = 35*x5
    x16 = (1/840)*x8
    x17 = x16*(x12 - x14 + x15 + 44*x2 + 77*x3)
    x18 = -x17
    x19 = x15 + 63*x3
    x20 = x10*(-x0 + x19 + 27*x2)
    x21 = x16*(-x12 + x14 + x19 + 26*x2)
    x22 = -x21
    x23 = I*x4
    x24 = 140*x13 + 14*x3 + 7*x5
    x25 = L*x16
    x26 = x25*(112*I + 8*x2 + 280*x23 + x24)
    x27 = -x25*(28*I + 6*x2 - 140*x23 + x24)
    x28 = (12/5)*I*x9
    x29 = -x28
    x30 = 5*Phi
    x31 = I*x8
    x32 = (1/5)*x31*(x30 - 1)
    x33 = -x32
    x34 = (1/15)*L*x31
    x35 = x34*(x30 + 10*x4 + 4)
    x36 = -x35
    x37 = x34*(-x30 + 5*x4 - 1)
    x38 = -x37
    x39 = E*I/x7
    x40 = 12*x39/L**3
    x41 = 6*x39/x1
    x42 = -x41
    x43 = -x40
    x44 = x39*x6
    x45 = x44*(Phi + 4)
    x46 = -x44*(Phi - 2)
    return (
        array([[x11, 0, 0, x18, x20, 0, 0, x21],
               [0, x11, x17, 0, 0, x20, x22, 0],
               [0, x17, x26, 0, 0, x21, x27, 0],
               [x18, 0, 0, x26, x22, 0, 0, x27],
               [x20, 0, 0, x22, x11, 0, 0, x17],
               [0, x20, x21, 0, 0, x11, x18, 0],
               [0, x22, x27, 0, 0, x18, x26, 0],
               [x21, 0, 0, x27, x17, 0, 0, x26]]),
        array([[0, x29, x32, 0, 0, x28, x32, 0],
               [x28, 0, 0, x32, x29, 0, 0, x32],
               [x33, 0, 0, x36, x32, 0, 0, x38],
               [0, x33, x35, 0, 0, x32, x37, 0],
               [0, x28, x33, 0, 0, x29, x33, 0],
               [x29, 0, 0, x33, x28, 0, 0, x33],
               [x33, 0, 0, x38, x32, 0, 0, x36],
               [0, x33, x37, 0, 0, x32, x35, 0]]),
        array([[x40, 0, 0, x42, x43, 0, 0, x42],
               [0, x40, x41, 0, 0, x43, x41, 0],
               [0, x41, x45, 0, 0, x42, x46, 0],
               [x42, 0, 0, x45, x41, 0, 0, x46],
               [x43, 0, 0, x41, x40, 0, 0, x41],
               [0, x43, x42, 0, 0, x40, x42, 0],
               [0, x41, x46, 0, 0, x42, x45, 0],
               [x42, 0, 0, x46, x41, 0, 0, x45]]))
