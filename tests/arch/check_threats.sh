#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Every row of the threat table in docs/security.md names tests that there are: "Suite.Test", or a suite.
# Usage: check_threats.sh [ROOT]
set -euo pipefail
cd "${1:-$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)}"
tests=$(grep -rhoE --include='*_test.cc' --include='*_conformance.h' '^TEST(_F|_P)?\([A-Za-z0-9]+, [A-Za-z0-9]+\)' \
  common program coordinator worker pipeline tests | sed -E 's/^TEST(_F|_P)?\(//; s/, /./; s/\)$//' | sort -u)
status=0
rows=0
while IFS= read -r row; do
  rows=$((rows + 1))
  mapfile -t named < <(awk -F ' \\| ' '{print $NF}' <<<"$row" | grep -oE '`[^`]+`' | tr -d '`')
  if [[ ${#named[@]} -eq 0 ]]; then echo "no test: $row" && status=1; fi
  for name in "${named[@]}"; do
    if [[ $name == *.* ]] && grep -qxF "$name" <<<"$tests"; then continue; fi
    if [[ $name != *.* ]] && grep -q "^$name\\." <<<"$tests"; then continue; fi
    echo "there is no test $name: ${row:0:60}"
    status=1
  done
done < <(sed -n '/^## Threats/,/^$/p' docs/security.md | grep '^| ' | tail -n +2)
if [[ $rows -lt 10 ]]; then echo "docs/security.md: $rows rows of threats, expected at least 10" && status=1; fi
exit "$status"
