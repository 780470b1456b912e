# SPDX-License-Identifier: Apache-2.0
"""docs/reference/field-format.md against the fields of make_library_study. Usage: test_field_format.py PAGE

AF_LIBRARY_STUDY names the study's folder, AF_PROGRAMS that of the programs.
"""

import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import h5py
import numpy as np

STUDY = Path(os.environ["AF_LIBRARY_STUDY"])
# Together they have every dataset that a file can have.
FIELDS = ("AP.af.h5", "AP.bone.af.h5", "AP.standard.af.h5", "AP.atlas.af.h5")
EXAMPLE = Path(__file__).parents[2] / "examples" / "decode_viewpoint.py"
PAGE = Path(sys.argv.pop(1)).read_text(encoding="utf-8")
# So close to the middle between two nodes, rounding decides which one is nearest. Positions below 1e4 mm are rounded to
# 2e-12 mm, some ten times on their way to a node's number, and nodes are more than 1 mm apart.
TIE_NODES = 1e-9


def rows_below(head):
    """The cells in these columns of the page's tables that begin with them, row by row."""
    rows, is_table = [], False
    for line in PAGE.splitlines():
        is_table = line.startswith(head) or (is_table and line.startswith("|"))
        if is_table and line.startswith("| `"):
            rows.append([cell.strip(" `") for cell in line.split("|")[1 : head.count("|")]])
    return rows


DATASETS = {name: rest for name, *rest in rows_below("| Dataset | Type | Extents | Unit | Frame |")}
ATTRIBUTES = rows_below("| Attribute | Of | Type |")


def objects_below(group):
    found = []
    group.visititems(lambda _, item: found.append(item))
    return found


def datasets_below(group):
    return [item for item in objects_below(group) if isinstance(item, h5py.Dataset)]


def name_on_page(item):
    """The object's name in a field of one slab, which the page uses."""
    return re.sub(r"/slab_\d+", "/slab_0", re.sub(r"^/member_\d+/", "/", item.name))


def type_of(values):
    return "text" if values.dtype.kind == "S" else values.dtype.name


def extents_of(dataset):
    """The shape, or for a text its number of bytes."""
    return (dataset.dtype.itemsize,) if type_of(dataset) == "text" else dataset.shape


