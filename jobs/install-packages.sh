#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs the packages of Debian 12 or 13 that building and running needs. With everything in place it only asks dpkg and
# ends at once. It needs root or sudo only when something is missing.
set -euo pipefail

# Compilers and build tools, libraries, the Python module, figures, what checks pages and makes packages, and the default CT
# (invesalius-examples).
base_packages=(
  g++ cmake ninja-build pkg-config
  libopenmpi-dev openmpi-bin libhdf5-openmpi-dev
  libinsighttoolkit5-dev libgdcm-dev libpng-dev libtiff-dev zlib1g-dev
  libeigen3-dev libcli11-dev libtomlplusplus-dev nlohmann-json3-dev libnlopt-dev libspdlog-dev libssl-dev libboost-math-dev
  libgtest-dev libgmock-dev
  python3-dev python3-numpy pybind11-dev python3-wheel patchelf
  libcairo2-dev fonts-dejavu-core
  python3-h5py python3-jinja2 python3-matplotlib python3-pydicom python3-yaml
  dpkg-dev file
  invesalius-examples
)
# Debian 13's package of ITK names these libraries without depending on them.
trixie_packages=(libfftw3-dev)
benchmark_packages=(plastimatch libfaiss-dev libopenblas-dev)
# The peers in jobs/peers.sh.
peer_packages=(plastimatch elastix python3-torch python3-nlopt)
# Formatter, linters, the browser that opens the report in a test, and what reads manual pages, completions and fields in tests.
lint_packages=(shellcheck chromium groff-base bsdextrautils zsh hdf5-tools)
bookworm_lint_packages=(clang-format-14 clang-tidy-14)
# Large, and only one test and one example of the Python module need it; they are skipped without it.
torch_packages=(python3-torch)
# For jobs on a cluster.
slurm_packages=(slurm-wlm munge snakemake)

usage() {
  cat <<'TEXT'
Usage: jobs/install-packages.sh [--with-lint] [--with-benchmarks] [--with-slurm] [--with-torch]
                                [--with-peers] [--check] [--help]

Installs the packages that the project needs to build, run and pass its tests on Debian 12 (bookworm) or
13 (trixie). Says what it does; does nothing when all are there. Needs root or sudo only to install.

  --with-lint         also the formatter, the linters, the browser that checks reports, and what checks
                      manual pages, completions and fields (shellcheck, chromium, groff-base, bsdextrautils,
                      zsh, hdf5-tools, and clang-format-14 and clang-tidy-14, which Debian 13 does not have)
  --with-benchmarks   also what tests/benchmark/run.sh compares with (plastimatch, Faiss, OpenBLAS)
  --with-slurm        also a Slurm of one node, for tests/slurm, and Snakemake, for jobs/Snakefile
  --with-torch        also PyTorch, for the test and the example of differentiable DRRs
  --with-peers        also what jobs/peers.sh compares with (plastimatch, elastix, PyTorch, NLopt for Python)
  --check             only say what is missing; exit 1 when something is
TEXT
}

is_installed() {
  [[ "$(dpkg-query --show --showformat '${db:Status-Status}' "$1" 2>/dev/null || true)" == installed ]]
}

# The code name of this release: bookworm, trixie or another.
release_name() { sed -n 's/^VERSION_CODENAME=//p' /etc/os-release; }

main() {
  local packages=("${base_packages[@]}") check_only=no release
  release=$(release_name)
  case "$release" in
    bookworm) lint_packages+=("${bookworm_lint_packages[@]}") ;;
    trixie) packages+=("${trixie_packages[@]}") ;;
    *) echo "install-packages.sh: this is $release; tried on bookworm and trixie (Debian 12 and 13) only" >&2 ;;
  esac
  while (($# > 0)); do
    case "$1" in
      --with-lint) packages+=("${lint_packages[@]}") ;;
      --with-benchmarks) packages+=("${benchmark_packages[@]}") ;;
      --with-slurm) packages+=("${slurm_packages[@]}") ;;
      --with-torch) packages+=("${torch_packages[@]}") ;;
      --with-peers) packages+=("${peer_packages[@]}") ;;
      --check) check_only=yes ;;
      --help | -h) usage; return 0 ;;
      *)
        echo "install-packages.sh: unknown option '$1' (try --help)" >&2
        return 2
        ;;
    esac
    shift
  done
  if ! command -v dpkg-query >/dev/null; then
    echo "install-packages.sh: this is not a Debian system (no dpkg). Install the equivalents of: ${packages[*]}" >&2
    return 1
  fi

  local missing=() package
  for package in "${packages[@]}"; do
    is_installed "$package" || missing+=("$package")
  done
  if ((${#missing[@]} == 0)); then
    echo "Packages: all ${#packages[@]} are installed, nothing to do."
    return 0
  fi
  echo "Packages: ${#missing[@]} of ${#packages[@]} are missing: ${missing[*]}"
  if [[ "$check_only" == yes ]]; then
    return 1
  fi

  local as_root=()
  if ((EUID != 0)); then
    if ! command -v sudo >/dev/null; then
      echo "Neither root nor sudo: ask an administrator to run" >&2
      echo "  apt-get update && apt-get install --no-install-recommends ${missing[*]}" >&2
      return 1
    fi
    as_root=(sudo)
  fi
  echo "Packages: running apt-get update and apt-get install (log on standard output)"
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get update --quiet
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
    apt-get install --yes --quiet --no-install-recommends "${missing[@]}"
  echo "Packages: installed ${missing[*]}"
}

main "$@"
