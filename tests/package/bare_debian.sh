#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs the Debian package on a Debian 12 that holds nothing else (debootstrap, variant minbase), and uses it there as
# a user would: a study from a phantom to a pose, alone and under mpirun, then removes it. Needs root and Debian's mirror.
set -euo pipefail

usage() {
  cat <<'TEXT'
Usage: tests/package/bare_debian.sh [--root DIR] PACKAGE.deb...

  --root DIR    where the bare system is made; one that is there is used again      [a new folder, removed at the end]
  AF_DEBIAN_MIRROR, in the environment: where its packages come from                [http://deb.debian.org/debian]
TEXT
}

root="" packages=()
while (($# > 0)); do
  case "$1" in
    --root) root=${2:?--root needs a folder}; shift ;;
    --help | -h) usage; exit 0 ;;
    *.deb) packages+=("$(realpath "$1")") ;;
    *) echo "bare_debian.sh: unknown argument '$1' (try --help)" >&2; exit 2 ;;
  esac
  shift
done
((${#packages[@]} > 0)) || { usage >&2; exit 2; }
((EUID == 0)) || { echo "bare_debian.sh: debootstrap and chroot need root" >&2; exit 1; }
command -v debootstrap >/dev/null || { echo "bare_debian.sh: debootstrap is not installed" >&2; exit 77; }

# Everything that is mounted goes with this process.
if [[ -z "${AF_IN_NAMESPACE:-}" ]]; then
  AF_IN_NAMESPACE=1 exec unshare --mount --propagation private "$0" ${root:+--root "$root"} "${packages[@]}"
fi

if [[ -z "$root" ]]; then
  root=$(mktemp -d)
  trap 'umount --recursive "$root/proc" "$root/dev" "$root/sys" || true; rm -rf --one-file-system "$root"' EXIT
fi
mirror=${AF_DEBIAN_MIRROR:-http://deb.debian.org/debian}
if [[ ! -e "$root/etc/debian_version" ]]; then
  echo "--- a bare Debian 12 in $root"
  debootstrap --variant=minbase bookworm "$root" "$mirror" >"$root.log" 2>&1 || { tail -n 20 "$root.log" >&2; exit 1; }
fi
mount -t proc proc "$root/proc"
mount --rbind /dev "$root/dev"
mount --rbind /sys "$root/sys"
cp /etc/resolv.conf "$root/etc/resolv.conf"
rm -rf "$root/packages"
mkdir "$root/packages"
cp "${packages[@]}" "$root/packages"

# inside SCRIPT [USER]: runs a script of the folder packages in the bare system.
inside() {
  chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive \
    su "${2:-root}" -s /bin/bash -c "bash -euo pipefail /packages/$1"
}

cat >"$root/packages/install.sh" <<'TEXT'
apt-get update -q
apt-get install -y -q --no-install-recommends /packages/*.deb
id guest >/dev/null 2>&1 || useradd --create-home guest
TEXT
cat >"$root/packages/look.sh" <<'TEXT'
dpkg-query --show --showformat '${Package} ${Version} ${db:Status-Status}\n' attenuation-fields
for program in precompute drr simulate register evaluate inspect; do
  if ldd "/usr/bin/af-$program" | grep 'not found'; then exit 1; fi
  zcat "/usr/share/man/man1/af-$program.1.gz" | head -n 1
  bash -n "/usr/share/bash-completion/completions/af-$program"
done
for file in copyright LICENSE README.md docs/getting-started.md; do test -s "/usr/share/doc/attenuation-fields/$file"; done
TEXT
cat >"$root/packages/study.sh" <<'TEXT'
rm -rf ~/trial
mkdir ~/trial
cd ~/trial
field=(--study study/study.toml --uv-nodes 12 --st-nodes 96 --codewords 256)
af-simulate --phantom spine --rig c-arm-12in -o study
af-precompute "${field[@]}" --camera AP -o AP.af.h5
mpirun -n 2 --oversubscribe af-precompute "${field[@]}" --camera LAT -o LAT.af.h5
af-drr --field AP.af.h5 -o drr.png
af-register --study study/study.toml --field AP=AP.af.h5 --field LAT=LAT.af.h5 --start-rotation-deg 1,-1,1 -o result
if [[ -e /usr/lib/python3/dist-packages/attenuation_fields ]]; then
  python3 -c "import attenuation_fields as af; print('Python: a DRR of shape', af.Field.open('AP.af.h5').drr(rotation_deg=(1, 0, 0)).shape)"
fi
af-inspect AP.af.h5 result/pose.toml | grep -E 'field|checksums|pose'
/usr/libexec/attenuation-fields/slicer/af-register --xml >module.xml
head -n 1 module.xml
TEXT
cat >"$root/packages/remove.sh" <<'TEXT'
mapfile -t installed < <(dpkg-query --show --showformat '${Package}\n' '*attenuation-fields*')
apt-get remove -y -q "${installed[@]}"
if command -v af-drr; then exit 1; fi
TEXT

echo "--- install"
inside install.sh >"$root/packages/install.log" 2>&1 || { tail -n 30 "$root/packages/install.log" >&2; exit 1; }
inside look.sh
echo "--- a study, as a user who is not root"
inside study.sh guest
echo "--- remove"
inside remove.sh >"$root/packages/remove.log" 2>&1 || { tail -n 30 "$root/packages/remove.log" >&2; exit 1; }
echo "bare_debian.sh: installed, used and removed"
