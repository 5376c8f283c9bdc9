"""Mitsuba 3: irradiance at points by every light, path traced on the CPU (llvm_ad_rgb, one thread).

A path starts at every sample of every point, as if the point were white, and goes on by cosine-weighted
directions; at each of its ends one shadow ray goes to each lamp, and what it brings is booked under
that lamp, so that one set of paths serves all lights (faster by far than a render for each). Mitsuba's
own kernels trace the rays; the loop is recorded once, compiled to one LLVM kernel and run over all
samples at once. Paths end by Russian roulette, from a depth that is part of the sweep.

    mitsuba_points.py DATA SCENE SAMPLES ROULETTE_DEPTH OUT.npy

writes irradiance (points x lights x RGB) and prints the user CPU seconds of importing, of loading, of
the first run with one sample, which compiles, and of the run itself, as JSON.
"""

import json
import resource
import sys
from pathlib import Path


def user_seconds():
    return resource.getrusage(resource.RUSAGE_SELF).ru_utime


START = user_seconds()

import drjit as dr
import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")
dr.set_thread_count(1)
IMPORTED = user_seconds()

import scene as scenes

MOST_DEPTH = 64


class Lamp:
    """A parallelogram that radiates 1/pi from its front."""

    def __init__(self, corners):
        a, b, _, d = corners
        self.origin, self.s, self.t = (mi.Vector3f(*map(float, v)) for v in (a, b - a, d - a))
        normal = np.cross(b - a, d - a)
        self.area = float(np.linalg.norm(normal))
        self.normal = mi.Vector3f(*map(float, normal / self.area))

    def point(self, at):
        return mi.Point3f(self.origin + self.s * at.x + self.t * at.y)


def build(scene):
    """The scene for Mitsuba, and the lamps of every light."""
    shapes, lamps = {"type": "scene"}, {light: [] for light in scene.lights}
    for number, (name, corners) in enumerate(scene.polygons):
        material = scene.materials[name]
        properties = mi.Properties()
        reflectance = {"type": "rgb", "value": material.reflectance}
        diffuse = {"type": "diffuse", "reflectance": reflectance}
        properties["bsdf"] = mi.load_dict({"type": "twosided", "bsdf": diffuse})
        faces = [(0, i, i + 1) for i in range(1, len(corners) - 1)]
        mesh = mi.Mesh(f"p{number}", len(corners), len(faces), props=properties)
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = corners.astype(np.float32).ravel()
        parameters["faces"] = np.array(faces, np.uint32).ravel()
        parameters.update()
        shapes[f"p{number}"] = mesh
        if material.emits:
            lamps[name].append(Lamp(corners))
    return mi.load_dict(shapes), list(lamps.values())


def trace(shapes, lamps, points, samples, roulette_depth, seed):
    count = len(points) * samples
    sampler = mi.load_dict({"type": "independent", "sample_count": samples})
    sampler.seed(seed, count)
    index = dr.arange(mi.UInt32, count) // samples
    table = mi.Float(points.astype(np.float32).ravel())
    column = lambda c: dr.gather(mi.Float, table, index * 6 + c)
    position = mi.Point3f(column(0), column(1), column(2))
    normal = dr.normalize(mi.Vector3f(column(3), column(4), column(5)))
    sums = dr.zeros(mi.Float, len(points) * len(lamps) * 3)

    def spawn(position, normal):
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.p, si.n = position, normal
        return si

    def next_event(position, normal, weight, active, at, lamp, light):
        """Books the irradiance by one point of a lamp, times the weight."""
        target = lamp.point(at)
        ray = target - position
        square = dr.squared_norm(ray)
        here, there = dr.dot(ray, normal), -dr.dot(ray, lamp.normal)
        faces = active & (here > 0) & (there > 0)
        seen = faces & ~shapes.ray_test(spawn(position, normal).spawn_ray_to(target), faces)
        # Radiance 1/pi; the weight is reflectance over all bounces.
        factor = here * there * lamp.area / (dr.pi * dr.square(square))
        first = (index * len(lamps) + light) * 3
        for channel in range(3):
            value = weight[channel] * factor / samples
            dr.scatter_reduce(dr.ReduceOp.Add, sums, value, first + channel, seen)

    def step(position, normal, weight, depth, active, sampler):
        at = sampler.next_2d(active)
        for light, of_light in enumerate(lamps):
            for lamp in of_light:
                next_event(position, normal, weight, active, at, lamp, light)
        local = mi.warp.square_to_cosine_hemisphere(sampler.next_2d(active))
        ray = spawn(position, normal).spawn_ray(mi.Frame3f(normal).to_world(local))
        found = shapes.ray_intersect_preliminary(ray, coherent=False, active=active)
        hit = found.compute_surface_interaction(ray, mi.RayFlags.Minimal, active)
        active &= hit.is_valid()
        hit.wi = mi.Vector3f(0, 0, 1)
        weight = weight * hit.bsdf().eval_diffuse_reflectance(hit, active)
        normal = dr.select(dr.dot(hit.n, ray.d) > 0, -hit.n, hit.n)
        depth += 1
        active &= (dr.max(weight) > 0) & (depth < MOST_DEPTH)
        survival = dr.minimum(dr.max(weight), 0.95)
        plays = depth >= roulette_depth
        active &= ~plays | (sampler.next_1d(active) < survival)
        weight = dr.select(plays, weight / survival, weight)
        return hit.p, mi.Vector3f(normal), weight, depth, active, sampler

    state = (position, normal, mi.Color3f(1), mi.UInt32(0), mi.Bool(True), sampler)
    dr.while_loop(state, lambda *state: state[4], step)
    return np.array(sums).reshape(len(points), len(lamps), 3)


def main(data, name, samples, roulette_depth, out):
    scene = scenes.load(Path(data), name)
    shapes, lamps = build(scene)
    loaded = user_seconds()
    trace(shapes, lamps, scene.points, 1, roulette_depth, 0)
    compiled = user_seconds()
    found = trace(shapes, lamps, scene.points, samples, roulette_depth, 1)
    done = user_seconds()
    np.save(out, found)
    seconds = {
        "import": IMPORTED - START,
        "load": loaded - IMPORTED,
        "compile": compiled - loaded,
        "run": done - compiled,
    }
    print(json.dumps(seconds))


if __name__ == "__main__":
    data, name, samples, depth, out = sys.argv[1:]
    main(data, name, int(samples), int(depth), out)
