"""What a number of a part is, declared once: meaning, unit, limits and an example.

A part is a frozen dataclass over `Part` whose fields say what they hold, one line a field:
`mass: float = number_field("kg", "mass", above=0, example=(110, "t"))`. Checks, the tables of a
card, its units, `vary`, what a machine prints and the list of all keys are read from that. Below
are the checks themselves, each with a sentence, and the record of where a card's number comes from.

Throughout key: the dotted key of a number. value: what was given for it. one: reads a single
number.
"""

from __future__ import annotations

import math
import reprlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields
from functools import partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hydrolab.errors import BadInput

SMALLEST, LARGEST = 1e-30, 1e30  # beyond these, powers of a number leave the range of floats
TABLE = 1e3  # a matrix whose second column is larger by this is a table of speeds
RPM = math.pi / 30  # rad/s in one revolution per minute
LB, G0 = 0.45359237, 9.80665  # kg, m/s²: the pound, and the fall that makes it a pound-force
UNITS: dict[str, dict[str, tuple[float, float]]] = {
    "m": {"m": (1, 1), "mm": (1, 1000), "µm": (1, 1_000_000), "in": (254, 10_000),
          "mil": (254, 10_000_000)},
    "kg": {"kg": (1, 1), "t": (1000, 1), "lb": (LB, 1)},
    "kg m": {"kg m": (1, 1), "kg mm": (1, 1000), "t mm": (1, 1), "g mm": (1, 1_000_000)},
    # GD², by the diameter of gyration, is four times the moment of inertia
    "kg m^2": {"kg m^2": (1, 1), "t m^2": (1000, 1), "kg m^2 GD2": (1, 4), "t m^2 GD2": (1000, 4),
               "lb ft^2": (LB * 0.3048**2, 1)},
    "rad/s": {"rad/s": (1, 1), "rpm": (math.pi, 30), "Hz": (2 * math.pi, 1)},
    "rad": {"rad": (1, 1), "deg": (math.pi, 180), "mm/m": (1, 1000)},
    "Pa": {"Pa": (1, 1), "MPa": (1_000_000, 1), "GPa": (1_000_000_000, 1),
           "psi": (LB * G0 / 0.0254**2, 1)},
    "N": {"N": (1, 1), "kN": (1000, 1), "lbf": (LB * G0, 1)},
    "N/m": {"N/m": (1, 1), "N/µm": (1_000_000, 1), "kN/mm": (1_000_000, 1),
            "MN/m": (1_000_000, 1), "GN/m": (1_000_000_000, 1), "lbf/in": (LB * G0 / 0.0254, 1)},
    "N s/m": {"N s/m": (1, 1), "kN s/m": (1000, 1), "MN s/m": (1_000_000, 1),
              "lbf s/in": (LB * G0 / 0.0254, 1)},
    "N m/rad": {"N m/rad": (1, 1), "MN m/rad": (1_000_000, 1), "GN m/rad": (1_000_000_000, 1)},
    "N m s/rad": {"N m s/rad": (1, 1), "MN m s/rad": (1_000_000, 1)},
    "1": {"1": (1, 1), "%": (1, 100)},
}  # SI unit → accepted → (a, b), SI value = value · a / b; others are accepted in SI only

Read = Callable[[str, Any], Any]  # key and value → what the part holds; raises BadInput
Fault = tuple[str, str]  # the dotted key of what is wrong, and the sentence about it


class BadParts(BadInput):
    """Everything that is wrong with some parts, a sentence a line.

    faults: for each the dotted key of the number, such as "bodies.generator.mass", and its
    sentence.
    """

    def __init__(self, faults: Iterable[Fault]) -> None:
        self.faults = tuple(dict.fromkeys(faults))
        super().__init__(self.faults)

    def __str__(self) -> str:
        return "\n".join(dict.fromkeys(sentence for _, sentence in self.faults))


# What a field holds


@dataclass(frozen=True)
class Held:
    """What a field of a part holds.

    meaning, limits: in words. read: makes what the part holds of what is given. example: as a card
    may state it, a number with its unit. unit: SI, or "" for what is no number. stated: whether a
    card must state it even where the part has a default. mirrored: whether it changes where x is
    turned round: its sign, or that of a matrix' cross terms.
    """

    meaning: str
    read: Read
    limits: str
    example: Any
    unit: str = ""
    stated: bool = False
    mirrored: bool = False

    @property
    def units(self) -> dict[str, tuple[float, float]]:
        """The units that a card may give, the first SI; see `UNITS`."""
        return UNITS.get(self.unit, {self.unit: (1, 1)})


