"""Scenes, points and reference values of the data folder, and the norm that all are judged by."""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np


@dataclass
class Material:
    reflectance: list
    radiance: list

    @property
    def emits(self):
        return any(self.radiance)


@dataclass
class Scene:
    name: str
    obj: Path
    points_csv: Path
    materials: dict  # Material by name, in the file's order
    polygons: list  # (name of the material, vertices as an n x 3 array)
    points: np.ndarray  # x, y, z, nx, ny, nz
    truth: dict  # irradiance by light, points x RGB

    @property
    def lights(self):
        return list(self.truth)


def load(data, name):
    folder, truth = data / "scenes" / name, data / "truth" / name
    points_csv = truth / "points.csv"
    return Scene(
        name=name,
        obj=folder / "scene.obj",
        points_csv=points_csv,
        materials=_materials(folder / "scene.mtl"),
        polygons=_polygons(folder / "scene.obj"),
        points=np.loadtxt(points_csv, delimiter=",", skiprows=1),
        truth=irradiance(truth / "truth.csv"),
    )


def _words(path):
    with open(path) as file:
        yield from (line.split() for line in file if line.strip())


def _materials(path):
    materials = {}
    for key, *values in _words(path):
        if key == "newmtl":
            material = materials[values[0]] = Material([0.0] * 3, [0.0] * 3)
        elif key == "Kd":
            material.reflectance = [float(v) for v in values]
        elif key == "Ke":
            material.radiance = [float(v) for v in values]
    return materials


def _polygons(path):
    vertices, polygons, material = [], [], None
    for key, *values in _words(path):
        if key == "v":
            vertices.append([float(v) for v in values[:3]])
        elif key == "usemtl":
            material = values[0]
        elif key == "f":
            corners = [vertices[int(v.split("/")[0]) - 1] for v in values]
            polygons.append((material, np.array(corners)))
    return polygons


def irradiance(path):
    """Irradiance by light from a CSV with the columns light, er, eg, eb, point by point."""
    values = {}
    with open(path) as file:
        for row in csv.DictReader(file):
            values.setdefault(row["light"], []).append([float(row[c]) for c in ("er", "eg", "eb")])
    return {light: np.array(rows) for light, rows in values.items()}


def error(found, truth):
    """`sqrt(mean (a - t)^2 / mean t^2)` over points and channels, the mean of all lights."""
    of_light = [
        np.sqrt(np.mean((found[light] - t) ** 2) / np.mean(t**2)) for light, t in truth.items()
    ]
    return float(np.mean(of_light))
