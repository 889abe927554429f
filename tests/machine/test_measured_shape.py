"""A measured gap from a CSV: the orders that were put in come out, and bad files get a sentence."""

import numpy as np
import pytest

from hydrolab import BadInput
from hydrolab.machine.gap_shape import Bulge, outline, read_gap, shaped_law

TRUE = (Bulge(1, 2e-4, 0.5), Bulge(2, 4e-4, -0.6), Bulge(3, 1e-4, 0.2), Bulge(5, 3e-5, 0.1))


def write(path, angle, gap, head="angle_deg,gap_mm"):
    path.write_text("\n".join([head, *(f"{a:.9g},{g:.9g}"
                                       for a, g in zip(angle, gap, strict=True))]),
                    encoding="utf-8")
    return path


def test_orders_come_back_from_unequal_angles(tmp_path):
    degrees = np.random.default_rng(3).permutation(np.arange(72) * 5.0
                                                   + np.random.default_rng(4).uniform(0, 3, 72))
    gap = 11e-3 + outline(TRUE, np.radians(degrees))
    found = read_gap(write(tmp_path / "gap.csv", degrees, 1e3 * gap), orders=6)
    assert found.mean == pytest.approx(11e-3, rel=1e-8) and found.misfit < 1e-10
    angle = np.linspace(0, 7, 100)
    assert outline(found.bulges, angle) == pytest.approx(outline(TRUE, angle), abs=1e-9)
    assert outline(found.rotor(), angle) == pytest.approx(-outline(TRUE, angle), abs=1e-9)
    assert "largest order is 2 with 400 µm" in str(found) and "72 angles" in str(found)
    law, true = (shaped_law(1e8, 11e-3, shape) for shape in (found.bulges, TRUE))
    e = np.array([1e-3, -2e-3])
    assert law.force(e) == pytest.approx(true.force(e), rel=1e-6)


def test_units_and_other_columns(tmp_path):
    angle = np.linspace(0, 6, 40)
    gap = 5e-3 + 1e-4 * np.cos(2 * angle)
    lines = ["probe, gap_um ,angle_rad", *(f"A,{1e6 * g:.9g},{a:.9g}"
                                           for a, g in zip(angle, gap, strict=True))]
    (tmp_path / "g.csv").write_text("\ufeff" + "\r\n".join([*lines, "", " , , "]), encoding="utf-8")
    found = read_gap(tmp_path / "g.csv", orders=3)
    assert found.mean == pytest.approx(5e-3, rel=1e-8)
    assert found.bulges[1].size == pytest.approx(1e-4, rel=1e-6)


def test_semicolons_decimal_commas_and_the_greek_letter(tmp_path):
    """As a spreadsheet in most of Europe writes it."""
    angle = np.arange(0, 360, 10.0)
    gap = 11e-3 + outline(TRUE, np.radians(angle))
    lines = ["angle_deg; gap_\u03bcm", *(f"{a:.1f};{1e6 * g:.6f}".replace(".", ",")
                                        for a, g in zip(angle, gap, strict=True))]
    (tmp_path / "g.csv").write_text("\n".join(lines), encoding="utf-8")
    found = read_gap(tmp_path / "g.csv")
    assert found.mean == pytest.approx(11e-3, rel=1e-8) and found.misfit < 1e-10
    assert outline(found.bulges, angle) == pytest.approx(outline(TRUE, angle), abs=1e-9)


def test_degrees_called_radians_are_noticed(tmp_path):
    """Order 1 of 300 µm, which read as radians would be order 5 of 248 µm."""
    gap = 11e-3 + outline((Bulge(1, 3e-4),), np.radians(ANGLES))
    write(tmp_path / "gap.csv", ANGLES, 1e3 * gap, "angle_rad,gap_mm")
    with pytest.raises(BadInput, match=r"gap\.csv: angle_rad goes from 0 to 350 rad, 56 turns"):
        read_gap(tmp_path / "gap.csv")
    found = read_gap(write(tmp_path / "gap.csv", ANGLES, 1e3 * gap))
    assert max(found.bulges, key=lambda b: b.size).order == 1
    assert found.bulges[0].size == pytest.approx(3e-4, rel=1e-6)


ANGLES = np.arange(0.0, 360, 10)


@pytest.mark.parametrize(("text", "said"), [
    ("angle,gap\n0,1", ["begins with", "angle_deg or angle_rad"]),
    ("angle_deg,gap_inch\n0,1", ["gap_m or gap_mm"]),
    ("", ["begins with", "angle_deg"]),
    ("angle_deg,gap_mm\n0,11\n10,abc", ["line 3", "gap_mm is 'abc'", "finite number"]),
    ("angle_deg,gap_mm\n0,11\n\n10,inf", ["line 4", "'inf'"]),
    ("angle_deg,gap_mm\n0,11\n10", ["line 3 has 1 values", "gap_mm"]),
    ("angle_deg,gap_mm\n0,11\n10,-2", ["line 3", "-2 mm", "larger than 0"]),
    ("angle_deg,gap_mm\n0,11\n10,11", ["has 2 angles", "at least 17"]),
    ("angle_rad,gap_mm\n" + "\n".join(f"{a * 1e-3},11" for a in ANGLES),
     ["circumference open", "unit"]),
])
def test_bad_files_get_a_sentence(tmp_path, text, said):
    (tmp_path / "bad.csv").write_text(text, encoding="utf-8")
    with pytest.raises(BadInput) as error:
        read_gap(tmp_path / "bad.csv")
    assert all(words in str(error.value) for words
               in ["bad.csv", *said]) and "\n" not in str(error.value)


def test_what_is_no_file_or_no_order(tmp_path):
    with pytest.raises(BadInput, match="cannot be read"):
        read_gap(tmp_path / "none.csv")
    with pytest.raises(BadInput, match="orders is 0"):
        read_gap(tmp_path / "none.csv", orders=0)
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BadInput, match="UTF-8"):
        read_gap(tmp_path / "b.csv")
