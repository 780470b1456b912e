#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Packs the wheel, installs it into an empty folder and looks a DRR up with it there. Usage: test_wheel.sh CMAKE BUILD PYTHON
# STUDY. Exit code 77: python3-wheel or patchelf is not installed.
set -euo pipefail
cmake=$1 build=$2 python=$3 study=$4
"$python" -c 'import wheel' 2>/dev/null || { echo "skipped: python3-wheel is not installed"; exit 77; }
command -v patchelf >/dev/null || { echo "skipped: patchelf is not installed"; exit 77; }
scratch=$(mktemp -d)
trap 'rm -rf "$scratch" || true' EXIT
"$cmake" --build "$build" --target python-wheel >"$scratch/log" || { cat "$scratch/log" >&2; exit 1; }
wheel=("$build"/wheel/*.whl)
((${#wheel[@]} == 1)) || { echo "test_wheel: not one wheel: ${wheel[*]}" >&2; exit 1; }
# This does what pip does with a wheel without scripts, and checks the hashes.
"$python" -m wheel unpack --dest "$scratch" "${wheel[0]}"
cd "$scratch"/attenuation_fields-*/
unset PYTHONPATH LD_LIBRARY_PATH
"$python" -B -I -c '
import re
import sys
sys.path.insert(0, ".")
import attenuation_fields as af
from pathlib import Path
assert Path(af.__file__).parent.parent == Path.cwd(), af.__file__
study = Path(sys.argv[1])
drr = af.Field.open(study / "AP.af.h5").drr((2.0, -1.5, 3.0), (4.0, -5.0, 6.0))
assert (study / "field.mha").read_bytes().endswith(drr.tobytes())
# All but the runtimes, Python and its modules comes from the wheel.
maps = {line.split()[-1] for line in open("/proc/self/maps") if ".so" in line}
carried = {name for name in maps if Path(name).is_relative_to(Path.cwd())}
assert any("libattenuation_fields" in name for name in carried), maps
assert not {name for name in maps - carried if re.search("hdf5|ITK|gdcm|nlopt", name)}, maps
print("test_wheel: the DRR of the wheel is that of af-drr")
' "$study"
"$python" -B -I -c '
import sys
sys.path.insert(0, ".")
sys.modules["pydicom"] = None
from af_programs.of_wheel import convert
sys.exit(convert())
' 2>"$scratch/said" && { echo "test_wheel: af-convert starts without pydicom" >&2; exit 1; }
grep -q "^af-convert: needs the Python module pydicom: pip install" "$scratch/said" || { cat "$scratch/said" >&2; exit 1; }
