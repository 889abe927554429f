"""One table of all benchmarks: `python -m tests.benchmarks.report`.

Times are the best of several rounds (others may use the machine), on one BLAS thread. The reference
kernel is measured before and after each of them (a machine's clock wanders within a run); where it
is slower than its nominal time, that target may be read that much longer, at most 1.5 times. pyHarm
is installed into an environment of its own, or taken from the interpreter that HYDROLAB_PYHARM
names.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

NOMINAL = 20e-6  # s, the reference kernel on the machine the targets were set on
RATIOS = [  # what costs how many times as much as what, and how many times it should at least
    ("one point, scipy.optimize.root on all DOFs", "natural point, 12 elements", 500),
    ("one point, DOP853 in time, as accurate", "natural point, 12 elements", 1e4),
    ("arclength point, 2 DOFs, pyHarm", "arclength point, 2 DOFs", 10),
]
AS_IT_STANDS = "natural point, 12 elements, table, bracket and seal"
FLAT = 0.10  # how much more a point may cost with many elements than with few
FEWEST, MOST = 3, 48


def readable(seconds):
    """A time with three digits and a unit."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds:.1e} s"


def judged(good):
    """A word."""
    return "met" if good else "MISSED"


def table(benchmarks):
    """The rows of a pytest-benchmark result as text."""
    times, memory = {}, {}
    for b in benchmarks:
        info = b["extra_info"]
        if "bytes" in info:
            memory[info["what"]] = info["bytes"]
        elif "what" in info:
            times[info["what"]] = (info.get("seconds", b["stats"]["min"] / info["per"]),
                                   info["kernel"], info["target"])
    point = times["natural point, 12 elements"][0]
    lines = [f"one BLAS thread; nominal reference kernel {readable(NOMINAL)}", "",
             f"{'':66}{'time':>9} {'kernel':>9} {'× kernel':>9} {'× point':>9}   target"]
    for what, (seconds, kernel, target) in times.items():
        slack = min(1.5, max(1.0, kernel / NOMINAL))
        verdict = ""
        if target is not None:
            verdict = f"{readable(target)} {judged(seconds <= slack * target)}"
            verdict += f", read × {slack:.2f}" if slack > 1 else ""
        lines.append(f"{what:66}{readable(seconds):>9} {readable(kernel):>9} "
                     f"{seconds / kernel:9.3g} "
                     f"{seconds / point:9.3g}   {verdict}")
    for what, size in memory.items():
        lines.append(f"{what:66}{size / 2**20:5.0f} MiB {'':29}   1024 MiB {judged(size <= 2**30)}")
    lines.append("")
    for slow, fast, least in RATIOS:
        if slow in times:
            ratio = times[slow][0] / times[fast][0]
            lines.append(f"{slow} / {fast}: {ratio:.3g} (at least {least:g}: "
                         f"{judged(ratio >= least)})")
        else:
            lines.append(f"{slow}: not measured here")
    if AS_IT_STANDS in times:
        more = times[AS_IT_STANDS][0] / point - 1
        lines.append(f"{AS_IT_STANDS}: {more:+.0%} (within {FLAT:.0%}: {judged(more <= FLAT)})")
    kinds = ("natural point", "arclength point", "counted verdict of a point")
    return "\n".join([*lines, *(growth(kind, times) for kind in kinds)])


def growth(kind, times):
    """What many elements cost a kind of point over few."""
    if f"{kind}, {MOST} elements" not in times:
        return f"{kind}: not measured here"
    few, many = (times[f"{kind}, {n} elements"][0] for n in (FEWEST, MOST))
    return (f"{kind}: {MOST} elements cost {many / few - 1:+.0%} of {FEWEST} "
            f"(within {FLAT:.0%}: {judged(many / few - 1 <= FLAT)})")


def main():
    """Run the benchmarks and print the table."""
    options = argparse.ArgumentParser(prog="python -m tests.benchmarks.report",
                                      description=__doc__.split("\n\n")[0])
    options.add_argument("--quick", action="store_true", help="each once and the long ones "
                         "shortened: whether it runs, not how fast it is")
    options.add_argument("-k", default="", help="only those that pytest would take by this")
    chosen = options.parse_args()
    extent = ["-k", chosen.k] if chosen.k else []
    extent += [] if chosen.quick else ["--benchmark-only"]
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "benchmarks.json"
        command = [sys.executable, "-m", "pytest", "-q", "-rs", "-n0", "-p", "no:cacheprovider",
                   str(Path(__file__).parent), *extent, f"--benchmark-json={out}",
                   "--benchmark-columns=min"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            sys.exit(done.stdout + done.stderr)
        print(table(json.loads(out.read_text())["benchmarks"]))
        print(*(line for line in done.stdout.splitlines() if line.startswith("SKIPPED")), sep="\n")


if __name__ == "__main__":
    main()
