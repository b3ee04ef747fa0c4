#!/bin/bash
# Workers of one SLURM job, and a server on the login node: sbatch deploy/slurm.sh, then
#   coopnav serve --cluster "$(cat $HOME/coopnav-scheduler)" \
#     --cluster-ca tls/ca.pem --cluster-cert tls/node.pem --cluster-key tls/node.key
# The nodes of a cluster are shared: the traffic goes by TLS, with the certificates that DEPLOY.md tells how to make.
#SBATCH --job-name=coopnav
#SBATCH --ntasks=32
#SBATCH --cpus-per-task=1
#SBATCH --mem-per-cpu=2G
#SBATCH --time=08:00:00
set -euo pipefail
BIN=${COOPNAV_BIN:-$HOME/coopnav/bin}
TLS=${COOPNAV_TLS:-$HOME/tls}
KEYS=(--tls-ca-file "$TLS/ca.pem" --tls-cert "$TLS/node.pem" --tls-key "$TLS/node.key")
PORT=$((20000 + SLURM_JOB_ID % 20000))
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
# Dask's web servers ask nobody who he is: they get nothing to say.
export DASK_DISTRIBUTED__SCHEDULER__HTTP__ROUTES='[]' DASK_DISTRIBUTED__WORKER__HTTP__ROUTES='[]'

"$BIN/dask" scheduler --protocol tls --port "$PORT" --no-dashboard "${KEYS[@]}" &
trap 'kill $!' EXIT
echo "tls://$(hostname):$PORT" >"$HOME/coopnav-scheduler"
srun "$BIN/dask" worker "tls://$(hostname):$PORT" --nthreads 1 --memory-limit 2GB --no-dashboard "${KEYS[@]}"
