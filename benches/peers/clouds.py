"""Registers point clouds with this library, small_gicp and Open3D: a table of `cargo xtask peers`.

All start from the same arrays of points without normals and the same initial pose. The time from
the points to the pose has two parts: the normals or covariances of 20 neighbors, with the trees that
they need, and the registration, with the target's tree unless it exists by then. Point-to-plane
needs normals of the target only. The stop rule is a step below 0.1 mm and 0.01 degrees, or 100
iterations; Open3D has its own rule.
"""

import json
import math
import os
import statistics
import time
from pathlib import Path

import numpy as np
import small_gicp

SIMULATED = 5
NEIGHBORS = 20


def error(pose, truth, center):
    """Returns the rotation error (degrees) and the translation error of a point (mm)."""
    turn = pose[:3, :3].T @ truth[:3, :3]
    # The sine is precise at small angles, unlike the cosine.
    sine = np.linalg.norm([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
    angle = math.degrees(math.atan2(sine, (np.trace(turn) - 1) / 2))
    center = np.append(center, 1.0)
    return angle, float(np.linalg.norm((pose @ center - truth @ center)[:3])) * 1e3


class Pair:
    """Two clouds in a folder, with the true pose and the initial one."""

    def __init__(self, name, folder, gate):
        def points(name):
            return np.fromfile(folder / f"{name}.f32", dtype="<f4").reshape(-1, 3).astype(np.float64)

        meta = json.loads((folder / "meta.json").read_text())
        self.name, self.folder, self.gate = name, folder, gate
        self.truth, self.init = (np.array(meta[key]).reshape(4, 4) for key in ("truth", "init"))
        self.source, self.target = points("source"), points("target")

    def error(self, pose):
        return error(np.asarray(pose, dtype=np.float64).reshape(4, 4), self.truth, self.source.mean(axis=0))


def write(folder, source, target, truth):
    folder.mkdir(parents=True, exist_ok=True)
    for name, points in (("source", source), ("target", target)):
        np.ascontiguousarray(points, dtype="<f4").tofile(folder / f"{name}.f32")
    meta = {"truth": truth.ravel().tolist(), "init": np.eye(4).ravel().tolist()}
    (folder / "meta.json").write_text(json.dumps(meta))


def read_ply(path):
    """Reads the coordinates of a binary PLY file whose properties are all of type float."""
    head, body = path.read_bytes().split(b"end_header\n", 1)
    lines = head.decode().split("\n")
    count = next(int(line.split()[2]) for line in lines if line.startswith("element vertex"))
    columns = sum(line.startswith("property float") for line in lines)
    return np.frombuffer(body, "<f4", count * columns).reshape(count, columns)[:, :3]


def real_pairs(data, folder):
    """Yields the real pairs, which exist if the shared data do. They start at the identity."""
    car = data / "clouds" / "libpointmatcher_car"
    if car.is_dir():
        rows = np.loadtxt(car / "T_car400_car401.txt")
        truth = np.vstack([rows, [0, 0, 0, 1]])[:4]
        target = np.loadtxt(car / "car_cloud400.csv", delimiter=",", skiprows=1)[:, :3]
        write(folder / "car", np.loadtxt(car / "car_cloud401.csv")[:, :3], target, truth)
        yield Pair("car", folder / "car", 0.5)
    outdoor = data / "clouds" / "small_gicp_outdoor"
    if outdoor.is_dir():
        truth = np.loadtxt(outdoor / "T_target_source.txt")
        clouds = [read_ply(outdoor / f"{name}.ply") for name in ("source", "target")]
        write(folder / "outdoor", *clouds, truth)
        yield Pair("outdoor", folder / "outdoor", 1.0)
        sampled = [small_gicp.voxelgrid_sampling(points.astype(np.float64), 0.25).points()[:, :3] for points in clouds]
        write(folder / "outdoor-sampled", *sampled, truth)
        yield Pair("outdoor, cells of 0.25 m", folder / "outdoor-sampled", 1.0)


def ours(method):
    def run(pair, program):
        answer = program.send(f"run {method} {pair.gate} {pair.folder}")
        return answer["normals_ns"], answer["align_ns"], answer["iterations"], answer["pose"]

    return run


def theirs(kind):
    """small_gicp, with one thread."""

    def run(pair, _):
        begin = time.perf_counter()
        target, source = small_gicp.PointCloud(pair.target), small_gicp.PointCloud(pair.source)
        tree = small_gicp.KdTree(target, 1)
        if kind == "PLANE_ICP":
            small_gicp.estimate_normals(target, tree, NEIGHBORS, 1)
        if kind == "GICP":
            small_gicp.estimate_covariances(target, tree, NEIGHBORS, 1)
            small_gicp.estimate_covariances(source, small_gicp.KdTree(source, 1), NEIGHBORS, 1)
        prepared = time.perf_counter()
        eps = math.radians(0.01), 1e-4
        result = small_gicp.align(target, source, tree, pair.init, kind, pair.gate, 1, 100, *eps)
        end = time.perf_counter()
        # small_gicp counts from 0.
        return (prepared - begin) * 1e9, (end - prepared) * 1e9, result.iterations + 1, result.T_target_source

    return run


def open3d(o3d, kind):
    def run(pair, _):
        if not o3d:
            return None
        registration = o3d.pipelines.registration
        begin = time.perf_counter()
        target = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(pair.target))
        source = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(pair.source))
        search = o3d.geometry.KDTreeSearchParamKNN(NEIGHBORS)
        for cloud in {"point-to-plane": [target], "gicp": [source, target]}.get(kind, []):
            cloud.estimate_normals(search)
        prepared = time.perf_counter()
        criteria = registration.ICPConvergenceCriteria(1e-6, 1e-6, 100)
        if kind == "gicp":
            estimation = registration.TransformationEstimationForGeneralizedICP()
            call = registration.registration_generalized_icp
        else:
            estimation = registration.TransformationEstimationPointToPlane()
            call = registration.registration_icp
        result = call(source, target, pair.gate, pair.init, estimation, criteria)
        end = time.perf_counter()
        return (prepared - begin) * 1e9, (end - prepared) * 1e9, None, result.transformation

    return run


