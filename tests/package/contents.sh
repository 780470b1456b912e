#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Makes the Debian packages of a build and looks into them: what they hold, what they depend on, lintian's errors, and
# whether programs and module start from where they are unpacked. Installs nothing; bare_debian.sh does.
set -euo pipefail

if (($# != 1)) || [[ "$1" == --help || "$1" == -h ]]; then
  echo 'Usage: tests/package/contents.sh BUILD    (a build folder in which everything is built)'
  (($# == 1)) && [[ "$1" == --help || "$1" == -h ]] && exit 0
  exit 2
fi
build=$(realpath "$1")
command -v cpack dpkg-deb dpkg-shlibdeps >/dev/null || { echo "contents.sh: cpack, dpkg-deb or dpkg-shlibdeps is missing" >&2; exit 77; }
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
fail() { echo "contents.sh: $*" >&2; exit 1; }

(cd "$build" && cpack -G DEB -B "$scratch/packages") >"$scratch/cpack.log" 2>&1 || { tail -n 20 "$scratch/cpack.log" >&2; fail "cpack"; }

# holds PACKAGE PATH...: the package has these files.
holds() {
  local package=$1 path
  dpkg-deb --fsys-tarfile "$scratch"/packages/"$package"_*.deb | tar -tf - >"$scratch/files"
  shift
  for path in "$@"; do
    grep -qx -- "\./usr/$path" "$scratch/files" || fail "$package does not hold /usr/$path"
  done
  if grep -v -e '^\./$' -e '^\./usr/' "$scratch/files"; then fail "$package holds files outside of /usr"; fi
}
# depends PACKAGE WORD...: the package depends on packages whose names begin with these words.
depends() {
  local package=$1 word
  dpkg-deb --field "$scratch"/packages/"$package"_*.deb Depends | tr ',' '\n' | sed 's/^ *//' >"$scratch/depends"
  shift
  for word in "$@"; do
    grep -q -- "^$word" "$scratch/depends" || fail "$package does not depend on $word"
  done
}

python_programs=(af-convert af-report)
programs=(af-precompute af-drr af-simulate af-scan af-register af-evaluate af-inspect)
for program in "${programs[@]}" "${python_programs[@]}"; do
  holds attenuation-fields "bin/$program" "share/man/man1/$program.1.gz" "share/bash-completion/completions/$program"
done
holds attenuation-fields libexec/attenuation-fields/slicer/af-drr libexec/attenuation-fields/slicer/af-register \
  share/doc/attenuation-fields/copyright
depends attenuation-fields python3 python3-h5py python3-jinja2 python3-matplotlib python3-numpy python3-pydicom python3-yaml openmpi-bin libc6 libhdf5-openmpi libinsighttoolkit
library=$(basename "$(ls "$scratch"/packages/libattenuation-fields[0-9]*.deb)" | sed 's/_.*//')
if [[ -n "$library" ]]; then
  holds libattenuation-fields-dev include/attenuation_fields/attenuation_fields.h include/attenuation_fields/version.h
  depends "$library" libc6 libhdf5-openmpi
  depends libattenuation-fields-dev "$library"
fi

# Programs and module must start from where they are unpacked.
for package in "$scratch"/packages/*.deb; do dpkg-deb --extract "$package" "$scratch/root"; done
for program in "${programs[@]}"; do
  "$scratch/root/usr/bin/$program" --version >"$scratch/version" || fail "$program does not start"
done
for program in "${python_programs[@]}"; do
  "$scratch/root/usr/bin/$program" --help >"$scratch/version" || fail "$program does not start"
done
if compgen -G "$scratch/packages/python3-attenuation-fields_*.deb" >/dev/null; then
  LD_LIBRARY_PATH=$(dirname "$(find "$scratch/root" -name 'libattenuation_fields.so.*' | head -n 1)") \
    PYTHONPATH="$scratch/root/usr/lib/python3/dist-packages" /usr/bin/python3 -B -c 'import attenuation_fields' || fail "the Python module does not load"
fi

# These tags are left out. Whoever makes packages names the contact (AF_PACKAGE_CONTACT). CPack 3.25 calls ldconfig in a
# script, where lintian expects a trigger.
known=bogus-mail-host,bogus-mail-host-in-debian-changelog,lacks-ldconfig-trigger,no-shlibs
if command -v lintian >/dev/null; then
  lintian --allow-root --fail-on error --suppress-tags "$known" "$scratch"/packages/*.deb >"$scratch/lintian" 2>&1 || {
    cat "$scratch/lintian" >&2
    fail "lintian found errors"
  }
fi
echo "$(find "$scratch/packages" -maxdepth 1 -name '*.deb' | wc -l) packages: contents, dependencies, programs and module are as they must be"
