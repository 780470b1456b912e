#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Checks every first-party #include, and every one of MPI, HDF5 and ITK, against the layers of the project:
# numerics never see MPI, HDF5, ITK, the terminal or files.
#
#   layering.sh ROOT         checks the tree at ROOT; exit 1 and one line per violation
#   layering.sh --self-test  plants violations in a scratch tree and checks that each is found
set -euo pipefail

# First matching row wins: path pattern (awk regular expression on the path below ROOT) | folders it may include from |
# of MPI, HDF5, ITK, IOSTREAM what it may include. "*" allows every folder.
table='
^common/base/        | base |
^common/geometry/    | geometry base |
^common/image/       | image base |
^common/volume/      | volume geometry base |
^common/field/       | field geometry base |
^common/drr/         | drr volume field image geometry base |
^common/simulation/  | simulation drr volume field image geometry base |
^common/gold/gold_standard_files[.] | gold io geometry base |
^common/gold/        | gold geometry base |
^common/parallel/    | parallel base | MPI
^common/cli/resumable_items[.] | cli io parallel base |
^common/cli/         | cli parallel base | IOSTREAM
^common/io/(itk_image_io|dicom_pixels)[.] | io base | ITK
^common/io/(ct_reader|dicom_series|xray_reader)[.] | io volume image geometry base |
^common/io/(node_ct|shared_inputs)[.] | io parallel volume image geometry base |
^common/io/field_file[a-z0-9_]*[.] | io field parallel image geometry base | MPI HDF5
^common/io/          | io image geometry base |
^common/tools/       | * | IOSTREAM
/main[.]cpp$         | * | IOSTREAM
/[a-z_]+_(command|commands|main|program|report|output|files|loading)[.](h|cpp)$ | * | IOSTREAM
^precompute/         | precompute volume field geometry base |
^register/           | register drr volume field image geometry base |
^evaluate/           | evaluate register gold drr volume field image geometry base |
'

