"""Compares the errors and recalls of `hybrid-icp bop eval` with a separate implementation.

    python bop_errors.py --dataset DIR --results FILE.csv --errors ERRORS.csv --report REPORT.json

`bop eval --errors ERRORS.csv --json REPORT.json` writes ERRORS.csv and REPORT.json for FILE.csv.

This script follows the definitions and shares no code with the program. It reads meshes, PNGs, JSON
and the result file itself, and uses the poses as the file states them. It renders depth by
intersecting the ray of every pixel center with the plane of every triangle around it, and computes
ADI over all pairs of vertices. It needs numpy only.

The script fails in three cases:

- MSSD, MSPD, ADD or ADI differ by more than 1e-3 of their value.
- The share of pixels that VSD counts differently exceeds --vsd-tolerance for any estimate and
  tolerance.
- A recall differs although all errors lie on the same side of every threshold.
"""

import argparse
import csv
import json
import math
import struct
import sys
import zlib
from pathlib import Path

import numpy as np

TOLERANCES = [k * 0.05 for k in range(1, 11)]
RELATIVE = 1e-3
# Differences below this many millimeters or pixels come from rounding to nine printed digits.
ABSOLUTE = 1e-6


def read_ply(path):
    """Returns the vertices (n, 3) and triangles (m, 3) of an ASCII or little-endian PLY file."""
    data = path.read_bytes()
    head, body = data.split(b"end_header\n", 1) if b"end_header\n" in data else data.split(b"end_header\r\n", 1)
    kind, elements = None, []
    for line in head.decode("ascii").splitlines():
        words = line.split()
        if words[:1] == ["format"]:
            kind = words[1]
        elif words[:1] == ["element"]:
            elements.append((words[1], int(words[2]), []))
        elif words[:1] == ["property"]:
            elements[-1][2].append(words[1:])
    sizes = {"char": "b", "uchar": "B", "int8": "b", "uint8": "B", "short": "h", "ushort": "H", "int": "i", "int32": "i",
             "uint": "I", "uint32": "I", "float": "f", "float32": "f", "double": "d", "float64": "d"}
    vertices, triangles = [], []
    words, place = (iter(body.split()), None) if kind == "ascii" else (None, 0)

    def value(type_name):
        nonlocal place
        if words is not None:
            return float(next(words))
        code = "<" + sizes[type_name]
        (number,) = struct.unpack_from(code, body, place)
        place += struct.calcsize(code)
        return number

    for name, count, properties in elements:
        for _ in range(count):
            row = {}
            for prop in properties:
                if prop[0] == "list":
                    row[prop[3]] = [value(prop[2]) for _ in range(int(value(prop[1])))]
                else:
                    row[prop[1]] = value(prop[0])
            if name == "vertex":
                vertices.append((row["x"], row["y"], row["z"]))
            elif name == "face":
                corners = [int(i) for i in next(v for v in row.values() if isinstance(v, list))]
                triangles += [(corners[0], corners[i], corners[i + 1]) for i in range(1, len(corners) - 1)]
    return np.array(vertices), np.array(triangles)


def read_png16(path):
    """Returns the pixels of a 16-bit gray PNG without interlacing."""
    data = path.read_bytes()
    place, packed = 8, b""
    while place < len(data):
        (length,) = struct.unpack_from(">I", data, place)
        tag, chunk = data[place + 4:place + 8], data[place + 8:place + 8 + length]
        if tag == b"IHDR":
            width, height, bits, color, _, _, interlace = struct.unpack(">IIBBBBB", chunk)
            assert (bits, color, interlace) == (16, 0, 0), f"{path}: not a 16-bit gray PNG without interlacing"
        elif tag == b"IDAT":
            packed += chunk
        place += 12 + length
    raw, stride = zlib.decompress(packed), 2 * width
    above, rows = bytearray(stride), []
    for v in range(height):
        kind = raw[v * (stride + 1)]
        line = bytearray(raw[v * (stride + 1) + 1:(v + 1) * (stride + 1)])
        for i in range(stride if kind else 0):
            a, b = (line[i - 2] if i >= 2 else 0), above[i]
            if kind == 1:
                guess = a
            elif kind == 2:
                guess = b
            elif kind == 3:
                guess = (a + b) // 2
            else:
                c = above[i - 2] if i >= 2 else 0
                p = a + b - c
                guess = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
            line[i] = (line[i] + guess) & 255
        rows.append(np.frombuffer(bytes(line), ">u2"))
        above = line
    return np.array(rows, dtype=np.float64)


