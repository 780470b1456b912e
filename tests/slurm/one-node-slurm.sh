#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# A Slurm of one node for tests, as root, without systemd, cgroups or accounting:
#   one-node-slurm.sh start FOLDER    prints nothing; then export SLURM_CONF=FOLDER/slurm.conf
#   one-node-slurm.sh stop FOLDER     cancels the jobs and returns once the daemons are gone
# The node claims eight processors, however many there are. State and logs stay in FOLDER.
set -euo pipefail

die() {
  printf 'one-node-slurm.sh: %s\n' "$1" >&2
  exit 1
}

# wait_for SECONDS COMMAND...
wait_for() {
  local deadline=$((SECONDS + $1))
  shift
  until "$@" >/dev/null 2>&1; do
    ((SECONDS < deadline)) || return 1
    sleep 0.2
  done
}

munge_works() { munge -n </dev/null | unmunge; }

node_is_ready() { [[ "$(sinfo --noheader --format %T)" =~ ^(idle|mixed|allocated) ]] && scontrol show slurmd; }

write_configuration() {
  local folder=$1 host=$2 memory_mb
  memory_mb=$(awk '/^MemTotal:/ {print int($2 / 1024)}' /proc/meminfo)
  cat >"$folder/slurm.conf" <<TEXT
ClusterName=test
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
CredType=cred/munge
# A requeued job waits until its credentials expire, so they are made to expire soon.
AuthInfo=cred_expire=5
SlurmctldPort=26917
SlurmdPort=26918
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SlurmdParameters=config_overrides
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerParameters=batch_sched_delay=0,sched_min_interval=0,bf_interval=1
MpiDefault=none
ReturnToService=2
KillWait=10
JobRequeue=1
NodeName=$host NodeAddr=127.0.0.1 Port=26918 CPUs=8 RealMemory=$memory_mb State=UNKNOWN
PartitionName=main Nodes=$host Default=YES MaxTime=INFINITE State=UP
TEXT
}

# start_daemon FOLDER COMMAND...: starts a daemon that detaches, or says why it cannot start. The daemon must not keep the
# caller's files open.
start_daemon() {
  local folder=$1
  shift
  "$@" </dev/null >"$folder/$1.out" 2>&1 || die "$1 does not start: $(last_words "$folder" "$1")"
}

# last_words FOLDER DAEMON...: prints what the daemons said and logged last.
last_words() {
  local folder=$1 file
  shift
  for file in "${@/%/.out}" "${@/%/.log}"; do
    [[ ! -s "$folder/$file" ]] || printf '\n%s:\n%s' "$folder/$file" "$(tail -n 8 "$folder/$file")"
  done
}

start() {
  local folder=$1 host
  host=$(hostname -s)
  ((EUID == 0)) || die "must run as root: Slurm's daemons start jobs for users"
  for program in slurmctld slurmd munged; do
    command -v "$program" >/dev/null || die "$program is missing: jobs/install-packages.sh --with-slurm"
  done
  getent hosts "$host" >/dev/null || echo "127.0.0.1 $host" >>/etc/hosts
  mkdir -p "$folder"/{state,spool}
  if ! munge_works >/dev/null 2>&1; then
    install -d -o munge -g munge -m 755 /run/munge
    install -d -o munge -g munge -m 700 /var/log/munge /var/lib/munge /etc/munge
    if [[ ! -s /etc/munge/munge.key ]]; then
      (umask 077 && head -c 128 /dev/urandom >/etc/munge/munge.key)
      chown munge:munge /etc/munge/munge.key
    fi
    runuser -u munge -- /usr/sbin/munged --force
    wait_for 10 munge_works || die "munged does not answer"
    touch "$folder/munged-is-ours"
  fi
  write_configuration "$folder" "$host"
  export SLURM_CONF=$folder/slurm.conf
  start_daemon "$folder" slurmctld -f "$SLURM_CONF"
  start_daemon "$folder" slurmd -f "$SLURM_CONF" -N "$host"
  wait_for 30 node_is_ready || die "the node did not come up:$(last_words "$folder" slurmctld slurmd)"
}

# A zombie has ended, even if no init process reaps it.
has_ended() { [[ ! -e "/proc/$1" ]] || grep -q '^State:[[:space:]]*Z' "/proc/$1/status"; }

# end_daemon PIDFILE: returns once the process is gone, so that it writes nothing any more.
end_daemon() {
  local pid
  [[ -s "$1" ]] || return 0
  pid=$(<"$1")
  kill "$pid" 2>/dev/null || return 0
  wait_for 30 has_ended "$pid" || kill -KILL "$pid" 2>/dev/null || true
  wait_for 10 has_ended "$pid"
}

no_jobs_run() { [[ -z "$(squeue --noheader)" ]]; }

stop() {
  local folder=$1
  export SLURM_CONF=$folder/slurm.conf
  if scancel --user=root >/dev/null 2>&1; then wait_for 30 no_jobs_run || true; fi
  local pid_files=("$folder/slurmd.pid" "$folder/slurmctld.pid") pid_file left=''
  [[ ! -e "$folder/munged-is-ours" ]] || pid_files+=(/run/munge/munged.pid)
  for pid_file in "${pid_files[@]}"; do end_daemon "$pid_file" || left+=" $pid_file"; done
  [[ -z "$left" ]] || die "these do not end:$left"
}

case "${1:-}" in
  start | stop) [[ -n "${2:-}" ]] || die "which folder?"; "$1" "$(realpath -m "$2")" ;;
  *) die "usage: one-node-slurm.sh start|stop FOLDER" ;;
esac