def tiles_of(slab):
    """The numbers of tiles along the axes of a slab."""
    geometry = slab.parent.parent["geometry"]
    u, v = geometry["uv_nodes"][:]
    _, s, _, t = geometry[Path(slab.name).name]["stored_range"][:]
    return {axis: (int(nodes) + 1) // 2 for axis, nodes in zip("uvst", (u, v, s, t))}


def sha256_of(dataset):
    values = dataset[()]
    is_text = type_of(dataset) == "text"
    data = values.ljust(dataset.dtype.itemsize, b"\0") if is_text else values.tobytes()
    return hashlib.sha256(data).hexdigest()


def sha256_of_tiles(slab):
    codewords = slab["codewords"][:]
    if "means" not in slab:
        return hashlib.sha256(codewords.tobytes()).hexdigest()
    means = slab["means"][:]
    for t in range(means.shape[2]):
        if t % 16 != 0:
            means[:, :, t] += means[:, :, t - 1]
    rows = np.stack([codewords, means.swapaxes(2, 3)], axis=3)
    return hashlib.sha256(rows.tobytes()).hexdigest()


def payload_lines(group, *parts):
    """The lines of a file's root or of a member, in the order of the page."""
    page = list(DATASETS)

    def place(dataset):
        slab = re.search(r"/slab_(\d+)/", dataset.name)
        return int(slab.group(1)) if slab else -1, page.index(name_on_page(dataset))

    for part in parts:
        for dataset in sorted(datasets_below(group[part]), key=place):
            yield payload_line(dataset.name, type_of(dataset), extents_of(dataset), sha256_of(dataset))


def payload_line(name, type_name, extents, sha256):
    return " ".join([name, type_name, *map(str, extents), sha256]) + "\n"


def payload_text(file):
    fields = [file]
    if "member_count" in file:
        count = file["member_count"]
        fields = [file[f"member_{i}"] for i in range(count[0])]
        lines = [payload_line(count.name, type_of(count), count.shape, sha256_of(count))]
        lines += payload_lines(file, "identity", "codebook")
        for member in fields:
            lines += payload_lines(member, "geometry", "identity")
    else:
        lines = list(payload_lines(file, "geometry", "identity", "codebook"))
    for field in fields:
        for k in range(field["geometry/slab_count"][0]):
            slab = field[f"field/slab_{k}"]
            tiles = tiles_of(slab)
            tiles["s"] *= 2 if "means" in slab else 1
            lines.append(payload_line(slab.name, "uint16", tiles.values(), sha256_of_tiles(slab)))
    return "".join(lines)


class FieldFormatTest(unittest.TestCase):
    def setUp(self):
        self.files = [h5py.File(STUDY / name) for name in FIELDS]
        for file in self.files:
            self.addCleanup(file.close)

    def test_page_names_exactly_the_datasets_of_written_files(self):
        found = {name_on_page(item) for file in self.files for item in datasets_below(file)}
        self.assertEqual(found, set(DATASETS))

    def test_datasets_are_what_the_page_says(self):
        for file in self.files:
            for dataset in datasets_below(file):
                type_name, extents, unit, frame = DATASETS[name_on_page(dataset)]
                with self.subTest(file=file.filename, dataset=dataset.name):
                    self.assertEqual(type_of(dataset), type_name)
                    self.assertEqual(dataset.attrs["units"].decode(), unit)
                    self.assertEqual(dataset.attrs["frame"].decode(), frame)
                    tiles = tiles_of(dataset.parent) if "/field/" in dataset.name else {}
                    stated = [tiles.get(n) or int(n) for n in extents.replace("up to ", "").split(" x ")]
                    found = list(extents_of(dataset))
                    if extents.startswith("up to "):
                        self.assertTrue(1 <= found[0] <= stated[0], found)
                        found[0] = stated[0]
                    self.assertEqual(found, stated)

    def test_page_names_exactly_the_attributes_of_written_files(self):
        for file in self.files:
            for item in [file, *objects_below(file)]:
                is_dataset = isinstance(item, h5py.Dataset)
                place = "dataset" if is_dataset else "file" if item.name == "/" else name_on_page(item)
                expected = {name: kind for name, owner, kind in ATTRIBUTES if owner == place}
                if is_dataset and "/field/" in item.name:
                    del expected["sha256"]
                found = {name: type_of(np.asarray(value)) for name, value in item.attrs.items()}
                self.assertEqual(found, expected, f"{file.filename}: {item.name}")
            self.assertEqual(file.attrs["ct_sha256"], file["identity/ct_content_sha256"][()])
            for name in ("options_toml", "source_version"):
                self.assertEqual(file.attrs[name], file["provenance"][name][()])

    def test_checksums_are_those_of_the_page(self):
        for file in self.files:
            for item in objects_below(file):
                stated = item.attrs.get("sha256", b"").decode()
                if isinstance(item, h5py.Group) and "codewords" in item and "/field/" in item.name:
                    self.assertEqual(sha256_of_tiles(item), stated, item.name)
                elif isinstance(item, h5py.Dataset) and "/field/" not in item.name:
                    self.assertEqual(sha256_of(item), stated, item.name)
            payload = hashlib.sha256(payload_text(file).encode()).hexdigest()
            self.assertEqual(payload, file.attrs["payload_sha256"].decode(), file.filename)

    def test_h5dump_prints_every_dataset(self):
        if shutil.which("h5dump") is None:
            self.skipTest("hdf5-tools is not installed (jobs/install-packages.sh --with-lint)")
        for file in self.files:
            dump = subprocess.run(["h5dump", file.filename], capture_output=True, text=True)
            self.assertEqual(dump.returncode, 0, dump.stderr[-2000:])
            self.assertEqual(len(re.findall(r"\bDATASET \"", dump.stdout)), len(datasets_below(file)))

    def test_rays_find_the_samples_that_the_program_finds(self):
        file = self.files[0]
        rotation_rad, translation_mm = np.radians([2.0, -1.5, 3.0]), np.array([4.0, -5.0, 6.0])
        (cx, cy, cz), (sx, sy, sz) = np.cos(rotation_rad), np.sin(rotation_rad)
        about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
        about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
        about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
        identity = {item.name.split("/")[-1]: item[()] for item in datasets_below(file["identity"])}
        rotation = about_z @ about_y @ about_x @ identity["nominal_rotation"]
        slab_from_ct = file["geometry/slab_from_ct"][:]

        def in_slab(room_point):
            in_ct = (room_point - identity["center_room_mm"] - translation_mm) @ rotation
            return (in_ct + identity["center_ct_mm"]) @ slab_from_ct[:3, :3].T + slab_from_ct[:3, 3]

        columns, rows = identity["size_px"]
        column, row = np.meshgrid(np.arange(columns), np.arange(rows))
        column_mm, row_mm = identity["pixel_spacing_mm"]
        pixels = in_slab(
            identity["detector_origin_point"]
            + (column_mm * column)[..., None] * identity["column_direction"]
            + (row_mm * row)[..., None] * identity["row_direction"]
        )
        source = in_slab(identity["source_point"])
        directions = pixels - source

        def nearest(plane_y_mm, axis, extent_mm, nodes):
            """The nodes nearest to where rays meet a plane, and whether two are equally near."""
            shares = (plane_y_mm - source[1]) / directions[..., 1]
            first_mm, last_mm = extent_mm
            at = (source[axis] + shares * directions[..., axis] - first_mm) * (nodes - 1) / (last_mm - first_mm)
            return np.rint(at).astype(int), np.abs(at - np.floor(at) - 0.5) < TIE_NODES

        geometry, slab = file["geometry"], file["geometry/slab_0"]
        uv_y_mm, st_y_mm = geometry["uv_plane_y_mm"][0], slab["st_plane_y_mm"][0]
        hits = (
            nearest(uv_y_mm, 0, geometry["u_extent_mm"], geometry["uv_nodes"][0]),
            nearest(uv_y_mm, 2, geometry["v_extent_mm"], geometry["uv_nodes"][1]),
            nearest(st_y_mm, 0, slab["s_extent_mm"], slab["st_nodes"][0]),
            nearest(st_y_mm, 2, slab["t_extent_mm"], slab["st_nodes"][1]),
        )
        (u, _), (v, _), (s, _), (t, _) = hits
        is_tie = np.logical_or.reduce([tie for _, tie in hits])
        s_begin, s_count, t_begin, t_count = slab["stored_range"][:]
        is_stored = (s >= s_begin) & (s < s_begin + s_count) & (t >= t_begin) & (t < t_begin + t_count)
        expected = np.zeros(u.shape, np.float32)
        with tempfile.TemporaryDirectory() as folder:
            for viewpoint in np.unique(np.stack([u, v], axis=-1)[is_stored], axis=0):
                saved = Path(folder, "samples.npz")
                command = [sys.executable, EXAMPLE, file.filename, *map(str, viewpoint), saved]
                subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
                with np.load(saved) as arrays:
                    samples = arrays["slab_0"]
                here = is_stored & (u == viewpoint[0]) & (v == viewpoint[1])
                expected[here] = samples[s[here] - s_begin, t[here] - t_begin]
            output = Path(folder, "nearest.mha")
            subprocess.run(
                [Path(os.environ["AF_PROGRAMS"], "af-drr"), "--field", file.filename, "--look-up", "nearest"]
                + ["--rotation-deg", "2,-1.5,3", "--translation-mm", "4,-5,6", "-o", output],
                check=True,
                stdout=subprocess.DEVNULL,
            )
            drr = np.frombuffer(output.read_bytes()[-4 * u.size :], "<f4").reshape(u.shape)
        expected *= file["codebook/quantizer_step"][0]
        self.assertGreater(drr.max(), 0.5)
        self.assertLess(np.count_nonzero(is_tie), u.size // 100)
        np.testing.assert_array_equal(drr[~is_tie], expected[~is_tie])


if __name__ == "__main__":
    unittest.main()