def render(vertices, triangles, pose, k, shape):
    """Returns a depth image: the nearest triangle at every pixel center, 0 without one."""
    rotation, translation = pose
    points = vertices @ rotation.T + translation
    depth = np.full(shape, np.inf)
    u = k[0, 0] * points[:, 0] / points[:, 2] + k[0, 2]
    v = k[1, 1] * points[:, 1] / points[:, 2] + k[1, 2]
    for corners in triangles:
        a, b, c = points[corners]
        if min(a[2], b[2], c[2]) <= 0:
            continue
        u0, u1 = max(math.ceil(u[corners].min()), 0), min(math.floor(u[corners].max()), shape[1] - 1)
        v0, v1 = max(math.ceil(v[corners].min()), 0), min(math.floor(v[corners].max()), shape[0] - 1)
        if u0 > u1 or v0 > v1:
            continue
        normal = np.cross(b - a, c - a)
        uu, vv = np.meshgrid(np.arange(u0, u1 + 1), np.arange(v0, v1 + 1))
        rays = np.stack([(uu - k[0, 2]) / k[0, 0], (vv - k[1, 2]) / k[1, 1], np.ones(uu.shape)], axis=-1)
        # The ray is inside if the volumes that it spans with the three edges have the same sign.
        sides = [rays @ np.cross(p, q) for p, q in ((a, b), (b, c), (c, a))]
        inside = np.all([s >= 0 for s in sides], axis=0) | np.all([s <= 0 for s in sides], axis=0)
        slope = rays @ normal
        with np.errstate(divide="ignore", invalid="ignore"):
            z = (a @ normal) / slope
        window = depth[v0:v1 + 1, u0:u1 + 1]
        hit = inside & (slope != 0) & (z > 0)
        window[hit] = np.minimum(window[hit], z[hit])
    depth[np.isinf(depth)] = 0
    return depth


def distances(depth, k):
    v, u = np.mgrid[:depth.shape[0], :depth.shape[1]]
    return depth * np.sqrt(((u - k[0, 2]) / k[0, 0]) ** 2 + ((v - k[1, 2]) / k[1, 1]) ** 2 + 1)


def vsd(test, estimate, truth, poses, k, diameter, delta):
    """Returns the error for every tolerance, and the number of pixels in the union."""
    (_, t_e), (_, t_g) = poses
    between = np.linalg.norm(t_e[:2] / t_e[2] - t_g[:2] / t_g[2])
    if between >= diameter / 2 * (1 / t_e[2] + 1 / t_g[2]):
        return [1.0] * 10, 1
    test, estimate, truth = (distances(image, k) for image in (test, estimate, truth))

    def visible(model):
        behind = model.astype(np.float32) - test.astype(np.float32)
        return (model > 0) & ((behind <= delta) | (test == 0))

    seen_truth = visible(truth)
    seen_estimate = visible(estimate) | (seen_truth & (estimate > 0))
    union, both = (seen_truth | seen_estimate).sum(), seen_truth & seen_estimate
    if union == 0:
        return [1.0] * 10, 1
    apart = np.abs(truth - estimate)[both] / diameter
    return [((apart >= t).sum() + union - both.sum()) / union for t in TOLERANCES], union


def symmetries(info):
    """Returns BOP's symmetry motions, including the identity.

    These are all steps of every continuous symmetry after every discrete one.
    """
    discrete = [(np.eye(3), np.zeros(3))]
    for numbers in info.get("symmetries_discrete", []):
        m = np.array(numbers, dtype=float).reshape(4, 4)
        discrete.append((m[:3, :3], m[:3, 3]))
    steps = math.ceil(math.pi / 0.01)
    motions = []
    for entry in info.get("symmetries_continuous", []):
        axis, offset = np.array(entry["axis"], dtype=float), np.array(entry["offset"], dtype=float)
        x, y, z = axis / np.linalg.norm(axis)
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        for step in range(steps):
            angle = 2 * math.pi * step / steps
            turn = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
            motions += [(turn @ r, turn @ t + offset - turn @ offset) for r, t in discrete]
    return motions or discrete


