# SPDX-License-Identifier: Apache-2.0
"""The examples run and say what they should. Usage: test_examples.py FOLDER NAME

Exit code 77: the example needs PyTorch, which is not installed.
"""

import importlib.util
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

STUDY = Path(os.environ["AF_LIBRARY_STUDY"]).resolve()
# As in register_program_test: a small field and 2 mm pixels tell no more.
LARGEST_TRE_MM = 1.0


def output_of(example, *arguments):
    run = subprocess.run(
        [sys.executable, "-B", "-W", "error", str(example), *map(str, arguments)],
        capture_output=True,
        text=True,
    )
    if run.returncode != 0:
        sys.exit(f"{example}: exit code {run.returncode}\n{run.stdout}{run.stderr}")
    return run.stdout


def number_in(output, pattern):
    found = re.search(pattern, output)
    if found is None:
        sys.exit(f"no '{pattern}' in\n{output}")
    return float(found.group(1))


def expect(is_right, output):
    if not is_right:
        sys.exit(f"the example says something else:\n{output}")


def expect_picture(name, output):
    expect(Path(name).read_bytes().startswith(b"\x89PNG"), output)


def fields():
    return [f"{camera}={STUDY / camera}.af.h5" for camera in ("AP", "LAT")]


def register(example):
    code = example.read_text(encoding="utf-8").split("\n", 1)[1]
    readme = (example.parent.parent / "README.md").read_text(encoding="utf-8")
    expect(f"```python\n{code}```" in readme, f"README.md does not quote {example}")
    command = re.search(r"^af-simulate .*$", readme, re.MULTILINE).group().split()
    program = Path(os.environ["AF_PROGRAMS"], command[0])
    subprocess.run([program, *command[1:]], check=True, capture_output=True)
    output = output_of(example)
    expect(f"It prints `{output.strip()}`" in readme, output)
    expect_picture("registered.png", output)


def look_up(example):
    output = output_of(example, STUDY / "AP.af.h5", STUDY / "ct.nii.gz")
    # A small field of a small CT.
    expect(number_in(output, r"PSNR ([\d.]+) dB") > 30.0, output)
    expect_picture("looked-up.png", output)


def starts(example):
    output = output_of(example, STUDY / "study.toml", *fields())
    ends_mm = [float(text) for text in re.findall(r"([\d.]+) mm at the end", output)]
    expect(len(ends_mm) == 8 and max(ends_mm) < LARGEST_TRE_MM, output)
    # The ends of two registrations are no farther apart than twice what each may be off.
    expect(number_in(output, r"deg and ([\d.]+) mm$") < 2 * LARGEST_TRE_MM, output)
    expect_picture("starts.png", output)


def success(example):
    output = output_of(example, STUDY / "several" / "registrations.csv")
    expect("several: 2 of 2 succeed" in output, output)
    expect_picture("success.png", output)


def patients(example):
    missing = STUDY / "missing" / "study.toml"
    output = output_of(example, STUDY / "study.toml", missing)
    expect(re.search(r"^.*/study.toml: (found|doubtful), right with [\d.]+ %$", output, re.MULTILINE), output)
    expect(f"{missing}: " in output and len(output.splitlines()) == 2, output)
    expect_picture("patients.png", output)


def register_with_torch(example):
    if importlib.util.find_spec("torch") is None:
        print("skipped: python3-torch is not installed (jobs/install-packages.sh --with-torch)")
        sys.exit(77)
    output = output_of(example, STUDY / "study.toml", *fields())
    expect(number_in(output, r"TRE ([\d.]+) mm at the start") > 3.0, output)
    expect(number_in(output, r"([\d.]+) mm at the end") < LARGEST_TRE_MM, output)
    expect(number_in(output, r"TRE ([\d.]+) mm in") < LARGEST_TRE_MM, output)


def decode_viewpoint(example):
    # Viewpoints along u and along v as make_library_study states them.
    for name, nodes in (("AP.af.h5", 24), ("AP.standard.af.h5", 7)):
        levels = np.fromfile(STUDY / f"{name}.levels.u16", dtype="<u2")
        for u, v in ((0, 0), (3, 4), (4, 3), (nodes - 1, nodes - 1)):
            with tempfile.TemporaryDirectory() as folder:
                saved = Path(folder, "samples.npz")
                output = output_of(example, STUDY / name, u, v, saved)
                with np.load(saved) as arrays:
                    samples = list(arrays.values())
            rest = levels
            for of_viewpoint in samples:
                of_slab = rest[: nodes * nodes * of_viewpoint.size]
                rest = rest[of_slab.size :]
                expected = of_slab.reshape(nodes, nodes, *of_viewpoint.T.shape)[u, v].T
                expect(of_viewpoint.dtype == np.uint16 and expected.max() > 0, output)
                expect(np.array_equal(of_viewpoint, expected), output)
            expect(rest.size == 0, output)


CHECKS = {
    "01_register": register,
    "02_look_up": look_up,
    "03_starts": starts,
    "04_success": success,
    "05_patients": patients,
    "decode_viewpoint": decode_viewpoint,
    "register_with_torch": register_with_torch,
}

if __name__ == "__main__":
    folder, name = Path(sys.argv[1]).resolve(), sys.argv[2]
    with tempfile.TemporaryDirectory() as scratch:
        os.chdir(scratch)
        CHECKS[name](folder / f"{name}.py")
    print(f"{name}: runs and says what it should")
