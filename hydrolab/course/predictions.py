"""What a student predicted, beside what was computed."""

from __future__ import annotations

from typing import Any


def answered(prediction: Any, computed: float | str, unit: str = "") -> str:
    """One sentence: the prediction, the computed value, how far apart they are; `...` is a prediction not made yet.

    computed: a number, shown with three significant digits, or a word that was to be chosen.
    """
    result = _quantity(computed, unit)
    if prediction is ...:
        return f"Computed: {result}. You have not predicted it: put your answer in place of ... and run both cells again."
    if isinstance(computed, str):
        same = str(prediction).strip().lower() == computed.lower()
        return f"Computed: {result}. You said {prediction}: {'the same' if same else 'not the same'}."
    try:
        value = float(prediction)
    except (TypeError, ValueError):
        return f"Computed: {result}. You said {prediction!r}, which is not a number{f' of {unit}' if unit else ''}."
    if value == 0 or computed == 0:
        return f"Computed: {result}. You said {_quantity(value, unit)}."
    if (value > 0) != (computed > 0):
        return f"Computed: {result}. You said {_quantity(value, unit)}: the other sign."
    ratio = value / computed
    verdict = "within 10 %" if abs(ratio - 1) <= 0.1 else (
        f"{ratio:.2g} times as much" if ratio > 1 else f"{100 * ratio:.2g} % of it")
    return f"Computed: {result}. You said {_quantity(value, unit)}: {verdict}."


def _quantity(value: float | str, unit: str) -> str:
    words = value if isinstance(value, str) else f"{value:.3g}".replace("-", "−")
    return f"{words} {unit}".rstrip()
