"""Runs the three programs over their sweeps and writes curves, chart and table; see `run`."""

import csv
import json
import math
import os
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import chart
import radiance
import scene as scenes

SCENES = ["seed_room_8", "cornell_mitsuba"]
GOAL = 0.02
RELUME = "target/release/relume"
RADIANCE = Path(sys.prefix) / f"lib/python{sys.version_info[0]}.{sys.version_info[1]}" / "site-packages/pyradiance"

# Every figure is the best of so many runs, or means of runs where they take milliseconds.
BEST_OF = 3
MILLISECONDS = 0.5
MEAN_OF = 30

# Longest edge of an element, passes of 16 rays from each, rays from a point: from fast to slow.
RELUME_SWEEP = [
    (1.0, 2, 16),
    (0.7, 2, 32),
    (0.5, 2, 48),
    (0.5, 4, 56),
    (0.34, 4, 66),
    (0.34, 4, 80),
    (0.25, 4, 128),
    (0.25, 8, 256),
    (0.17, 16, 512),
    (0.125, 64, 2048),
]

# Samples of a point, depth from which Russian roulette is played.
MITSUBA_SWEEP = [(16, 3), (64, 3), (256, 3), (512, 5), (1024, 3), (1024, 5), (2048, 5), (4096, 8)]


@dataclass
class Run:
    scene: str
    program: str
    settings: str
    seconds: float  # user CPU, all of it
    start: float  # of these, before work began
    error: float


def user_seconds(command, stdin=os.devnull, stdout=os.devnull):
    """User CPU seconds of a child and of all that it waited for."""
    write = os.O_WRONLY | os.O_CREAT | os.O_TRUNC
    actions = [
        (os.POSIX_SPAWN_OPEN, 0, stdin, os.O_RDONLY, 0),
        (os.POSIX_SPAWN_OPEN, 1, stdout, write, 0o644),
        (os.POSIX_SPAWN_OPEN, 2, f"{stdout}.log" if stdout != os.devnull else stdout, write, 0o644),
    ]
    command = [str(word) for word in command]
    pid = os.posix_spawn(command[0], command, os.environ, file_actions=actions)
    _, status, usage = os.wait4(pid, 0)
    if status != 0:
        sys.exit(f"failed: {' '.join(command)}")
    return usage.ru_utime


def best(measure):
    """The best of some runs; of means, where a run is too short for the clock of user time."""
    first = measure()
    count = MEAN_OF if first < MILLISECONDS else 1
    means = [sum(measure() for _ in range(count)) / count for _ in range(BEST_OF - (count == 1))]
    return min(means + [first] * (count == 1))


def relume(scene, folder):
    solution, values = folder / "bake.solution", folder / "values.csv"
    start = 2 * best(lambda: user_seconds([RELUME, "--version"]))
    for element, passes, rays in RELUME_SWEEP:
        bake = [RELUME, "bake", scene.obj, "--element", element, "-o", solution]
        bake += ["--shots", len(scene.lights) + passes, "--threads", 1]
        probe = [RELUME, "probe", solution, "--gather", "--rays", rays]
        probe += ["--points", scene.points_csv, "-o", values]
        seconds = best(lambda: user_seconds(bake)) + best(lambda: user_seconds(probe))
        error = scenes.error(scenes.irradiance(values), scene.truth)
        settings = f"--element {element} --shots {len(scene.lights) + passes} --rays {rays}"
        yield Run(scene.name, "relume", settings, seconds, start, error)


def rcontrib(scene, folder):
    octree, points, values = folder / "scene.oct", folder / "points.txt", folder / "values"
    radiance.write_scene(scene, folder / "scene.rad")
    radiance.write_points(scene, points)
    oconv = [RADIANCE / "bin/oconv", folder / "scene.rad"]
    program = str(RADIANCE / "bin/rcontrib")
    divisions, weight = radiance.SWEEP[0]
    of_nothing = radiance.command(program, scene, octree, divisions, weight)
    compiling = best(lambda: user_seconds(oconv, stdout=str(octree)))
    start = compiling + best(lambda: user_seconds(of_nothing))
    for divisions, weight in radiance.SWEEP:
        command = radiance.command(program, scene, octree, divisions, weight)
        seconds = best(lambda: user_seconds(command, stdin=str(points), stdout=str(values)))
        error = scenes.error(radiance.read(scene, values), scene.truth)
        settings = f"-ad {divisions} -lw {weight:g}"
        yield Run(scene.name, "rcontrib", settings, compiling + seconds, start, error)