check_tree() {
  local root=$1
  {
    cd "$root"
    # A scratch tree has only some of the folders.
    find common precompute register evaluate -type f \( -name '*.h' -o -name '*.cpp' \) 2>/dev/null || true
  } | LC_ALL=C sort |
    AF_TABLE="$table" awk -v root="$root" '
      BEGIN {
        rows = 0
        line_count = split(ENVIRON["AF_TABLE"], lines, "\n")
        for (l = 1; l <= line_count; ++l) {
          if (lines[l] !~ /[^ ]/) continue
          # The last two bars separate the columns; a pattern may hold bars of its own.
          field_count = split(lines[l], fields, /[ ]+[|][ ]*/)
          ++rows
          pattern[rows] = fields[1]
          gsub(/ /, "", pattern[rows])
          folders[rows] = " " fields[2] " "
          third[rows] = " " (field_count > 2 ? fields[3] : "") " "
        }
      }
      function report(what) { printf "%s:%d: %s\n", path, number, what; ++violations }
      function third_party(name) {
        if (name ~ /^mpi[.]h$/) return "MPI"
        if (name ~ /^(hdf5|H5[A-Za-z]*)[.]h/) return "HDF5"
        if (name ~ /^(itk|gdcm|vnl)/) return "ITK"
        if (name ~ /^(iostream|cstdio|print)$/) return "IOSTREAM"
        return ""
      }
      {
        path = $0
        ++files
        row = 0
        for (r = 1; r <= rows && !row; ++r) if (path ~ pattern[r]) row = r
        if (!row) { number = 0; report("no row of the layer table covers this file"); next }
        file = root "/" path
        number = 0
        while ((getline text < file) > 0) {
          ++number
          if (match(text, /^[ \t]*#[ \t]*include[ \t]*"[^"]+"/)) {
            name = text; sub(/^[^"]*"/, "", name); sub(/".*/, "", name)
            kind = third_party(name)
            if (kind == "" && folders[row] !~ /[*]/) {
              folder = name
              if (folder !~ /\//) continue        # beside the including file
              sub(/^common\//, "", folder); sub(/\/.*/, "", folder)
              if (index(folders[row], " " folder " ") == 0)
                report("includes \"" name "\", but may include only from:" folders[row])
              else if (name == "parallel/mpi_handle.h" && index(third[row], " MPI ") == 0)
                report("includes the raw MPI handle")
            }
          } else if (match(text, /^[ \t]*#[ \t]*include[ \t]*<[^>]+>/)) {
            name = text; sub(/^[^<]*</, "", name); sub(/>.*/, "", name)
            kind = third_party(name)
          } else continue
          if (kind != "" && index(third[row], " " kind " ") == 0) report("includes <" name "> (" kind "), which its layer must not see")
        }
        close(file)
      }
      END {
        if (files == 0) { print "no sources found below " root; exit 1 }
        printf "layering: %d files, %d violations\n", files, violations
        exit violations > 0
      }'
}

# expect_violation WHAT PATH INCLUDE_LINE: a tree with that one file must be refused, and the message must name it.
expect_violation() {
  local what=$1 path=$2 line=$3 output
  rm -rf "$scratch/tree"
  mkdir -p "$scratch/tree/$(dirname "$path")"
  printf '%s\n' '#include <vector>' "$line" >"$scratch/tree/$path"
  if output=$(check_tree "$scratch/tree"); then
    echo "self-test: NOT found: $what" >&2
    return 1
  fi
  if ! grep -q "^$path:2: " <<<"$output"; then
    echo "self-test: $what: the message does not name $path:2: $output" >&2
    return 1
  fi
}

self_test() {
  scratch=$(mktemp -d)
  trap 'rm -rf "$scratch"' EXIT
  expect_violation 'geometry uses a higher layer' common/geometry/ray.h '#include "volume/ct_volume.h"'
  expect_violation 'the same by its long name' common/geometry/ray.h '#include "common/volume/ct_volume.h"'
  expect_violation 'numerics use files' register/registration.cpp '#include "io/study_file.h"'
  expect_violation 'io uses cli' common/io/csv_table.cpp '#include "cli/app_main.h"'
  expect_violation 'numerics use MPI' precompute/field_builder.cpp '#include <mpi.h>'
  expect_violation 'numerics use HDF5' common/field/tile.h '#  include <hdf5.h>'
  expect_violation 'numerics use ITK' common/gold/tre.cpp '#include <itkImage.h>'
  expect_violation 'the CT reader uses HDF5' common/io/itk_image_io.cpp '#include "hdf5.h"'
  expect_violation 'a library prints' common/drr/af_drr.cpp '#include <iostream>'
  expect_violation 'a program uses MPI directly' precompute/main.cpp '#include <mpi.h>'
  expect_violation 'io uses the raw MPI handle' common/io/provenance.cpp '#include "parallel/mpi_handle.h"'
  rm -rf "$scratch/tree"
  mkdir -p "$scratch/tree/common/io" "$scratch/tree/register"
  printf '%s\n' '#include <hdf5.h>' '#include "parallel/mpi_handle.h"' >"$scratch/tree/common/io/field_file.cpp"
  printf '%s\n' '#include "io/study_file.h"' >"$scratch/tree/register/main.cpp"
  check_tree "$scratch/tree" >/dev/null || { echo 'self-test: a clean tree is refused' >&2; return 1; }
  mkdir "$scratch/empty"
  if check_tree "$scratch/empty" >/dev/null; then
    echo 'self-test: an empty tree passes' >&2
    return 1
  fi
  echo 'self-test: 11 planted violations found, clean tree accepted'
}

case "${1:-}" in
  --self-test) self_test ;;
  '') echo "usage: layering.sh ROOT | --self-test" >&2; exit 2 ;;
  *) check_tree "$1" ;;
esac
