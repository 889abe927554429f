"""The 3D view under load: `python -m tests.benchmarks.scene_load [--minutes 2] [--viewers 30]`;
with `--viewers 1 --seconds 5 --minutes 0.02` it only shows that it runs.

Clients in a process of their own say where their camera is, which makes them viewers, and read what
a browser would. Reported: poses a second that one of them received, the server's share of one core,
the time from a setting to the first pose on the way to its new orbit, and the server's memory while
viewers come and go (some never read).
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import multiprocessing
import random
import resource
import statistics
import time
from collections.abc import Iterator, Sequence
from multiprocessing.connection import Connection
from pathlib import Path

import msgspec
import viser
import zstandard
from viser import ViserServer
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from hydrolab import load_machine
from hydrolab.live.scene import MachineScene
from hydrolab.live.server import close_server, open_server
from tests.live.conftest import CAMERA

OPTIONS = {"subprotocols": [f"viser-v{viser.__version__}"], "max_size": None, "compression": None,
           "ping_interval": None}


def poses_in(data: bytes) -> int:
    """How many poses of the whole machine a packet of the server holds: those of the dot on the
    board.
    """
    size = int.from_bytes(data[8:16], "little")
    packet = msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(
        data[16:16 + size], max_output_size=int.from_bytes(data[:8], "little")))
    return sum(m["type"] == "SetPositionMessage" and m["name"] == "/board/dot"
               for m in packet["messages"])


async def watch(address: str, until: float, counts: bool) -> float:
    """Read until a time; return poses a second where they are counted."""
    poses, start = 0, None
    async with connect(address, **OPTIONS) as socket:
        await socket.send(msgspec.msgpack.encode(CAMERA))
        while time.time() < until:
            try:
                data = await asyncio.wait_for(socket.recv(), 2.0)
            except TimeoutError:
                continue
            if counts and isinstance(data, bytes):
                found = poses_in(data)
                if found and start is None:
                    # until all the others are there
                    start = time.time() + min(5.0, (until - time.time()) / 2)
                elif start is not None and time.time() > start:
                    poses += found
        return poses / max(time.time() - start, 0.1) if start else 0.0


async def come_and_go(address: str, until: float, deaf: bool) -> None:
    """A viewer that stays for seconds, comes back, and, where deaf, never reads; on a busy computer
    it tries again.
    """
    while time.time() < until:
        stay = min(until, time.time() + random.uniform(2, 12))
        with contextlib.suppress(OSError, ConnectionClosed):  # a TimeoutError is one of them
            if deaf:
                async with connect(address, **OPTIONS) as socket:
                    await socket.send(msgspec.msgpack.encode(CAMERA))
                    await asyncio.sleep(max(0.0, stay - time.time()))
            else:
                await watch(address, stay, False)


def crowd(port: int, viewers: int, seconds: float, moving: bool, answer: Connection) -> None:
    """The clients' process; it answers with the poses a second of one of them."""
    async def everyone() -> float:
        address, until = f"ws://127.0.0.1:{port}", time.time() + seconds
        others = [come_and_go(address, until, k % 6 == 0) if moving
                  else watch(address, until, False)
                  for k in range(viewers - 1)]
        return (await asyncio.gather(watch(address, until, True), *others))[0]

    answer.send(asyncio.run(everyone()))


@contextlib.contextmanager
def crowd_of(port: int, viewers: int, seconds: float, moving: bool = False) -> Iterator[Connection]:
    """A crowd in a process of its own, and where its answer arrives; it is gone at the end."""
    spawn = multiprocessing.get_context("spawn")
    answer, own = spawn.Pipe(duplex=False)
    process = spawn.Process(target=crowd, args=(port, viewers, seconds, moving, own))
    process.start()
    try:
        yield answer
    finally:
        process.kill()
        process.join()


def measured(server: ViserServer, viewers: int, seconds: float,
             moving: bool = False) -> tuple[float, float, list[float]]:
    """Poses a second, share of a core, and resident memory each second (MB) while clients watch."""
    with crowd_of(server.get_port(), viewers, seconds, moving) as answer:
        while not server.get_clients():
            time.sleep(0.1)
        memory, before, start = [resident()], used(), time.perf_counter()
        while time.perf_counter() - start < seconds - 4.0:
            time.sleep(1.0)
            memory.append(resident())
        share = (used() - before) / (time.perf_counter() - start)
        if not answer.poll(60):
            raise RuntimeError(f"{viewers} viewers gave no answer within a minute.")
        return answer.recv(), share, memory


def used() -> float:
    """CPU time of this process, s."""
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def resident() -> float:
    """Resident memory of this process, MB."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1e6


def answers(scene: MachineScene, wanted: list[dict[str, float]]) -> list[float]:
    """Seconds from each change to the moment the loop has drawn on the way to the new orbit."""
    times = []
    for settings in wanted:
        shown, start = scene.shown, time.perf_counter()
        scene.change(**settings)
        while scene.shown is shown:
            time.sleep(0.0005)
        phase = scene.drawn
        while scene.drawn is phase:  # and once more: the pose is on its way
            time.sleep(0.0005)
        times.append(time.perf_counter() - start)
        time.sleep(0.15)
    return times


WHOLE, LEAST = 15.0, 5.0  # s; a look of this length tries all settings, one of each
SETTINGS = {
    "eccentricity": [{"static_eccentricity": 0.002 * k} for k in range(1, 41)],
    "leg": [{"static_eccentricity": 0.088, "leg": 2 * (k % 2)} for k in range(1, 20)],
    "field": [{"field": 1 - 0.01 * k} for k in range(1, 16)],
    "unbalance": [{"field": 1.0, "unbalance": 1 - 0.02 * k} for k in range(1, 16)],
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, and print a line for each number."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--minutes", type=float, default=2.0,
                         help="of the soak (default: %(default)s)")
    options.add_argument("--viewers", type=int, default=30)
    options.add_argument("--seconds", type=float, default=WHOLE,
                         help="of each look before it; fewer try fewer settings")
    chosen = options.parse_args(arguments)
    seconds = max(chosen.seconds, LEAST)
    server = open_server(port=0)
    scene = MachineScene(server, load_machine("kaplan-150rpm"))
    scene.run()
    for viewers in sorted({1, chosen.viewers}):
        rate, share, _ = measured(server, viewers, seconds)
        print(f"{viewers} viewers: {rate:.1f} poses/s, {100 * share:.0f} % of one core", flush=True)
    with crowd_of(server.get_port(), 1, 60.0):
        while not server.get_clients():
            time.sleep(0.1)
        for name, wanted in SETTINGS.items():
            some = wanted[:max(1, round(len(wanted) * (seconds - LEAST) / (WHOLE - LEAST)))]
            ms = [1e3 * t for t in answers(scene, some)]
            print(f"{name} to new orbit: median {statistics.median(ms):.0f} ms, largest "
                  f"{max(ms):.0f} ms", flush=True)
    scene.change(field=1.0, unbalance=1.0, leg=0)
    _, share, memory = measured(server, chosen.viewers, 60 * chosen.minutes + 4, moving=True)
    tenth = max(len(memory) // 10, 1)
    means = ", ".join(f"{statistics.mean(memory[k:k + tenth]):.0f}"
                      for k in range(0, tenth * (len(memory) // tenth), tenth))
    print(f"soak of {chosen.minutes:g} minutes, {chosen.viewers} viewers coming and going: "
          f"{100 * share:.0f} % of one core, memory in equal parts of it: {means} MB", flush=True)
    scene.stop()
    close_server()


if __name__ == "__main__":
    main()
