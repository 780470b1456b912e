# SPDX-License-Identifier: Apache-2.0
"""Damaged files of every format. Each is converted, or refused as input or as a file, without much time or memory. The
seed is fixed, so a failure comes again. CTest runs the first two thousand: test_mutations.py [COUNT]."""
import collections
import pathlib
import random
import resource
import sys
import tempfile
import time

import numpy as np

from examples import *  # noqa: F403
from af_programs.errors import ProgramError
from test_formats import WRITTEN as WRITTEN_CAMERAS
from test_formats import writable_rig
from test_poses import WRITTEN as WRITTEN_POSES

COUNT = int(sys.argv[1]) if len(sys.argv) > 1 else 10000
SHARE_OF_HDF5 = 0.03  # each is read by child processes
MOST_SECONDS = 5.0  # of the processor for one file
MOST_MEGABYTES = 1000
OPTIONS = dict(size_px=[64, 48], pixel_spacing_mm=[0.5, 0.5], isocenter_point=[0.0, 0.0, 0.0], source_detector_mm=1200.0,
               source_isocenter_mm=800.0, positioner_deg=[30.0, -20.0])
WORDS = [b"nan", b"inf", b"-1", b"0", b"1e308", b"-1e-308", b"99999999999999999999", b"[", b"]" * 50, b"[" * 2000, b"{" * 300, b"\0", b"\xff\xfe",
         b"\r", b"&a *a", b"<!ENTITY a 'b'>", b"'''", b'"', b"\\", b"- - -", b": :", b"#", b"=", b"%", b"\xef\xbb\xbf", b"!!python/object:os.system"]


def seeds(folder):
    cameras = [MAYACAM2, MAYACAM1, OPENCV_LENS, OPENCV_PAIR, *(OPENCV_LISTS.format(one) for one in OPENCV_MATRICES), MATRIX, RTK,
               PLASTIMATCH, PLASTIMATCH_COMMAND, ELASTIX, RAD, DIFFDRR, DIFFDRR_POSE, xa(), enhanced_xa("90"), deep_fluoro(), xreg_camera(),
               registration("1.1", [("1.1", "RIGID", np.eye(4)), ("1.2.3.4", "RIGID", UNEVEN_POSE)])]
    cameras += [formats.rig_files(writable_rig(one.name, folder), one.name, folder / "x")[0][1] for one in WRITTEN_CAMERAS]
    cameras += [formats.pose_file([(1, UNEVEN_POSE)], one.name, KnownContext()) for one in WRITTEN_POSES]
    return [one if isinstance(one, bytes) else one.encode() for one in cameras]


def mutated(source, random_, others):
    data = bytearray(source)
    for _ in range(random_.choice((1, 1, 1, 2, 3, 8))):
        at, kind = random_.randrange(len(data) + 1), random_.randrange(9)
        end = min(len(data), at + random_.choice((1, 1, 4, 30, 300)))
        if kind == 0:
            data[at:end] = bytes(random_.randrange(256) for _ in range(end - at))
        elif kind == 1:
            del data[at:end]
        elif kind == 2:
            data[at:at] = random_.choice(WORDS)
        elif kind == 3:
            data[at:at] = data[at:end] * random_.choice((1, 2, 50))
        elif kind == 4:
            del data[at:]
        elif kind > 5 and data:  # another digit, where there is one
            digits = [i for i in range(at, min(len(data), at + 200)) if chr(data[i]) in "0123456789"]
            data[random_.choice(digits or [at - 1])] = random_.choice(b"0123456789")
        else:
            other = random_.choice(others)
            start = random_.randrange(len(other))
            data[at:end] = other[start:start + random_.choice((4, 40, 400))]
    return bytes(data)


def cpu_seconds():
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def outcome(path, options):
    """What becomes of a file, read as cameras or as a pose."""
    try:
        source = formats.Source(path)
        if formats.recognised(source, formats.CAMERAS) is not None:
            rig = formats.read_rig([path], options)[0]
            text = formats.rig_files(rig, "rig", path)[0][1]
            path.write_text(text, encoding="utf-8")
            again = formats.read_rig([path], RigOptions())[0]
            assert formats.rig_files(again, "rig", path)[0][1] == text, "a rig reads back as it was written"
            return "cameras"
        for _, pose in formats.read_poses(path, KnownContext())[0]:
            np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-9)
        return "poses"
    except ProgramError as error:
        return type(error).__name__


def main():
    resource.setrlimit(resource.RLIMIT_DATA, (4 << 30, 4 << 30))
    random_, ends, slowest = random.Random(20260718), collections.Counter(), 0.0
    np.seterr(all="ignore")
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        every = seeds(folder)
        hdf5 = [one for one in every if one.startswith(b"\x89HDF")]
        others = [one for one in every if not one.startswith(b"\x89HDF")]
        begin = time.monotonic()
        for i in range(COUNT):
            source = random_.choice(hdf5 if random_.random() < SHARE_OF_HDF5 else others)
            content = mutated(source, random_, others)
            path = folder / "damaged"
            path.unlink(missing_ok=True)  # ext4 waits for the disk when a file is truncated and written anew
            path.write_bytes(content)
            started = cpu_seconds()
            try:
                ends[outcome(path, RigOptions(**OPTIONS) if i % 2 else RigOptions())] += 1
            except BaseException:
                print(f"mutation {i}: {content!r}")
                raise
            slowest = max(slowest, cpu_seconds() - started)
        seconds = time.monotonic() - begin
    megabytes = max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)) // 1024
    print(f"{COUNT} damaged files in {seconds:.0f} s, the slowest {slowest:.2f} s of the processor, at most {megabytes} MB: {dict(ends)}")
    assert slowest < MOST_SECONDS and megabytes < MOST_MEGABYTES
    assert min(ends[key] for key in ("cameras", "poses", "InputError", "FileError")) > COUNT // 100


if __name__ == "__main__":
    main()