def declare(held: Held, default: Any) -> Any:
    """Return the dataclass field of a part that holds this, by default what default says."""
    return field(default=default, metadata={"held": held})


def number_field(unit: str, meaning: str, *, example: Any, default: Any = MISSING,
                 stated: bool = False, form: Callable[[Read, str, Any], Any] | None = None,
                 mirrored: bool = False, **limits: Any) -> Any:
    """Declare a number.

    unit: SI. meaning: in words. example: a value, or a value and its unit. default: where a part
    may leave it out. stated, mirrored: see `Held`. form: of a list or a matrix, such as `vector`.
    limits: as `number` takes them.
    """
    one = partial(number, unit="" if unit == "1" else unit, **limits)
    words = {"above": "above", "least": "at least", "below": "below", "most": "at most"}
    said = ", ".join(f"{words[k]} {quantity(limits[k], unit)}" for k in words if k in limits)
    example = example if isinstance(example, tuple) else (example, unit)
    return declare(Held(meaning, partial(form, one) if form else one, said, example, unit, stated,
                        mirrored), default)


def text_field(meaning: str, example: str, default: Any = MISSING) -> Any:
    """Declare a name, with its meaning and an example; with a default, free text on one line."""
    return declare(Held(meaning, nickname, "text of 1 to 80 characters", example)
                   if default is MISSING else Held(meaning, prose, "text", example), default)


def choice_field(meaning: str, *options: str, default: Any = MISSING, stated: bool = False) -> Any:
    """Declare one of a few words, the options; meaning, default, stated: as in `number_field`."""
    def read(key: str, value: Any) -> str:
        if not isinstance(value, str) or value not in options:
            raise BadInput(f"{key} is {shown(value)}; it must be one of {', '.join(options)}.")
        return value

    return declare(Held(meaning, read, ", ".join(options), options[0], stated=stated), default)


def flag_field(meaning: str) -> Any:
    """Declare what is true or false, and false where nothing is said."""
    def read(key: str, value: Any) -> bool:
        if not isinstance(value, bool):
            raise BadInput(f"{key} is {shown(value)}; it must be true or false.")
        return value

    return declare(Held(meaning, read, "true or false", True), False)


def whole_field(meaning: str, example: int, **limits: Any) -> Any:
    """Declare a count, with its meaning and an example; limits: as `whole` takes them."""
    span = {"least": 0, **limits}
    words = f"a whole number {_span(span['least'], span.get('most', math.inf))}"
    return declare(Held(meaning, partial(whole, **span), words, example), MISSING)


def declared(kind: type[Part]) -> dict[str, Held]:
    """What each declared field of a kind of part holds, by its name, in the order of the class;
    those that are given by name only come last.
    """
    ordered = sorted(fields(kind), key=lambda f: f.kw_only is True)
    return {f.name: f.metadata["held"] for f in ordered if "held" in f.metadata}


def numbers_of(kind: type[Part]) -> dict[str, Held]:
    """The declared fields that hold numbers."""
    return {name: held for name, held in declared(kind).items() if held.unit}


def dotted(key: str, name: str) -> str:
    """The key of the field of a name of the part with this key."""
    return f"{key}.{name}" if key else name


def checked(kind: type[Part], key: str, values: Mapping[str, Any]) -> tuple[dict, list[Fault]]:
    """Return the values of declared fields as the part holds them, and the faults of the others."""
    good: dict[str, Any] = {}
    faults: list[Fault] = []
    held = declared(kind)
    for name, value in values.items():
        own = dotted(key, name)
        try:
            good[name] = held[name].read(own, value)
        except BadInput as error:
            faults.append((own, str(error)))
    return good, faults


@dataclass(frozen=True, eq=False)
class Part:
    """A part of a machine: a frozen dataclass whose declared fields are checked when it is made.

    To add a number to a part, write one line with `number_field`. To add a kind of part, write a
    dataclass over this class with its table and its noun; what its numbers must agree with goes
    into `disagreements`.

    table: the table of a card it is read from, and the beginning of its keys. noun: what a
    sentence calls it.
    """

    table: ClassVar[str] = ""
    noun: ClassVar[str] = "a part"

    def __post_init__(self) -> None:
        names = declared(type(self))
        if "name" in names:  # it is in the key of the others
            nickname(f"the name of {self.noun}", vars(self)["name"])
        good, faults = checked(type(self), self.key, {n: getattr(self, n) for n in names})
        for name, value in good.items():
            object.__setattr__(self, name, value)
        # numbers can be compared only where each is one
        faults = faults or [(dotted(self.key, name), f"{dotted(self.key, name)} {what}")
                            for name, what in self.disagreements()]
        if faults:
            raise BadParts(faults)

    @property
    def key(self) -> str:
        """The beginning of the keys of its numbers: "bodies.generator" or "shaft"."""
        return f"{self.table}.{vars(self)['name']}" if "name" in vars(self) else self.table

    def disagreements(self) -> Iterator[Fault]:
        """Yield which number does not go with another: its name, and the sentence after its key."""
        yield from ()