def project(points, k):
    return points[:, :2] / points[:, 2:] * [k[0, 0], k[1, 1]] + [k[0, 2], k[1, 2]]


def point_errors(vertices, motions, estimate, truth, k):
    """Returns MSSD, MSPD, ADD and ADI in millimeters and pixels."""
    (r_e, t_e), (r_g, t_g) = estimate, truth
    estimated, true = vertices @ r_e.T + t_e, vertices @ r_g.T + t_g
    surface, image = [], []
    for r_s, t_s in motions:
        same = (vertices @ r_s.T + t_s) @ r_g.T + t_g
        surface.append(np.linalg.norm(estimated - same, axis=1).max())
        image.append(np.linalg.norm(project(estimated, k) - project(same, k), axis=1).max())
    nearest = [np.sqrt(((estimated[None] - part[:, None]) ** 2).sum(-1).min(1)) for part in np.array_split(true, 32)]
    add = np.linalg.norm(estimated - true, axis=1).mean()
    return min(surface), min(image), add, np.concatenate(nearest).mean()


def matched(errors, threshold):
    """Returns the number of instances found.

    Each estimate, by descending score, takes the free instance with the smallest error.
    """
    free = set(range(errors.shape[1]))
    for row in errors:
        least = min(free, key=lambda i: row[i], default=None)
        if least is not None and row[least] < threshold:
            free.remove(least)
    return errors.shape[1] - len(free)


