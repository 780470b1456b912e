#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Holds every first-party #include, and those of the watched libraries, against the table of ARCHITECTURE.md.
#
#   layering.sh ROOT          checks the tree at ROOT; exit 1 and one line per violation
#   layering.sh --graph ROOT  prints the includes between folders as a graph for Graphviz (dot -Tsvg)
#   layering.sh --self-test   plants violations in a scratch tree and checks that each is found
set -euo pipefail

# check_tree ROOT [graph]
check_tree() {
  local root=$1 mode=${2:-check}
  [[ -f "$root/ARCHITECTURE.md" ]] || { echo "$root/ARCHITECTURE.md: no such file" >&2; return 1; }
  {
    cd "$root"
    # A scratch tree has only some of the folders.
    find common precompute register evaluate python -type f \( -name '*.h' -o -name '*.cpp' \) 2>/dev/null || true
  } | LC_ALL=C sort |
    awk -v root="$root" -v mode="$mode" '
      function report(where, what) { printf "%s: %s\n", where, what; ++violations }
      function trimmed(text) { gsub(/^[ `]+|[ `]+$/, "", text); return text }
      function long_name(folder) {
        return folder ~ /^(common|precompute|register|evaluate|python)(\/|$)/ ? folder : "common/" folder
      }
      function library_of(name) {
        if (name ~ /^mpi[.]h$/) return "MPI"
        if (name ~ /^(hdf5|H5[A-Za-z]*)[.]h/) return "HDF5"
        if (name ~ /^(itk|vnl)/) return "ITK"
        if (name ~ /^gdcm/) return "GDCM"
        if (name ~ /^CLI\//) return "CLI11"
        if (name ~ /^nlopt/) return "NLopt"
        if (name ~ /^boost\//) return "Boost"
        if (name ~ /^openssl\//) return "OpenSSL"
        if (name ~ /^cairo/) return "cairo"
        if (name ~ /^toml\+\+\//) return "toml++"
        if (name ~ /^nlohmann\//) return "nlohmann-json"
        if (name ~ /^zlib[.]h$/) return "zlib"
        if (name ~ /^(pybind11\/|Python[.]h|numpy\/)/) return "pybind11"
        if (name ~ /^(iostream|cstdio|print)$/) return "terminal"
        return ""
      }
      function read_table(file,    text, cell, number, names, count, n) {
        while ((getline text < file) > 0) {
          ++number
          if (text !~ /^[|] `/) continue
          split(text, cell, "|")
          folder = trimmed(cell[2])
          if (folder in row) report("ARCHITECTURE.md:" number, folder " has two rows")
          row[folder] = number
          count = split(trimmed(cell[4]), names, " ")
          for (n = 1; n <= count; ++n) {
            named = long_name(names[n])
            if (!(named in row)) report("ARCHITECTURE.md:" number, folder " includes " names[n] ", which stands in no row above it")
            may[folder, named] = number
          }
          count = split(trimmed(cell[5]), names, " ")
          for (n = 1; n <= count; ++n) library[folder, names[n]] = number
        }
        close(file)
        for (folder in row) ++rows
        if (!rows) report("ARCHITECTURE.md", "holds no table of folders")
      }
      # The folder of an included file: beside the including one, below common/, or below the root; the public headers are
      # included as they are installed.
      function folder_of_include(name, folder,    place) {
        if (name !~ /\//) return folder
        sub(/\/[^\/]*$/, "", name)
        if (name == "attenuation_fields") return "common/library/" name
        if (name ~ /^common\//) return name
        return name ~ /^(precompute|register|evaluate|python)(\/|$)/ ? name : "common/" name
      }
      BEGIN { read_table(root "/ARCHITECTURE.md") }
      {
        path = $0
        ++files
        folder = path
        sub(/\/[^\/]*$/, "", folder)
        if (!(folder in row)) report(path ":0", "no row of the table in ARCHITECTURE.md covers its folder")
        number = 0
        while ((getline text < (root "/" path)) > 0) {
          ++number
          ++lines[folder]
          if (text !~ /^[ \t]*#[ \t]*include[ \t]*["<]/) continue
          is_quoted = text ~ /include[ \t]*"/
          name = text
          sub(/^[^"<]*["<]/, "", name)
          sub(/[">].*/, "", name)
          kind = library_of(name)
          if (kind != "") {
            if ((folder, kind) in library) used_library[folder, kind] = 1
            else report(path ":" number, "includes " name " (" kind "), which the row of " folder " does not name")
            continue
          }
          if (!is_quoted) continue
          included = folder_of_include(name, folder)
          if (name == "parallel/mpi_handle.h" && folder != "common/parallel" && !((folder, "MPI") in library))
            report(path ":" number, "includes the raw MPI handle")
          if (included == folder) continue
          used[folder, included] = 1
          if (!((folder, included) in may))
            report(path ":" number, "includes \"" name "\", but the row of " folder " does not name " included)
        }
        close(root "/" path)
      }
      END {
        if (files == 0) { print "no sources found below " root; exit 1 }
        if (mode == "graph") {
          print "digraph folders {\n  rankdir = BT;\n  node [shape = box];"
          for (pair in used) { split(pair, ends, SUBSEP); printf "  \"%s\" -> \"%s\";\n", ends[1], ends[2] }
          print "}"
          exit violations > 0
        }
        for (folder in row) if (!(folder in lines)) report("ARCHITECTURE.md:" row[folder], folder " holds no sources")
        for (pair in may) if (!(pair in used)) {
          split(pair, ends, SUBSEP)
          report("ARCHITECTURE.md:" may[pair], ends[1] " never includes " ends[2])
        }
        for (pair in library) if (!(pair in used_library)) {
          split(pair, ends, SUBSEP)
          report("ARCHITECTURE.md:" library[pair], ends[1] " never includes " ends[2])
        }
        for (folder in lines) all += lines[folder]
        for (folder in lines) if (files >= 100 && lines[folder] > 0.15 * all) report(folder, "holds more than 15 % of the code")
        printf "layering: %d files in %d folders, %d violations\n", files, rows, violations
        exit violations > 0
      }'
}

# plant PATH LINE: a file of the scratch tree, whose second line is LINE.
plant() {
  mkdir -p "$scratch/tree/$(dirname "$1")"
  printf '%s\n' '#include <vector>' "$2" >"$scratch/tree/$1"
}

# new_tree: five folders that obey their table.
new_tree() {
  rm -rf "$scratch/tree"
  mkdir -p "$scratch/tree"
  cat >"$scratch/tree/ARCHITECTURE.md" <<'TABLE'
| Folder | Holds | Includes | Libraries |
|---|---|---|---|
| `common/base` | errors | | |
| `common/geometry` | cameras | base | |
| `common/parallel` | MPI | base | MPI |
| `common/field_file` | HDF5 | parallel | HDF5 MPI |
| `register/method` | numerics | geometry | |
TABLE
  plant common/base/error.h '#include <string>'
  plant common/geometry/ray.h '#include "base/error.h"'
  plant common/parallel/communicator.cpp '#include <mpi.h>'
  printf '%s\n' '#include "base/error.h"' >>"$scratch/tree/common/parallel/communicator.cpp"
  plant common/field_file/field_reading.cpp '#include <hdf5.h>'
  printf '%s\n' '#include "parallel/mpi_handle.h"' '#include <mpi.h>' >>"$scratch/tree/common/field_file/field_reading.cpp"
  plant register/method/registration.cpp '#include "geometry/ray.h"'
}

planted=0
# expect_violation WHAT WHERE: the scratch tree is refused, and a message begins with WHERE.
expect_violation() {
  local output
  if output=$(check_tree "$scratch/tree"); then
    echo "self-test: NOT found: $1" >&2
    return 1
  fi
  if ! grep -q "^$2: " <<<"$output"; then
    echo "self-test: $1: no message begins with $2: $output" >&2
    return 1
  fi
  planted=$((planted + 1))
  new_tree
}

self_test() {
  scratch=$(mktemp -d)
  trap 'rm -rf "$scratch"' EXIT
  new_tree
  check_tree "$scratch/tree" >/dev/null || { echo 'self-test: a clean tree is refused' >&2; return 1; }
  plant common/geometry/slab.h '#include "parallel/communicator.h"'
  expect_violation 'a folder that the row does not name' common/geometry/slab.h:2
  plant common/geometry/slab.h '#include "common/parallel/communicator.h"'
  expect_violation 'the same by its long name' common/geometry/slab.h:2
  plant register/method/registration.cpp '#include "register/main.h"'
  expect_violation 'a part of a program uses its top' register/method/registration.cpp:2
  plant common/geometry/slab.h '#include <mpi.h>'
  expect_violation 'numerics use MPI' common/geometry/slab.h:2
  plant common/geometry/slab.h '#  include "hdf5.h"'
  expect_violation 'numerics use HDF5' common/geometry/slab.h:2
  plant common/geometry/slab.h '#include <itkImage.h>'
  expect_violation 'numerics use ITK' common/geometry/slab.h:2
  plant common/geometry/slab.h '#include <pybind11/pybind11.h>'
  expect_violation 'numerics use Python' common/geometry/slab.h:2
  plant python/bindings/module.cpp '#include "geometry/ray.h"'
  expect_violation 'a folder of python/ without a row' python/bindings/module.cpp:0
  plant common/geometry/slab.h '#include <iostream>'
  expect_violation 'a library prints' common/geometry/slab.h:2
  plant register/method/judge.h '#include "parallel/mpi_handle.h"'
  expect_violation 'the raw MPI handle' register/method/judge.h:2
  plant common/volume/ct.h '#include <string>'
  expect_violation 'a folder without a row' common/volume/ct.h:0
  rm -r "$scratch/tree/register"
  expect_violation 'a row without a folder' ARCHITECTURE.md:7
  plant register/method/registration.cpp '#include <string>'
  expect_violation 'a folder that is named and not included' ARCHITECTURE.md:7
  sed -i 's/| errors | |/| errors | geometry |/' "$scratch/tree/ARCHITECTURE.md"
  expect_violation 'a row that names a folder below it' ARCHITECTURE.md:3
  rm -rf "$scratch/tree/common" "$scratch/tree/register"
  if check_tree "$scratch/tree" >/dev/null; then
    echo 'self-test: an empty tree passes' >&2
    return 1
  fi
  echo "self-test: $planted planted violations found, clean tree accepted"
}

case "${1:-}" in
  --self-test) self_test ;;
  --graph) check_tree "${2:-.}" graph ;;
  '') echo "usage: layering.sh [--graph] ROOT | --self-test" >&2; exit 2 ;;
  *) check_tree "$1" ;;
esac