# Checks


class _Short(reprlib.Repr):
    def repr_int(self, x: int, level: int) -> str:
        return str(x) if x.bit_length() < 100 else f"a whole number of {x.bit_length()} bits"


_short = _Short()
_short.maxstring = _short.maxother = 60


def shown(value: Any) -> str:
    """Return a value as a sentence can show it: on one line and short, whatever it is."""
    text = " ".join(_short.repr(value).split())
    return text if len(text) <= 120 else f"{text[:80]} … {text[-20:]}"


def nickname(key: str, value: Any) -> str:
    """Return a name if a sentence can carry it: one line of 1 to 80 printable characters."""
    if (not isinstance(value, str) or not value.strip() or not value.isprintable()
            or len(value) > 80):
        raise BadInput(f"{key} is {shown(value)}; it must be text of 1 to 80 characters on one "
                       "line.")
    return value


def prose(key: str, value: Any) -> str:
    """Return free text on one line, without what could steer a terminal."""
    if not isinstance(value, str) or not all(c.isprintable() or c.isspace() for c in value):
        raise BadInput(f"{key} is {shown(value)}; it must be text without control characters.")
    return " ".join(value.split())


def number(key: str, value: Any, *, above: float = -math.inf, least: float = -math.inf,
           below: float = math.inf, most: float = math.inf, unit: str = "", why: str = "") -> float:
    """Return value as a float, or say in a sentence why it is not allowed for this key.

    above, below: limits it may not reach; least, most: limits it may. unit: for the sentence. why:
    reason of the upper one.
    """
    unit = f" {unit}" if unit else ""
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise BadInput(f"{key} is {shown(value)}; it must be a "
                       f"number{f' in{unit}' if unit else ''}.")
    if value != value or value in (math.inf, -math.inf):
        raise BadInput(f"{key} is {value}; it must be a finite number.")
    if not -LARGEST <= value <= LARGEST or (above == 0 and 0 < value < SMALLEST):
        raise BadInput(f"{key} is {shown(value)}{unit}; its size must lie between {SMALLEST:g} and "
                       f"{LARGEST:g}{unit}.")
    given = float(value)
    reason = f" ({why})" if why else ""
    for wrong, must in ((given <= above, f"larger than {above:g}{unit}"),
                        (given < least, f"at least {least:g}{unit}"),
                        (given >= below, f"smaller than {below:g}{unit}{reason}"),
                        (given > most, f"at most {most:g}{unit}{reason}")):
        if wrong:
            raise BadInput(f"{key} is {given:g}{unit}; it must be {must}.")
    return given


def _span(least: float, most: float) -> str:
    return f"of at least {least}" if most == math.inf else f"from {least} to {most}"


def whole(key: str, value: Any, least: int, most: float = math.inf, why: str = "") -> int:
    """Return value if it is a whole number from least to most; else say so, with the reason why."""
    if (isinstance(value, bool) or not isinstance(value, (int, np.integer))
            or not least <= value <= most):
        raise BadInput(f"{key} is {shown(value)}; it must be a whole number "
                       f"{_span(least, most)}{f' ({why})' if why else ''}.")
    return int(value)


def turning(speed: Any) -> float:
    """Return a speed of rotation, rad/s, or say in a sentence that it is none."""
    try:
        return number("speed", speed, above=0, unit="rad/s")
    except BadInput as error:
        raise BadInput(f"{str(error)[:-1]} (rpm(150) gives 150 rpm in rad/s).") from None


def require_model(model: Any) -> None:
    """Raise BadInput for what has no matrices, such as a machine."""
    if not hasattr(model, "velocity_matrix"):
        own = "; a Machine makes one by its method model()" if hasattr(model, "model") else ""
        raise BadInput(f"model is a {type(model).__name__}; it must be a Model{own}.")