def mitsuba(scene, folder, data):
    values, report = folder / "values.npy", str(folder / "report.json")
    for samples, depth in MITSUBA_SWEEP:
        program = Path(__file__).with_name("mitsuba_points.py")
        command = [sys.executable, program, data, scene.name, samples, depth, values]

        def measure():
            whole = user_seconds(command, stdout=report)
            return whole - json.loads(Path(report).read_text())["run"], whole

        runs = [measure() for _ in range(BEST_OF)]
        start, seconds = min(runs, key=lambda run: run[1] - run[0])
        found = np.load(values)
        by_light = {light: found[:, index] for index, light in enumerate(scene.lights)}
        settings = f"{samples} samples, roulette from {depth}"
        error = scenes.error(by_light, scene.truth)
        yield Run(scene.name, "Mitsuba", settings, seconds, start, error)


def front(runs, seconds):
    """Runs that no other one beats in both time and error, from fast to slow."""
    kept = []
    for run in sorted(runs, key=lambda run: (seconds(run), run.error)):
        if not kept or run.error < kept[-1].error:
            kept.append(run)
    return kept


def seconds_at(runs, goal, seconds):
    """Seconds to an error, between the runs on both sides of it, logarithmic in both."""
    kept = front(runs, seconds)
    for before, after in zip(kept, kept[1:]):
        if before.error >= goal >= after.error:
            share = math.log(before.error / goal) / math.log(before.error / after.error)
            return seconds(before) ** (1 - share) * seconds(after) ** share
    sys.exit(f"no runs around {goal}: {[(seconds(run), run.error) for run in kept]}")


def whole(run):
    return run.seconds


def without_start(run):
    return run.seconds - run.start


def table(runs):
    lines = [
        f"| user CPU seconds to {GOAL:.0%} | whole | of it to start | without start | relume, whole, takes |",
        "| --- | --- | --- | --- | --- |",
    ]
    for name in SCENES:
        of_scene = [run for run in runs if run.scene == name]
        ours = seconds_at([r for r in of_scene if r.program == "relume"], GOAL, whole)
        for program in ("relume", "rcontrib", "Mitsuba"):
            own = [run for run in of_scene if run.program == program]
            all_, net = (seconds_at(own, GOAL, kind) for kind in (whole, without_start))
            ratio = "1" if program == "relume" else f"1/{net / ours:.0f} (1/{all_ / ours:.0f})"
            start = min(run.start for run in own)
            lines.append(f"| {name}: {program} | {all_:.3g} | {start:.2g} | {net:.3g} | {ratio} |")
    return "\n".join(lines)


def main(data, out):
    data, out = Path(data).resolve(), Path(out)
    # One thread for all.
    os.environ["RAYON_NUM_THREADS"] = "1"
    os.environ["RAYPATH"] = str(RADIANCE / "lib")
    runs = []
    for name in SCENES:
        scene = scenes.load(data, name)
        with tempfile.TemporaryDirectory() as folder:
            folder = Path(folder)
            of_scene = (relume(scene, folder), rcontrib(scene, folder), mitsuba(scene, folder, data))
            for run in (run for of_program in of_scene for run in of_program):
                print(
                    f"{run.scene}, {run.program}, {run.settings}: {run.seconds:.4f} s, of them "
                    f"{run.start:.4f} s to start, error {run.error:.2%}",
                    flush=True,
                )
                runs.append(run)
    with open(out / "curves.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["scene", "program", "settings", "user_seconds", "start_seconds", "error"])
        for run in runs:
            numbers = [f"{value:.6g}" for value in (run.seconds, run.start, run.error)]
            writer.writerow([run.scene, run.program, run.settings, *numbers])
    lines = {
        name: {
            "relume, whole": _line(runs, name, "relume", whole),
            "rcontrib, without start": _line(runs, name, "rcontrib", without_start),
            "Mitsuba, without start": _line(runs, name, "Mitsuba", without_start),
        }
        for name in SCENES
    }
    (out / "chart.svg").write_text(chart.svg(lines, GOAL))
    (out / "table.md").write_text(table(runs) + "\n")
    print(table(runs))


def _line(runs, scene, program, seconds):
    own = [run for run in runs if (run.scene, run.program) == (scene, program)]
    return [(seconds(run), run.error) for run in front(own, seconds)]


if __name__ == "__main__":
    main(*sys.argv[1:])
