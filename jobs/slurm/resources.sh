# shellcheck shell=bash disable=SC2034
# SPDX-License-Identifier: Apache-2.0
# What the jobs of jobs/submit.sh ask of Slurm, and what they run. Copy it, change it, and give it with --resources.

# Options of every job, for example --partition=long --account=project --qos=normal
slurm_options=()

# srun (with PMIx, as Debian's OpenMPI wants it) or mpirun
launcher=srun
srun_options=(--mpi=pmix)
# The settings let mpirun notice a lost node within about 90 s (docs/hosts.md); srun leaves that to Slurm.
mpirun_options=(--mca oob_tcp_keepalive_time 60 --mca oob_tcp_keepalive_intvl 10 --mca oob_tcp_keepalive_probes 3)

# Ranks, memory per rank and the time limit: for one field, for one case's registrations, for the report.
precompute_ranks=8 precompute_memory=2G precompute_time=02:00:00
evaluate_ranks=8 evaluate_memory=2G evaluate_time=08:00:00
report_memory=4G report_time=00:30:00

# A job gets TERM this many seconds before its time limit, and when it is pre-empted. Then it saves, and is queued again.
stop_seconds=120
# A job is queued again at most this many times, and at most this many times in a row without finishing anything. Without
# these limits a job that never progresses would repeat for ever.
most_requeues=50 most_fruitless=3

# Options of the programs, beside study, case, camera and output. For example: --stall-minutes 60 (the watchdog's
# limit), --max-hours 7.5 (a stop where no signal comes before the time limit).
precompute_options=(--max-rotation-deg 10 --max-translation-mm 30)
evaluate_options=(--preset robust --renderer field)
