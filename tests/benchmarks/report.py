"""One table of all benchmarks: `python -m tests.benchmarks.report`.

Times are the best of several rounds (others may use the machine), on one BLAS thread. The reference kernel is measured
in the same run; where it is slower than its nominal time, a target may be read that much longer.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

NOMINAL = 20e-6  # s, the reference kernel on the machine the targets were set on


def readable(seconds):
    """A time with three digits and a unit."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds:.1e} s"


def table(benchmarks):
    """The rows of a pytest-benchmark result as text."""
    times = {}
    for b in benchmarks:
        info = b["extra_info"]
        times[info["what"]] = (info.get("seconds", b["stats"]["min"] / info["per"]), info["target"])
    kernel = next(seconds for what, (seconds, _) in times.items() if what.startswith("reference"))
    point = times["natural point, 12 elements"][0]
    slack = max(1.0, kernel / NOMINAL)
    lines = [f"one BLAS thread; reference kernel {readable(kernel)}, nominal {readable(NOMINAL)}: "
             f"targets may be read {slack:.2f} times as long", "",
             f"{'':58}{'time':>9} {'× kernel':>9} {'× point':>9}   target"]
    for what, (seconds, target) in times.items():
        verdict = "" if target is None else f"{readable(target)} {'met' if seconds <= slack * target else 'MISSED'}"
        lines.append(f"{what:58}{readable(seconds):>9} {seconds / kernel:9.3g} {seconds / point:9.3g}   {verdict}")
    for kind in ("natural point", "arclength point"):
        few, some, many = (times[f"{kind}, {n} elements"][0] for n in (4, 12, 48))
        lines.append(f"{kind}: 48 elements cost {many / some - 1:+.0%}, 4 elements {few / some - 1:+.0%} of 12")
    return "\n".join(lines)


def main():
    """Run the benchmarks and print the table."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "benchmarks.json"
        command = [sys.executable, "-m", "pytest", "-q", "-p", "no:xdist", str(Path(__file__).parent), "--benchmark-only",
                   f"--benchmark-json={out}", "--benchmark-columns=min"]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            sys.exit(done.stdout + done.stderr)
        print(table(json.loads(out.read_text())["benchmarks"]))


if __name__ == "__main__":
    main()
