#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Does what a user does who starts from nothing. On a bare Debian (debootstrap, variant minbase) it runs the two commands of
# README.md in a clone of the last commit. On a second bare Debian it then tries the packages of that build, on a third one
# the wheel of a build without MPI. Needs root, debootstrap, git and Debian's mirror.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "${BASH_SOURCE[0]}")/../../jobs/lib.sh"

usage() {
  cat <<'TEXT'
Usage: tests/package/bare_debian.sh bookworm|trixie [--root DIR]

Installs packages as root, and as a plain user runs jobs/local.sh and tests/run.sh and makes the Debian packages. These
are installed on another bare system, used there (a study from a phantom to a pose, alone and under mpirun) and
removed. A wheel is installed into a virtual environment of a third one, and must find that pose again. Ends with one
line per step, release, commit and date. From nothing it takes about two hours on two cores, and 12 GB. Logs are in
build/bare-RELEASE.

  --root DIR    where the systems are made; those that are there are used again  [a new folder, removed at the end]
  AF_DEBIAN_MIRROR, in the environment: where packages come from                      [http://deb.debian.org/debian]
TEXT
}

release="" systems=""
while (($# > 0)); do
  case "$1" in
    bookworm | trixie) release=$1 ;;
    --root) need_value "$1" $#; systems=$(realpath -m "$2"); shift ;;
    --help | -h) usage; exit 0 ;;
    *) die 2 "unknown argument '$1' (try --help)" ;;
  esac
  shift
done
[[ -n "$release" ]] || { usage >&2; exit 2; }
((EUID == 0)) || die 1 "debootstrap and chroot need root"
for tool in debootstrap git; do
  command -v "$tool" >/dev/null || die 77 "$tool is not installed"
done

# Mounts and processes end with this process.
if [[ -z "${AF_IN_NAMESPACE:-}" ]]; then
  AF_IN_NAMESPACE=1 exec unshare --mount --pid --fork --kill-child --propagation private \
    "$0" "$release" ${systems:+--root "$systems"}
fi

commit=$(git -C "$af_root" -c safe.directory='*' rev-parse --short=11 HEAD)
logs="$af_root/build/bare-$release"
mkdir -p "$logs"
is_for_once=no
if [[ -z "$systems" ]]; then
  systems=$(mktemp -d)
  is_for_once=yes
fi
source_system="$systems/source" package_system="$systems/package" wheel_system="$systems/wheel"
clone="$source_system/home/guest/attenuation-fields"

# --- steps -------------------------------------------------------------------------------------------------------

steps=() status=0

# step NAME COMMAND...: runs a command, its output in a log.
step() {
  local name=$1 log="$logs/${1//[ \/]/-}.log" start=$SECONDS
  shift
  say "--- $name"
  if "$@" >"$log" 2>&1; then
    steps+=("passed: $name, $(duration $((SECONDS - start)))")
  else
    steps+=("FAILED: $name, exit code $?")
    status=1
    tail -n 40 "$log" >&2
    return 1
  fi
}

finish() {
  (($? == 0)) || status=1
  say ""
  say "bare_debian.sh: $release ($(cat "$source_system/etc/debian_version")), commit $commit, $(date --utc --iso-8601)"
  printf '  %s\n' "${steps[@]}"
  if [[ "$is_for_once" == yes ]]; then
    umount --recursive "$systems"/*/{proc,dev,sys} 2>/dev/null || true
    rm -rf --one-file-system "$systems"
  fi
  exit "$status"
}

# make_bare SYSTEM: installs a bare Debian with a plain user.
make_bare() {
  mkdir -p "$1" &&
    debootstrap --variant=minbase "$release" "$1" "${AF_DEBIAN_MIRROR:-http://deb.debian.org/debian}" &&
    chroot "$1" useradd --create-home --shell /bin/bash guest
}

# enter SYSTEM: installs it if needed, and mounts what commands need.
enter() {
  [[ -e "$1/home/guest" ]] || step "bare system for the ${1##*/}" make_bare "$1"
  mount -t proc proc "$1/proc"
  mount --rbind /dev "$1/dev"
  mount --rbind /sys "$1/sys"
  cp /etc/resolv.conf "$1/etc/resolv.conf"
}

# inside SYSTEM USER FUNCTION: calls a function of this file there, in the user's home.
inside() {
  chroot "$1" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive \
    su "$2" -c "$(declare -f "$3"); cd; set -euo pipefail; $3"
}

# --- what is done there ------------------------------------------------------------------------------------------