def pose(rotation, translation):
    return np.array(rotation, dtype=float).reshape(3, 3), np.array(translation, dtype=float)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--dataset", type=Path, required=True)
    parser.add_argument("--split", default="test")
    parser.add_argument("--results", type=Path, required=True)
    parser.add_argument("--errors", type=Path, required=True)
    parser.add_argument("--report", type=Path, required=True)
    parser.add_argument("--delta", type=float, default=15.0)
    parser.add_argument("--vsd-tolerance", type=float, default=5e-4)
    options = parser.parse_args()

    models_dir = next(d for d in (options.dataset / "models_eval", options.dataset / "models") if d.is_dir())
    infos = json.loads((models_dir / "models_info.json").read_text())
    targets = json.loads((options.dataset / "test_targets_bop19.json").read_text())
    with open(options.results, newline="") as file:
        rows = list(csv.DictReader(file))
    with open(options.errors, newline="") as file:
        stated = {(int(line["row"]), int(line["gt"])): line for line in csv.DictReader(file)}
    report = json.loads(options.report.read_text())

    models, scenes, images = {}, {}, {}
    worst = dict.fromkeys(["mssd_mm", "mspd_px", "add_mm", "adi_mm"], 0.0)
    worst_vsd, differing, pixels, values = 0.0, 0, 0, 0
    found = {name: 0 for name in ("vsd", "mssd", "mspd", "ad")}
    wanted, compared = 0, set()
    for target in targets:
        scene_id, im_id, obj_id, count = (target[key] for key in ("scene_id", "im_id", "obj_id", "inst_count"))
        folder = options.dataset / options.split / f"{scene_id:06}"
        if scene_id not in scenes:
            names = ("scene_camera", "scene_gt", "scene_gt_info")
            scenes[scene_id] = [json.loads((folder / f"{name}.json").read_text()) for name in names]
        cameras, truths, visibilities = (part[str(im_id)] for part in scenes[scene_id])
        if (scene_id, im_id) not in images:
            images[scene_id, im_id] = read_png16(folder / f"depth/{im_id:06}.png") * cameras["depth_scale"]
        test, k = images[scene_id, im_id], np.array(cameras["cam_K"]).reshape(3, 3)
        if obj_id not in models:
            models[obj_id] = read_ply(models_dir / f"obj_{obj_id:06}.ply")
        (vertices, triangles), info = models[obj_id], infos[str(obj_id)]
        diameter, motions = info["diameter"], symmetries(info)

        instances = [i for i, t in enumerate(truths) if t["obj_id"] == obj_id]
        instances = sorted(instances, key=lambda i: -visibilities[i]["visib_fract"])[:count]
        of_target = [i for i, row in enumerate(rows)
                     if [int(row[key]) for key in ("scene_id", "im_id", "obj_id")] == [scene_id, im_id, obj_id]]
        of_target = sorted(of_target, key=lambda i: -float(rows[i]["score"]))[:count]
        true_poses = [pose(truths[i]["cam_R_m2c"], truths[i]["cam_t_m2c"]) for i in instances]
        true_depths = [render(vertices, triangles, p, k, test.shape) for p in true_poses]
        errors = {name: np.full((len(of_target), len(instances)), np.inf) for name in ("mssd", "mspd", "ad")}
        of_vsd = np.full((len(of_target), len(instances), 10), np.inf)
        for e, index in enumerate(of_target):
            estimate = pose(rows[index]["R"].split(), rows[index]["t"].split())
            depth = render(vertices, triangles, estimate, k, test.shape)
            for i, instance in enumerate(instances):
                truth = true_poses[i]
                line = stated[index, instance]
                compared.add((index, instance))
                of_vsd[e, i], union = vsd(test, depth, true_depths[i], (estimate, truth), k, diameter, options.delta)
                for percent, error in zip(range(5, 55, 5), of_vsd[e, i]):
                    difference = abs(float(line[f"vsd_{percent}"]) - error)
                    worst_vsd = max(worst_vsd, difference)
                    differing += difference > 1e-12
                    pixels, values = max(pixels, round(difference * union)), values + 1
                mssd, mspd, add, adi = point_errors(vertices, motions, estimate, truth, k)
                for name, error in zip(worst, (mssd, mspd, add, adi)):
                    difference = abs(float(line[name]) - error)
                    if difference > ABSOLUTE:
                        worst[name] = max(worst[name], difference / max(error, 1e-12))
                near = np.linalg.norm(estimate[1] - truth[1]) < diameter
                errors["mspd"][e, i] = mspd * 640 / test.shape[1] / 100
                if near:
                    errors["mssd"][e, i] = mssd / diameter
                    errors["ad"][e, i] = (adi if len(motions) > 1 else add) / diameter
        wanted += len(instances)
        for threshold in TOLERANCES:
            found["vsd"] += sum(matched(of_vsd[:, :, tau], threshold) for tau in range(10))
            found["mssd"] += matched(errors["mssd"], threshold)
            found["mspd"] += matched(errors["mspd"], threshold)
        found["ad"] += matched(errors["ad"], 0.1)

    recalls = {"ar_vsd": found["vsd"] / wanted / 100, "ar_mssd": found["mssd"] / wanted / 10,
               "ar_mspd": found["mspd"] / wanted / 10, "ad_recall": found["ad"] / wanted}
    recalls["ar"] = (recalls["ar_vsd"] + recalls["ar_mssd"] + recalls["ar_mspd"]) / 3
    print(f"{options.results.name}: {len(compared)} pairs of {wanted} instances")
    print("  largest relative difference: " + ", ".join(f"{name} {value:.1e}" for name, value in worst.items()))
    print(f"  VSD: {differing} of {values} values differ, by {worst_vsd:.1e} or {pixels} pixels at most")
    print("  recalls: " + ", ".join(f"{name} {value:.4f} (program {report[name]:.4f})" for name, value in recalls.items()))

    failures = [f"{name} differs by {value:.1e}, expected at most {RELATIVE}" for name, value in worst.items()
                if not value <= RELATIVE]
    if worst_vsd > options.vsd_tolerance:
        failures.append(f"VSD differs by {worst_vsd:.1e}, expected at most {options.vsd_tolerance}")
    if compared != set(stated):
        failures.append(f"the program compared {len(stated)} pairs, expected {len(compared)}")
    if report["targets"] != wanted:
        failures.append(f"the program counts {report['targets']} instances, expected {wanted}")
    for name, value in recalls.items():
        # A pixel may move one VSD across one of its 100 thresholds. Nothing else may differ.
        slack = {"ar_vsd": 0.01 / wanted, "ar": 0.01 / wanted / 3}.get(name, 0.0) + 1e-12
        if abs(report[name] - value) > slack:
            failures.append(f"{name} is {report[name]}, expected {value}")
    for failure in failures:
        print(f"  FAILED: {failure}", file=sys.stderr)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
