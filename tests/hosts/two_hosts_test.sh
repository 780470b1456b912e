#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# A field and registrations on two hosts that only a network joins, and what happens when it is cut. The hosts are network
# namespaces on a bridge of this machine, so MPI's messages go by TCP, and files are shared as on a cluster. Needs root
# and iproute2; not a CTest, because it changes the machine's network for some minutes. All of it is removed at the end.
# Usage: two_hosts_test.sh BUILD-FOLDER [PART...]; parts: same (a field, registrations, the tests of the ranks' messages),
# cut-evaluate, cut-precompute, cut-half-cast; all of them when none is named.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
build=$(cd "$1" && pwd)
shift
parts=("$@")
((${#parts[@]} > 0)) || parts=(same cut-evaluate cut-precompute cut-half-cast)
for part in "${parts[@]}"; do
  [[ "$part" =~ ^(same|cut-evaluate|cut-precompute|cut-half-cast)$ ]] || { echo "two_hosts_test: no part '$part'" >&2; exit 2; }
done
bin=$build/bin
((EUID == 0)) || { echo "two_hosts_test: needs root" >&2; exit 77; }
command -v ip >/dev/null || { echo "two_hosts_test: needs iproute2" >&2; exit 77; }
hosts=(afhost1 afhost2) bridge=afbridge scratch=$(mktemp -d)
for host in "${hosts[@]}"; do
  [[ ! -e /run/netns/$host ]] || { echo "two_hosts_test: namespace $host is in use" >&2; exit 1; }
done

remove_hosts() {
  local host pid
  for host in "${hosts[@]}"; do
    for pid in $(ip netns pids "$host" 2>/dev/null); do kill -9 "$pid" 2>/dev/null || true; done
    ip netns del "$host" 2>/dev/null || true
    rm -f "/etc/netns/$host/hosts"
    rmdir "/etc/netns/$host" 2>/dev/null || true
  done
  ip link del "$bridge" 2>/dev/null || true
}
clean_up() {
  remove_hosts
  rm -rf --one-file-system "$scratch"
}
trap clean_up EXIT

make_hosts() {
  ip link add "$bridge" type bridge
  ip link set "$bridge" up
  local i host
  for i in 1 2; do
    host=${hosts[i - 1]}
    ip netns add "$host"
    ip link add "afveth$i" type veth peer name eth0 netns "$host"
    ip link set "afveth$i" master "$bridge" up
    ip -n "$host" link set lo up
    ip -n "$host" addr add "10.78.0.$i/24" dev eth0
    ip -n "$host" link set eth0 up
    mkdir -p "/etc/netns/$host"
    printf '127.0.0.1 localhost\n10.78.0.1 afhost1\n10.78.0.2 afhost2\n' >"/etc/netns/$host/hosts"
  done
  # Each host needs its own host name: otherwise Open MPI takes both for one, and shares memory. The words after the host
  # are a command line for a shell, as for ssh.
  cat >"$scratch/agent" <<'AGENT'
#!/bin/bash
while [[ "$1" == -* ]]; do shift; done
host=$1
shift
exec ip netns exec "$host" unshare --uts -- /bin/bash -c 'hostname "$1"; shift; exec /bin/bash -c "$*"' _ "$host" "$@"
AGENT
  chmod +x "$scratch/agent"
  # Traffic teaches the bridge where the hosts are.
  for i in 1 2 3 4 5 6 7 8 9 10; do
    ip netns exec afhost1 bash -c 'exec 3<>/dev/tcp/10.78.0.2/9' 2>/dev/null && break
    sleep 0.1
  done
}

export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
ends_on_loss=(--mca oob_tcp_keepalive_time 10 --mca oob_tcp_keepalive_intvl 2 --mca oob_tcp_keepalive_probes 3)
# This sets mpirun_options as the job scripts do.
# shellcheck source-path=SCRIPTDIR source=../../jobs/slurm/resources.sh
source "$root/jobs/slurm/resources.sh"

# on_two_hosts SECONDS MPIRUN-OPTIONS... -- PROGRAM...: four ranks, two on each host.
on_two_hosts() {
  local seconds=$1
  shift
  local options=()
  while [[ "$1" != -- ]]; do options+=("$1"); shift; done
  shift
  timeout -k 10 "$seconds" ip netns exec afhost1 unshare --uts -- /bin/bash -c 'hostname afhost1; exec "$@"' _ \
    mpirun --oversubscribe --mca plm rsh --mca plm_rsh_agent "$scratch/agent" --mca pml ob1 --mca btl self,vader,tcp \
    --mca btl_tcp_if_include eth0 --mca oob_tcp_if_include eth0 --host afhost1:2,afhost2:2 "${options[@]}" "$@"
}
on_one_host() { mpirun --oversubscribe -n 3 "$@"; }
sent_bytes() { ip -n afhost2 -s -j link show eth0 | sed -E 's/.*"tx":\{"bytes":([0-9]+).*/\1/'; }
payload() { "$bin/af-inspect" --json "$1" | grep -o '"payload_sha256": *"[0-9a-f]*"'; }
# Rows without their times, the last column.
rows() { sed 's/,[^,]*$//' "$1/registrations.csv"; }
fail() { echo "two_hosts_test: FAILED: $*" >&2; exit 1; }

"$build/tests/make_bad_inputs" "$scratch/in"
cd "$scratch"
study=$scratch/in/valid/study.toml
range=(--study "$study" --max-rotation-deg 8 --max-translation-mm 20 --codewords 256)
precompute=("$bin/af-precompute" "${range[@]}" --uv-nodes 24 --st-nodes 96 --training-fraction 0.5)
cast=("$bin/af-precompute" "${range[@]}" --uv-nodes 80 --st-nodes 320 --training-fraction 0.02 --camera AP)
# This casts for longer than it takes to notice a lost host.
cast_slowly=("$bin/af-precompute" "${range[@]}" --uv-nodes 104 --st-nodes 224 --training-fraction 0.02 --camera AP --caster trilinear)
register=("$bin/af-evaluate" registration --study "$study" --field AP=one-AP.h5 --field LAT=one-LAT.h5 --gold study
          --preset paper --intervals 4)


fields_on_one_host() {
  for camera in AP LAT; do
    on_one_host "${precompute[@]}" --camera "$camera" -o "one-$camera.h5" >log 2>&1 || { tail -5 log; fail "a field on one host"; }
  done
}

same_on_two_hosts() {
  local before
  before=$(sent_bytes)
  on_two_hosts 300 -- "${precompute[@]}" --camera AP -o two-AP.h5 >log 2>&1 || { tail -5 log; fail "a field on two hosts"; }
  [[ "$(payload one-AP.h5)" == "$(payload two-AP.h5)" ]] || fail "another payload on two hosts"
  echo "field: the same payload on one host and on two; the second host sent $((($(sent_bytes) - before) / 1000)) kB"

  on_one_host "${register[@]}" --starts-per-interval 20 -o one >log 2>&1 || { tail -5 log; fail "registrations on one host"; }
  before=$(sent_bytes)
  on_two_hosts 300 -- "${register[@]}" --starts-per-interval 20 -o two >log 2>&1 || { tail -5 log; fail "registrations on two hosts"; }
  diff <(rows one) <(rows two) >/dev/null || fail "other rows on two hosts"
  echo "registrations: the same rows on one host and on two; the second host sent $((($(sent_bytes) - before) / 1000)) kB"

  on_two_hosts 120 -- "$build/tests/parallel_test" >log 2>&1 || { grep -A4 Failure log | head -n 20; fail "parallel_test on two hosts"; }
  echo "parallel_test: passes on two hosts"
}

# lose_host NAME FILES BYTES SECONDS MPIRUN-OPTIONS... -- PROGRAM...: runs on two hosts, unplugs the second once FILES in
# NAME.progress hold more than BYTES, and prints how the job ends. The output NAME must not exist then.
lose_host() {
  local name=$1 files=$2 enough=$3 seconds=$4
  shift 4
  on_two_hosts "$seconds" "$@" >"$name.log" 2>&1 &
  local job=$! code=0 begin kept=0
  until ((kept > enough)); do
    kill -0 "$job" 2>/dev/null || { tail -5 "$name.log"; fail "$name ended before the cut"; }
    sleep 0.2
    kept=$(find "$name.progress" -name "$files" -printf '%s\n' 2>/dev/null | awk '{sum += $1} END {print sum + 0}' || true)
  done
  ip link set afveth2 down
  begin=$SECONDS
  wait "$job" || code=$?
  echo "$name: $((SECONDS - begin)) s after the cut the job had ended with code $code ($kept bytes were kept by then)"
  { grep -vE '^[[:space:]]*$|^-+$' "$name.log" || true; } | tail -n 8 | cut -c1-150 | sed 's/^/    /'
  # The lost host still runs. On a cluster the resource manager would end its processes.
  local pid
  for pid in $(ip netns pids afhost1) $(ip netns pids afhost2); do kill -9 "$pid" 2>/dev/null || true; done
  ip link set afveth2 up
}

# lose_registrations NAME MPIRUN-OPTIONS...
lose_registrations() {
  local name=$1 program=("${register[@]}" --starts-per-interval 1500 -o "$1")
  shift
  lose_host "$name" '*.records' 20000 90 "$@" -- "${program[@]}"
  [[ ! -e "$name/registrations.csv" ]] || fail "$name has results"
  on_one_host "${program[@]}" >"$name.log" 2>&1 || { tail -5 "$name.log"; fail "going on"; }
  diff <(rows whole) <(rows "$name") >/dev/null || fail "$name: other rows after going on"
  echo "$name: the next run went on, with the rows of an undisturbed one"
}
cut_while_registering() {
  on_one_host "${register[@]}" --starts-per-interval 1500 -o whole >log 2>&1 || { tail -5 log; fail "the long study"; }
  lose_registrations defaults
  lose_registrations keepalive "${ends_on_loss[@]}"
}

# lose_cast NAME.h5 WHOLE.h5 BYTES MPIRUN-OPTIONS... -- PROGRAM...: unplugs the second host once more than BYTES are kept.
lose_cast() {
  local name=$1 whole=$2 enough=$3 options=() program
  shift 3
  while [[ "$1" != -- ]]; do options+=("$1"); shift; done
  shift
  program=("$@" -o "$name")
  lose_host "$name" 'units.*.records' "$enough" 300 "${options[@]}" -- "${program[@]}"
  [[ ! -e "$name" ]] || fail "$name exists"
  on_one_host "${program[@]}" >"$name.log" 2>&1 || { tail -5 "$name.log"; fail "going on"; }
  grep -o 'resumed .*' "$name.log" | cut -c1-150 | sed 's/^/    /' || fail "$name: began anew"
  [[ "$(payload "$whole")" == "$(payload "$name")" ]] || fail "$name: another payload after going on"
  echo "$name: the next run went on, with the payload of an undisturbed one"
}
cut_while_casting() {
  on_one_host "${cast[@]}" -o whole.h5 >log 2>&1 || { tail -5 log; fail "the large field"; }
  lose_cast cast-keepalive.h5 whole.h5 10000000 "${ends_on_loss[@]}" -- "${cast[@]}"
  lose_cast cast-jobs.h5 whole.h5 10000000 "${mpirun_options[@]}" -- "${cast[@]}"
}
cut_while_casting_slowly() {
  on_one_host "${cast_slowly[@]}" -o slow.h5 >log 2>&1 || { tail -5 log; fail "the slow field"; }
  lose_cast half-cast.h5 slow.h5 1000000 "${ends_on_loss[@]}" -- "${cast_slowly[@]}"
}

make_hosts
fields_on_one_host
for part in "${parts[@]}"; do
  case "$part" in
    same) same_on_two_hosts ;;
    cut-evaluate) cut_while_registering ;;
    cut-precompute) cut_while_casting ;;
    cut-half-cast) cut_while_casting_slowly ;;
  esac
done
echo "two_hosts_test: done"
