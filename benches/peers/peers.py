"""Compares this library with others on the same arrays, on one core: `cargo xtask peers`.

Our program (`benches/examples/peers.rs`) creates the instances and writes them as raw arrays. Each
is an object of about 14,400 visible pixels in a 640x480 image, with a start 6.2 mm and 9.5 degrees
off. Every round runs every row once and alternates between our rows and theirs. The first round
warms up and is not counted. A row's time on an instance is the median over the rounds. The table
shows the median over the instances and the quartiles.

Only the call is timed, with its arrays in the library's own form. Search trees, like everything
else that depends on the image, are timed with the registration (column "with tree"), for our rows
and for theirs. The normals and covariances of the point-based libraries are not counted; the text
below the table states their time.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"  # Before any library reads it.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

import argparse
import json
import math
import platform
import statistics
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np
import small_gicp

try:
    import open3d as o3d
except ImportError as error:  # Its wheel requires the system's libusb-1.0, libGL and libgomp.
    print(f"peers: skipped the rows of Open3D: {error}", file=sys.stderr)
    o3d = None

import clouds
import scaling
import vsd

GATE = 0.03  # meters, as in our rows
TRANSLATION_EPS = 1e-4  # meters
ROTATION_EPS = math.radians(0.01)
MAX_ITERATIONS = 100
DATA = Path(os.environ.get("HICP_DATA", Path(__file__).resolve().parents[3] / "shared" / "data"))


class Ours:
    """Our program, which replies to one command at a time."""

    def __init__(self, *command):
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def send(self, command):
        self.process.stdin.write(command + "\n")
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        if not line:
            sys.exit(f"peers: our program ended at {command!r}")
        return json.loads(line)


class Instance:
    """The arrays of an instance, and the data that the libraries prepare from them."""

    def __init__(self, folder):
        def floats(name, columns):
            return np.fromfile(folder / f"{name}.f32", dtype="<f4").reshape(-1, columns)

        self.meta = json.loads((folder / "meta.json").read_text())
        width, height = self.meta["size"]
        self.depth = np.fromfile(folder / "depth.f32", dtype="<f4").reshape(height, width)
        self.mask = np.fromfile(folder / "mask.u8", dtype=np.uint8).reshape(height, width) > 0
        self.truth = np.array(self.meta["truth"]).reshape(4, 4)
        self.init = np.array(self.meta["init"]).reshape(4, 4)
        self.center = np.append(np.array(self.meta["center"]), 1.0)
        self.source, self.target = floats("source", 6), floats("target", 6)
        self.vertices = floats("fine_vertices", 3)
        self.triangles = np.fromfile(folder / "fine_triangles.u32", dtype="<u4").reshape(-1, 3)

        # small_gicp: clouds, with covariances and normals of 20 neighbors.
        def cloud(surfels):
            points = small_gicp.PointCloud(surfels[:, :3].astype(np.float64))
            start = time.perf_counter()
            small_gicp.estimate_normals_covariances(points, small_gicp.KdTree(points), 20, 1)
            return points, time.perf_counter() - start

        self.sg_source, source_seconds = cloud(self.source)
        self.sg_target, target_seconds = cloud(self.target)
        self.covariance_seconds = source_seconds + target_seconds

        # Open3D: clouds with our normals.
        def o3d_cloud(surfels):
            points = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(surfels[:, :3].astype(np.float64)))
            points.normals = o3d.utility.Vector3dVector(surfels[:, 3:].astype(np.float64))
            return points

        if o3d:
            self.o3_source, self.o3_target = o3d_cloud(self.source), o3d_cloud(self.target)

    def prepare_rays(self, box):
        """Creates the rays of a box of pixels through the mesh.

        The rays, not the mesh, are moved by the initial pose.
        """
        fx, fy, cx, cy = self.meta["camera"]
        u, v = np.meshgrid(np.arange(box[0], box[2]), np.arange(box[1], box[3]))
        directions = np.stack([(u - cx) / fx, (v - cy) / fy, np.ones(u.shape)], axis=-1)
        rotation, translation = self.init[:3, :3], self.init[:3, 3]
        # Directions have unit depth, so that the distance in units of their length is the depth.
        directions = directions @ rotation
        origins = np.broadcast_to(-rotation.T @ translation, directions.shape)
        self.rays = o3d.core.Tensor(np.concatenate([origins, directions], axis=-1).astype(np.float32))
        self.scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        self.scene.add_triangles(o3d.core.Tensor(self.vertices), o3d.core.Tensor(self.triangles))
        self.scene.cast_rays(self.rays, nthreads=1)

    def error(self, pose):
        """Returns the rotation error (degrees) and the translation error of the center (mm)."""
        pose = np.asarray(pose, dtype=np.float64).reshape(4, 4)
        turn = pose[:3, :3].T @ self.truth[:3, :3]
        # The sine is precise at small angles, unlike the cosine.
        sine = np.linalg.norm([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
        angle = math.degrees(math.atan2(sine, (np.trace(turn) - 1) / 2))
        return angle, float(np.linalg.norm((pose @ self.center - self.truth @ self.center)[:3])) * 1e3


def timed(call):
    start = time.perf_counter()
    result = call()
    return (time.perf_counter() - start) * 1e9, result


def small_gicp_row(kind):
    def run(instance):
        def align():
            tree = small_gicp.KdTree(instance.sg_target, 1)
            return small_gicp.align(
                instance.sg_target,
                instance.sg_source,
                tree,
                instance.init,
                kind,
                GATE,
                1,
                MAX_ITERATIONS,
                ROTATION_EPS,
                TRANSLATION_EPS,
            )

        ns, result = timed(align)
        # small_gicp counts from 0.
        return {"ns": ns, "iterations": result.iterations + 1, "pose": result.T_target_source}

    return run


def small_gicp_tree(instance):
    return {"ns": timed(lambda: small_gicp.KdTree(instance.sg_target, 1))[0], "items": len(instance.target)}


def open3d_point_to_plane(instance):
    if not o3d:
        return None
    registration = o3d.pipelines.registration
    ns, result = timed(
        lambda: registration.registration_icp(
            instance.o3_source,
            instance.o3_target,
            GATE,
            instance.init,
            registration.TransformationEstimationPointToPlane(),
            registration.ICPConvergenceCriteria(1e-6, 1e-6, MAX_ITERATIONS),
        )
    )
    return {"ns": ns, "pose": result.transformation}


def open3d_raycast(instance):
    if not o3d:
        return None
    ns, result = timed(lambda: instance.scene.cast_rays(instance.rays, nthreads=1))
    return {"ns": ns, "items": int(np.isfinite(result["t_hit"].numpy()).sum())}


def numpy_vsd(instance):
    """Computes VSD between the image and a shifted copy of it.

    The copy replaces the render of an estimate: any two depth images cost the same.
    """
    estimate = np.where(instance.mask, instance.depth + np.float32(0.004), np.float32(0.0))
    ns, errors = timed(
        lambda: vsd.vsd(instance.depth, instance.depth, estimate, instance.meta["camera"], instance.meta["diameter"])
    )
    return {"ns": ns, "score": float(np.mean(errors))}


THEIRS = {
    "small_gicp GICP": small_gicp_row("GICP"),
    "small_gicp ICP": small_gicp_row("ICP"),
    "small_gicp point-to-plane": small_gicp_row("PLANE_ICP"),
    "small_gicp tree alone": small_gicp_tree,
    "Open3D point-to-plane": open3d_point_to_plane,
    "Open3D ray casting": open3d_raycast,
    "numpy VSD": numpy_vsd,
}

# Rows of our program, by its names.
OURS = [
    "observe",
    "observe-1080",
    "render",
    "render-fine",
    "render-fine-1080",
    "mve",
    "fused",
    "projective-every-pixel",
    "projective",
    "nn-point-to-point",
    "nn-point-to-plane",
    "nn-generalized",
    "depth-to-pose/hybrid",
    "depth-to-pose/estimate",
    "depth-to-pose/projective-point-to-plane",
    "depth-to-pose/nn-point-to-point",
]

WHAT = {
    "observe": "vertex map and normals in the mask's box; items: pixels of the box",
    "observe-1080": "the same pixels in a 1920×1080 image",
    "render": "depth of the object's mesh; items: pixels shown",
    "render-fine": "depth of the mesh with 10,000 triangles",
    "render-fine-1080": "the same pixels in a 1920×1080 image",
    "mve": "MVE at ten tolerances without its render; items: pixels of the union",
    "fused": "reference: hand-written AVX2, every pixel; items: points",
    "projective-every-pixel": "the same through the traits",
    "projective": "projective point-to-plane, 2,000 points",
    "nn-point-to-point": "2,000 points against 4,000 pixels, with tree",
    "nn-point-to-plane": "2,000 points against 4,000 pixels, with tree",
    "nn-generalized": "GICP of surfels, 2,000 points against 4,000 pixels, with tree",
    "depth-to-pose/hybrid": "from depth image to pose, everything",
    "depth-to-pose/estimate": "the same without an initial pose, ended by `local`",
    "depth-to-pose/projective-point-to-plane": "from depth image to pose, everything",
    "depth-to-pose/nn-point-to-point": "from depth image to pose, everything",
    "small_gicp GICP": "2,000 points against every pixel, with tree",
    "small_gicp ICP": "2,000 points against every pixel, with tree",
    "small_gicp point-to-plane": "2,000 points against every pixel, with tree",
    "small_gicp tree alone": "over every pixel; items: points",
    "Open3D point-to-plane": "2,000 points against every pixel, with tree",
    "Open3D ray casting": "Embree, the box of render-fine; items: pixels shown",
    "numpy VSD": "bop_toolkit's definition, ten tolerances, renders not counted",
}

# Name, numerator, denominator, unit of the ratio, target.
RATIOS = [
    ("1 traits : hand-fused, per pixel and iteration", "projective-every-pixel", "fused", "iteration", "≤ 3, aim 1.5"),
    ("2 small_gicp ICP : nn-point-to-point", "small_gicp ICP", "nn-point-to-point", None, ""),
    ("3 small_gicp GICP : hybrid from depth to pose", "small_gicp GICP", "depth-to-pose/hybrid", None, "≥ 3"),
    ("3 small_gicp GICP : estimate from depth to pose", "small_gicp GICP", "depth-to-pose/estimate", None, ""),
    ("3 hybrid : projective point-to-plane, depth to pose", "depth-to-pose/hybrid", "depth-to-pose/projective-point-to-plane", None, "paper 8.9"),
    ("4 Open3D ray casting : render-fine", "Open3D ray casting", "render-fine", None, "≥ 3, aim 5"),
    ("4 render-fine at 1920×1080 : 640×480", "render-fine-1080", "render-fine", None, "≤ 1.1"),
    ("5 observation at 1920×1080 : 640×480", "observe-1080", "observe", None, ""),
    ("5 numpy VSD : mve", "numpy VSD", "mve", None, "≥ 100"),
    ("Open3D point-to-plane : nn-point-to-plane", "Open3D point-to-plane", "nn-point-to-plane", None, ""),
    ("small_gicp GICP : nn-generalized", "small_gicp GICP", "nn-generalized", None, ""),
]


def measure(ours, folder, count, rounds):
    """Measures every row on every instance.

    Returns, by row, a list over the instances of {ns, items, iterations, error}, and the median
    time of the covariances in seconds.
    """
    results = {row: [] for row in [*THEIRS, *OURS]}
    covariances = []
    for number in range(count):
        ours.send(f"load {number}")
        instance = Instance(folder / str(number))
        covariances.append(instance.covariance_seconds)
        if o3d:
            instance.prepare_rays(ours.send("run render-fine")["box"])
        samples = {row: [] for row in results}
        theirs = list(THEIRS.items())
        for _ in range(rounds + 1):
            for index, row in enumerate(OURS):
                if index < len(theirs):
                    samples[theirs[index][0]].append(theirs[index][1](instance))
                samples[row].append(ours.send(f"run {row}"))
        for row, answers in samples.items():
            if answers[-1] is None:
                continue
            last = answers[-1]
            results[row].append(
                {
                    "ns": statistics.median(answer["ns"] for answer in answers[1:]),
                    "items": last.get("items"),
                    "iterations": last.get("iterations"),
                    "error": instance.error(last["pose"]) if "pose" in last else None,
                }
            )
        print(f"peers: instance {number + 1} of {count}", file=sys.stderr)
    return results, statistics.median(covariances)


def quartiles(values):
    if len(values) < 2:
        return values[0], values[0], values[0]
    low, middle, high = statistics.quantiles(values, n=4, method="inclusive")
    return low, middle, high


def table(results):
    lines = [
        "| row | what | ms, median (quartiles) | ns per item | iterations | error: °, mm |",
        "|---|---|---|---|---|---|",
    ]
    for row, cases in results.items():
        if not cases:
            lines.append(f"| {row} | {WHAT[row]} | not measured | | | |")
            continue
        low, middle, high = quartiles([case["ns"] / 1e6 for case in cases])
        per_item = iterations = error = ""
        if cases[0]["iterations"] is not None:
            iterations = f"{statistics.median(case['iterations'] for case in cases):g}"
        if cases[0]["items"]:
            share = [case["ns"] / case["items"] / (case["iterations"] or 1) for case in cases]
            per_item = f"{statistics.median(share):.1f}"
            if cases[0]["iterations"] is not None:
                per_item += " per iteration"
        if cases[0]["error"] is not None:
            degrees, millimeters = (statistics.median(case["error"][i] for case in cases) for i in (0, 1))
            error = f"{degrees:.3f}, {millimeters:.3f}"
        lines.append(
            f"| {row} | {WHAT[row]} | {middle:.3f} ({low:.3f}–{high:.3f}) | {per_item} | {iterations} | {error} |"
        )
    return "\n".join(lines)


def ratios(results):
    lines = ["| ratio | median (quartiles) over the instances | target |", "|---|---|---|"]
    for name, above, below, per, wanted in RATIOS:
        values = []
        for a, b in zip(results[above], results[below]):
            value = a["ns"] / b["ns"]
            if per == "iteration":
                value *= b["iterations"] / a["iterations"]
            values.append(value)
        if values:
            low, middle, high = quartiles(values)
            lines.append(f"| {name} | {middle:.2f} ({low:.2f}–{high:.2f}) | {wanted} |")
        else:
            lines.append(f"| {name} | not measured | {wanted} |")
    return "\n".join(lines)


def processor():
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--target", type=Path, required=True, help="the folder of build artifacts")
    parser.add_argument("--instances", type=int, default=20)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--noise", type=float, default=0.0, help="depth noise, percent of the depth")
    parser.add_argument("--clouds", action="store_true", help="only the table of point clouds")
    parser.add_argument("--no-scaling", action="store_true", help="skip the measurements of `bop refine`")
    arguments = parser.parse_args()
    vsd.check()
    work = arguments.target / "peers"
    programs = arguments.target / "release"

    text = [
        f"One core of {processor()}; {arguments.instances} instances, depth noise {arguments.noise:g} %, "
        f"median of {arguments.rounds} rounds each. Python {platform.python_version()}, numpy {np.__version__}, "
        f"Open3D {o3d.__version__ if o3d else 'missing'}, small_gicp {version('small_gicp')}."
    ]
    arguments.no_scaling |= arguments.clouds
    if not arguments.no_scaling:
        scaled = scaling.report(programs, work / "scaling")  # Before this process is limited to one core.
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})  # Our program inherits it.
    program = programs / "examples"
    if not arguments.clouds:
        folder = work / "instances"
        ours = Ours(program / "peers", folder, str(arguments.noise))
        results, covariances = measure(ours, folder, arguments.instances, arguments.rounds)
        text += [
            table(results),
            f"Not counted: normals and covariances of small_gicp's two clouds, {covariances * 1e3:.1f} ms (its GICP "
            "needs them; ours uses the surfels' normals, which `observe` computes).",
            ratios(results),
        ]
    text.append(clouds.report(Ours(program / "peer_clouds"), DATA, work / "clouds", arguments.rounds, o3d))
    if not arguments.no_scaling:
        text.append(scaled)
    document = "\n\n".join(text) + "\n"
    (work / "peers.md").write_text(document)
    print(document)


if __name__ == "__main__":
    main()