put_clone() {
  rm -rf "$clone" && mkdir -p "$clone" &&
    git -C "$af_root" -c safe.directory='*' archive HEAD | tar -x -C "$clone" &&
    chroot "$source_system" bash -c 'chown -R guest: ~guest/attenuation-fields'
}
install_what_builds() { ~guest/attenuation-fields/jobs/install-packages.sh; }
run_study() { cd attenuation-fields && jobs/local.sh; }
run_tests() { cd attenuation-fields && tests/run.sh; }
make_packages() { cd attenuation-fields && cmake --build build/release --target package; }
compare_without_mpi() { cd attenuation-fields && tests/package/other_ranks.sh serial; }
make_wheel() { cd attenuation-fields && cmake --build build/serial --target python-wheel; }

install_ours() {
  local program file
  apt-get update -q
  apt-get install -y -q --no-install-recommends /packages/*.deb
  for program in precompute drr simulate scan register evaluate inspect; do
    if ldd "/usr/bin/af-$program" | grep 'not found'; then exit 1; fi
    [[ "$(zcat "/usr/share/man/man1/af-$program.1.gz")" == *"af\\-$program"* ]]
    bash -n "/usr/share/bash-completion/completions/af-$program"
  done
  for file in copyright LICENSE README.md docs/getting-started.md; do
    test -s "/usr/share/doc/attenuation-fields/$file"
  done
}
use_ours() {
  rm -rf trial
  mkdir trial
  cd trial
  local field=(--study study/study.toml --uv-nodes 12 --st-nodes 96 --codewords 256)
  af-simulate --phantom spine --rig c-arm-12in -o study
  af-precompute "${field[@]}" --camera AP -o AP.af.h5
  mpirun -n 2 --oversubscribe af-precompute "${field[@]}" --camera LAT -o LAT.af.h5
  af-drr --field AP.af.h5 -o drr.png
  af-register --study study/study.toml --field AP=AP.af.h5 --field LAT=LAT.af.h5 --start-rotation-deg 1,-1,1 -o result
  python3 -c 'import attenuation_fields as af; print(af.Field.open("AP.af.h5").drr(rotation_deg=(1, 0, 0)).shape)'
  af-inspect AP.af.h5 result/pose.toml
  /usr/libexec/attenuation-fields/slicer/af-register --xml >module.xml
  test -s module.xml
}
remove_ours() {
  dpkg-query --show --showformat '${Package}\n' '*attenuation-fields*' | xargs apt-get remove -y -q
  if command -v af-drr; then exit 1; fi
}

# The virtual environment takes what the wheel declares from Debian, so that nothing comes from elsewhere.
install_what_wheel_declares() {
  apt-get update -q
  apt-get install -y -q --no-install-recommends python3-venv python3-numpy python3-h5py python3-pydicom python3-yaml \
    python3-jinja2 python3-matplotlib
}
use_wheel() {
  python3 -m venv --system-site-packages environment
  environment/bin/pip install --no-index /packages/*.whl
  environment/bin/af-convert --help
  environment/bin/af-report --help
  environment/bin/python -c '
import attenuation_fields as af
fields = {"AP": "trial/AP.af.h5", "LAT": "trial/LAT.af.h5"}
found = af.register("trial/study/study.toml", fields=fields, rotation_deg=(1, -1, 1))
assert (af.read_pose("trial/result/pose.toml") == found.pose).all(), found.pose
print(found.verdict, found.tre_mm)'
}

# --- all of it ---------------------------------------------------------------------------------------------------

trap finish EXIT
enter "$source_system"
step "clone" put_clone
step "packages that the build needs" inside "$source_system" root install_what_builds
step "jobs/local.sh" inside "$source_system" guest run_study || true
step "tests/run.sh" inside "$source_system" guest run_tests || true
steps+=("        $(grep 'tests failed out of' "$logs/tests-run.sh.log" || echo "no test was run")")
step "target package" inside "$source_system" guest make_packages
step "without MPI" inside "$source_system" guest compare_without_mpi || true
step "wheel" inside "$source_system" guest make_wheel || true

enter "$package_system"
rm -rf "$package_system/packages"
mkdir "$package_system/packages"
cp "$clone"/build/release/*.deb "$package_system/packages"
step "our packages: install" inside "$package_system" root install_ours
step "our packages: use" inside "$package_system" guest use_ours || true
step "our packages: remove" inside "$package_system" root remove_ours

enter "$wheel_system"
rm -rf "$wheel_system/packages"
mkdir "$wheel_system/packages"
cp "$clone"/build/serial/wheel/*.whl "$wheel_system/packages"
cp -r "$package_system/home/guest/trial" "$wheel_system/home/guest"
step "wheel: what it declares" inside "$wheel_system" root install_what_wheel_declares
step "wheel: use" inside "$wheel_system" guest use_wheel
steps+=("        $(du -m "$wheel_system"/packages/*.whl | cut -f 1) MB")