def require_machine(machine: Any) -> None:
    """Raise BadInput for what has no card's numbers, such as a model."""
    if not hasattr(machine, "with_numbers"):
        raise BadInput(f"machine is a {type(machine).__name__}; it must be a Machine, such as "
                       "load_machine returns.")


def micro(text: Any) -> Any:
    """Return a unit with the micro sign in place of the Greek letter that looks the same."""
    return text.replace("\u03bc", "\u00b5") if isinstance(text, str) else text


def frozen(array: NDArray) -> NDArray:
    """Return the array, read-only from now on."""
    array.setflags(write=False)
    return array


def vector(one: Read, key: str, value: Any) -> NDArray:
    """Return a list as a read-only vector, each entry read by `one`."""
    if isinstance(value, (str, Mapping)) or not np.iterable(value):
        raise BadInput(f"{key} is {shown(value)}; it must be a list of numbers.")
    return frozen(np.array([one(f"{key}[{i}]", v) for i, v in enumerate(value)]))


def per_element(one: Read, key: str, value: Any) -> Any:
    """Return one number, or a vector of one for each element of the shaft."""
    many = np.iterable(value) and not isinstance(value, (str, Mapping))
    return vector(one, key, value) if many else one(key, value)


def pair(one: Read, key: str, value: Any) -> tuple[float, float]:
    """Return two numbers; one stands for both."""
    alone = not np.iterable(value) or isinstance(value, (str, Mapping))
    read = [one(key, v) for v in ((value, value) if alone else value)]
    if len(read) != 2:
        raise BadInput(f"{key} has {len(read)} entries; give one number or two.")
    return read[0], read[1]


def bearing_matrix(one: Read, key: str, value: ArrayLike) -> NDArray:
    """Return the 2 × 2 matrix in (x, z) of a scalar (isotropic), two diagonal entries, or 2 × 2.

    Raises BadInput for what is none of them, a negative direct entry, and a table of speeds.
    """
    value = value.tolist() if isinstance(value, np.ndarray) else value
    rows = value if isinstance(value, (list, tuple)) else [[value, 0.0], [0.0, value]]
    if len(rows) == 2 and not any(isinstance(row, (list, tuple)) for row in rows):
        rows = [[rows[0], 0.0], [0.0, rows[1]]]
    if len(rows) != 2 or any(not isinstance(row, (list, tuple)) or len(row) != 2 for row in rows):
        raise BadInput(f"{key} is {shown(value)}; it must be one number, two numbers [x, z] or a "
                       "2 by 2 matrix [[xx, xz], [zx, zz]].")
    array = np.array([[one(key, entry) for entry in row] for row in rows])
    (xx, xz), (zx, zz) = array.tolist()
    if min(xx, zz) < 0:
        raise BadInput(f"{key} has a negative direct entry, {min(xx, zz):g}; direct entries must "
                       "be at least 0 (of a seal they may be below).")
    if 0 <= xx < zx and TABLE * zx < min(xz, zz):
        raise BadInput(f"{key} is {shown(value)}: as a matrix its direct entries are {xx:g} and "
                       f"{zz:g}. It looks like a table over the speed, which is a bearing with "
                       "speeds, stiffness_rows and damping_rows.")
    return frozen(array)


# Where a number comes from


@dataclass(frozen=True, eq=False)
class Entry:
    """A number as a machine card states it, and where it comes from.

    value: a number or nested lists, in `unit`. si: the same as the part holds it, in SI units.
    """

    value: Any
    unit: str
    source: str
    note: str = ""
    si: Any = None

    @property
    def quantity(self) -> str:
        """The value with its unit, rounded to six figures."""
        return quantity(self.value, self.unit)

    def __str__(self) -> str:
        return f"{self.quantity}  [{self.source}] {self.note}".rstrip()


def quantity(value: Any, unit: str) -> str:
    """Return a number or nested lists of numbers with their unit, rounded to six figures."""
    def text(v: Any) -> str:
        return f"[{', '.join(map(text, v))}]" if np.iterable(v) else f"{v:.6g}"

    return f"{text(value)} {unit}" if unit != "1" else text(value)


def simplest(value: Any) -> Any:
    """One number for an isotropic bearing or a uniform shaft, the value itself otherwise."""
    array = np.asarray(value)
    if array.shape == (2, 2) and np.array_equal(array, array[0, 0] * np.eye(2)):
        return array[0, 0]
    return array.flat[0] if array.ndim == 1 and len(array) and (array == array[0]).all() else value