def report(program, data, folder, rounds, o3d):
    """Returns the table. `program` is our `peer_clouds`; `data` is the folder of the shared data."""
    rows = {
        "point-to-plane": ours("point-to-plane"),
        "small_gicp point-to-plane": theirs("PLANE_ICP"),
        "Open3D point-to-plane": open3d(o3d, "point-to-plane"),
        "gicp": ours("gicp"),
        "small_gicp GICP": theirs("GICP"),
        "Open3D GICP": open3d(o3d, "gicp"),
        "point-to-point": ours("point-to-point"),
        "small_gicp ICP": theirs("ICP"),
    }
    groups = {pair.name: [pair] for pair in real_pairs(data, folder)}
    groups["simulated"] = []
    for number in range(SIMULATED):
        program.send(f"simulate {number} {folder / str(number)}")
        groups["simulated"].append(Pair("simulated", folder / str(number), 0.03))

    lines = [
        "| clouds (points) | row | normals, ms | registration, ms | sum, ms | small_gicp : ours | iterations | error: °, mm |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name, pairs in groups.items():
        samples = {row: [[] for _ in pairs] for row in rows}
        for _ in range(rounds + 1):  # The first round warms up.
            for index, pair in enumerate(pairs):
                for row, run in rows.items():
                    samples[row][index].append(run(pair, program))
        points = statistics.median(len(cloud) for pair in pairs for cloud in (pair.source, pair.target))
        totals, own = {}, None
        for row, cases in samples.items():
            if cases[0][-1] is None:
                continue
            # Of each pair the median over the rounds, then the median over the pairs.
            def middle(value):
                return statistics.median(statistics.median(map(value, case[1:])) for case in cases)

            normals, register, total = (
                middle(value) / 1e6 for value in (lambda a: a[0], lambda a: a[1], lambda a: a[0] + a[1])
            )
            ratio = ""
            if row.startswith("small_gicp"):
                ratio = f"{total / own:.2f} ({register / own_register:.2f} without normals)"
            elif not row.startswith("Open3D"):
                own, own_register = total, register
            iterations = "" if cases[0][-1][2] is None else f"{statistics.median(c[-1][2] for c in cases):g}"
            errors = [pair.error(case[-1][3]) for pair, case in zip(pairs, cases)]
            degrees, millimeters = (statistics.median(e[i] for e in errors) for i in (0, 1))
            lines.append(
                f"| {name} ({points:,.0f}) | {row} | {normals:.1f} | {register:.1f} | {total:.1f} | {ratio} "
                f"| {iterations} | {degrees:.3f}, {millimeters:.2f} |"
            )
    return "\n".join(lines)
