#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Fails when the worker is linked with a database or a ray caster: it has no part in them.
# Usage: check_worker_links.sh WORKER
set -euo pipefail
libraries=$(ldd "$1")
if grep -E 'lib(pq|sqlite3|embree[0-9]*)\.so' <<<"$libraries"; then
  echo "$1: is linked with what is named above" >&2
  exit 1
fi
grep -q 'libgrpc' <<<"$libraries" || { echo "$1: the list of its libraries does not name gRPC, is it a worker?" >&2; exit 1; }
echo "no database and no ray caster among $(wc -l <<<"$libraries") libraries"
