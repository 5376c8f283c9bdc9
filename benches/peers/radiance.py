"""Radiance's rcontrib: irradiance at points by every light, all lights in one pass.

A lamp is a `light`, whose reflectance Radiance does not know: a diffuse polygon right behind it stands
for its back, and what its front reflects is missing (0 where lamps are black; under a tenth of the error
asked for in cornell_mitsuba, see README). Nothing is cached: rcontrib has no ambient cache. `-lw` sets
how many rays leave a point, `-ad` the most; `-lr` below zero is Russian roulette, `-u-` low-discrepancy
sampling, `-ds` subdivides lamps, whose rays go to the middle of each part (`-dj 0`, better here).
"""

import numpy as np

# What all runs have in common; the best that was found by trying.
COMMON = "-h- -V+ -n 1 -I+ -ab 12 -lr -20 -u- -ds .02 -dj 0 -fad".split()

# (-ad, -lw), from fast to slow.
SWEEP = [
    (256, 6e-2),
    (256, 3e-2),
    (512, 1.5e-2),
    (1024, 1e-2),
    (2048, 6e-3),
    (512, 4e-3),
    (2048, 4e-3),
    (2048, 3e-3),
    (2048, 2e-3),
    (4096, 1e-3),
]


def write_scene(scene, path):
    with open(path, "w") as file:
        for name, material in scene.materials.items():
            diffuse = f"{name}_back" if material.emits else name
            values = " ".join(map(str, material.reflectance))
            file.write(f"void plastic {diffuse} 0 0 5 {values} 0 0\n")
            if material.emits:
                values = " ".join(map(str, material.radiance))
                file.write(f"void light {name} 0 0 3 {values}\n")
        for number, (name, corners) in enumerate(scene.polygons):
            file.write(_polygon(name, f"p{number}", corners))
            if scene.materials[name].emits:
                normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
                behind = corners - normal / np.linalg.norm(normal) * 1e-4
                file.write(_polygon(f"{name}_back", f"b{number}", behind[::-1]))


def _polygon(material, name, corners):
    values = " ".join(f"{v:.9g}" for v in corners.ravel())
    return f"{material} polygon {name} 0 0 {corners.size} {values}\n"


def write_points(scene, path):
    np.savetxt(path, scene.points, fmt="%.9g")


def command(program, scene, octree, divisions, weight):
    lights = [word for light in scene.lights for word in ("-m", light)]
    settings = ["-ad", str(divisions), "-lw", str(weight)]
    return [program, *COMMON, *settings, *lights, octree]


def read(scene, path):
    values = np.fromfile(path).reshape(len(scene.points), len(scene.lights), 3)
    return {light: values[:, index] for index, light in enumerate(scene.lights)}
